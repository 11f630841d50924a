"""When flocks have agreed, and how fast they come to that, by hand."""

import math

import numpy as np
import pytest

from swarm_mj.control.motion import initial_velocity
from swarm_mj.mission import paper
from swarm_mj.protocol.agreement import (
    agreed_window,
    decay,
    perfect_rate,
    perfect_variance,
    settled_window,
)
from swarm_mj.protocol.costs import velocity_variance


@pytest.mark.parametrize(
    ("variance", "expected"),
    [
        ([4.0, 1.0, 0.03, 0.02], 3.0),
        ([4.0, 0.04, 0.039], 3.0),  # under 1 %, not at it
        ([4.0, 0.03, 0.05, 0.03], 4.0),  # for good
        ([4.0, 0.03, 0.05], np.nan),  # not at the end
        ([4.0], np.nan),
        ([0.0, 0.0, 0.0], np.nan),  # robots at rest
    ],
)
def test_it_is_the_first_window_from_which_on_hardly_any_variance_is_left(variance, expected):
    """Counted from 1; the mission beside it, whose flock agreed at once, changes nothing."""
    beside = [4.0] + [0.0] * (len(variance) - 1)
    found = agreed_window(np.stack([variance, beside], axis=1))
    np.testing.assert_array_equal(found[0], expected)
    assert len(variance) == 1 or found[1] == 2.0


def test_windows_without_a_number_end_an_agreement():
    """A controller may lead robots beyond all numbers."""
    course = np.array([[4.0], [0.01], [np.nan], [0.01]])
    np.testing.assert_array_equal(agreed_window(course), [4.0])


def test_other_costs_settle_below_a_limit_of_their_own():
    course = np.array([[9.0, 9.0, 1.0], [4.0, 5.0, 2.0], [3.0, 6.0, 3.0]])
    np.testing.assert_array_equal(settled_window(course, 5.0), [2.0, np.nan, 1.0])
    np.testing.assert_array_equal(settled_window(course, 3.0), [np.nan, np.nan, np.nan])


def falling(rate, num_windows=60):
    """A variance that falls from 6 at one rate."""
    return 6.0 * np.exp(-rate * np.arange(num_windows))


def test_a_decay_is_measured_exactly():
    course = np.stack([falling(0.21), falling(0.07)], axis=1)
    found = decay(course)
    np.testing.assert_allclose(found.rate, [0.21, 0.07], rtol=1e-12)
    np.testing.assert_allclose(found.error, 0.0, atol=1e-12)


def test_only_the_first_three_e_foldings_count():
    course = falling(0.2)
    course[20:] = 1e-9
    np.testing.assert_allclose(decay(course[:, None]).rate, 0.2, rtol=1e-12)


def test_an_error_says_how_far_the_course_is_from_a_line():
    """The same as NumPy's own fit."""
    course = falling(0.2, 16) * np.exp(0.3 * np.cos(np.arange(16)))
    found = decay(course[:, None])
    last = int(np.argmax(course < math.exp(-3.0) * course[0])) + 1
    line, spread = np.polyfit(np.arange(last), np.log(course[:last]), 1, cov=True)
    assert found.rate == pytest.approx(-line[0], rel=1e-9)
    assert found.error == pytest.approx(math.sqrt(spread[0, 0]), rel=1e-9)
    assert found.error > 0.001


@pytest.mark.parametrize(
    "course",
    [
        [6.0, 5.0, 4.0, 3.0],  # never 5 % of the first
        [6.0, 0.1, 0.01],  # at once
        [0.0, 0.0, 0.0, 0.0],  # at rest
        [6.0, 1.0, 0.0, 0.0],  # 0 has no logarithm
        [6.0, np.nan, 1.0, 0.01],
    ],
)
def test_what_does_not_fall_so_far_has_no_rate(course):
    found = decay(np.array(course)[:, None])
    assert np.isnan(found.rate[0])
    assert np.isnan(found.error[0])


def test_perfect_knowledge_takes_a_tenth_of_the_spread_in_a_window():
    assert math.exp(-perfect_rate(0.1)) == pytest.approx(0.81)


@pytest.mark.parametrize(
    ("window_s", "left"), [(0.5, 0.25), (1.0, 0.0), (1.5, 0.25), (2.0, 1.0), (10.0, 1.0)]
)
def test_perfect_knowledge_in_long_windows_by_hand(window_s, left):
    """Half of each difference is left after 0.5 s, and as much of the other sign after 1.5 s."""
    assert math.exp(-perfect_rate(window_s)) == pytest.approx(left)
    mission = paper("flocking", num_robots=4, num_windows=2, window_s=window_s)
    found = perfect_variance(mission)
    start = 2.0 * mission.max_velocity_mps**2 / 3.0 * 0.75
    np.testing.assert_allclose(found, [start * left, start * left**2], atol=1e-12)


def test_perfect_knowledge_leaves_81_percent_of_the_variance_in_each_window_by_hand():
    """Of 4 robots within 3 m/s: 2 axes of 3² / 3 each, of which 3/4 is about the team's mean."""
    mission = paper("flocking", num_robots=4, num_windows=3, velocity_ratio=0.15)
    expected = 2 * 3.0 * 0.75 * np.array([0.81, 0.81**2, 0.81**3])
    np.testing.assert_allclose(perfect_variance(mission), expected)


def test_the_variance_that_it_falls_from_is_that_of_start_velocities():
    """Over 4000 teams of 5, whose mean variance is known to 1 %."""
    mission = paper("flocking", num_robots=5, num_windows=1)
    rng = np.random.default_rng(0)
    velocity_mps = np.stack([initial_velocity(mission, rng) for _ in range(4000)])
    found = np.mean(velocity_variance(velocity_mps))
    assert perfect_variance(mission)[0] / 0.81 == pytest.approx(found, rel=0.03)
