"""Colours of ages: known points of viridis, monotone brightness, a round full scale."""

import numpy as np
import pytest

from swarm_mj.replay import palette


def brightness(rgb):
    """Luma (ITU-R BT.601)."""
    return rgb @ np.array([0.299, 0.587, 0.114])


def test_fresh_is_viridis_brightest_and_unknown_is_grey():
    ages = np.array([0.0, 30.0])
    rgb = palette.age_colours(ages, 100.0, np.array([True, False]))
    assert tuple(rgb[0]) == (253, 231, 37)
    assert tuple(rgb[1]) == palette.UNKNOWN


def test_older_is_darker_until_the_scale_ends():
    ages = np.linspace(0.0, 100.0, 50)
    rgb = palette.age_colours(ages, 100.0, np.ones(50, dtype=bool)).astype(float)
    assert np.all(np.diff(brightness(rgb)) < 0)
    beyond = palette.age_colours(np.array([100.0, 1e6]), 100.0, np.ones(2, dtype=bool))
    assert tuple(beyond[0]) == tuple(beyond[1])


@pytest.mark.parametrize(
    ("upper_quartile", "scale"),
    [(0.2, 1.0), (3.0, 5.0), (42.0, 50.0), (51.0, 100.0), (100.0, 100.0)],
)
def test_the_full_scale_is_round_and_reaches_three_ages_in_four(upper_quartile, scale):
    ages = np.full(9, upper_quartile)
    assert palette.nice_scale(ages) == scale


def test_dim_keeps_the_hue():
    assert palette.dim((200, 100, 50), 0.5) == (100, 50, 25)
