"""Colours of ages: known points of viridis, monotone brightness, a round full scale."""

import numpy as np
import pytest

from swarm_mj.replay import palette


def test_fresh_is_viridis_brightest_and_unknown_is_grey():
    rgb = palette.age_colours(np.array([0.0, np.nan]), 100.0)
    assert tuple(rgb[0]) == (253, 231, 37)
    assert tuple(rgb[1]) == palette.UNKNOWN


def test_older_is_darker_until_the_scale_ends():
    rgb = palette.age_colours(np.linspace(0.0, 100.0, 50), 100.0).astype(float)
    luma = rgb @ np.array([0.299, 0.587, 0.114])  # ITU-R BT.601
    assert np.all(np.diff(luma) < 0)
    at_end, beyond = palette.age_colours(np.array([100.0, 1e6]), 100.0)
    assert tuple(beyond) == tuple(at_end)


@pytest.mark.parametrize(("value", "top"), [(0.0, 1.0), (6.4, 10.0), (1.2, 1.5), (0.003, 0.003)])
def test_axes_end_at_round_numbers(value, top):
    assert palette.nice_top(value) == pytest.approx(top)


def test_dim_keeps_the_hue():
    assert palette.dim((200, 100, 50), 0.5) == (100, 50, 25)


def test_curves_of_videos_are_no_colours_of_ages():
    ages = palette.age_colours(np.linspace(0.0, 1.0, 100), 1.0).astype(float)
    for curve in palette.FILM_CURVES:
        assert np.min(np.linalg.norm(ages - curve, axis=1)) > 100.0
