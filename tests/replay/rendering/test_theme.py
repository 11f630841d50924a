"""Themes: their colours stay apart, and the light one is seen on a white page."""

import numpy as np
import pytest

from swarm_mj.replay.palette import BROADCAST
from swarm_mj.replay.rendering.theme import DARK, LIGHT, THEMES


def brightness(colour):
    return float(np.dot(colour, (0.299, 0.587, 0.114)))


@pytest.mark.parametrize("name", THEMES)
def test_texts_curves_and_the_observer_are_far_from_their_ground(name):
    theme = THEMES[name]
    for colour in (theme.text, theme.note, theme.ego, *theme.curves):
        assert abs(brightness(colour) - brightness(theme.background)) > 70
    assert max(np.abs(np.subtract(*theme.curves))) > 100


def test_one_theme_is_dark_and_one_is_light():
    assert brightness(DARK.background) < 30
    assert brightness(LIGHT.background) > 240


def test_what_matters_less_is_nearer_to_the_ground():
    assert LIGHT.mixed((0, 100, 200), 0.5) == (128, 178, 228)
    assert LIGHT.mixed((1, 2, 3), 0.0) == LIGHT.background


def test_packets_are_darker_on_a_light_ground():
    assert DARK.shown(BROADCAST) == BROADCAST
    assert brightness(LIGHT.shown(BROADCAST)) < 0.8 * brightness(BROADCAST)
