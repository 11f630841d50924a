"""What a packet was worth, against missions that are flown again with one transmission changed."""

import numpy as np
import pytest
from broadcast_scripts import flown

from swarm_mj.learning.residual.worth import Course, worth
from swarm_mj.mission import paper

NUM_SLOTS, NUM_ROBOTS = 40, 7


def worths(course, slots, missions, heard, horizon):
    """The same as values."""
    saved = np.full(len(slots), np.nan)
    worth(course, np.asarray(slots), np.asarray(missions), np.asarray(heard), horizon, saved)
    return saved


@pytest.mark.parametrize("horizon", [1, 2, 9, 100])
@pytest.mark.parametrize(
    "channel", [{}, {"erasure": 0.3}, {"fading": "rayleigh"}, {"switched_off": 0.3}], ids=str
)
def test_it_is_what_the_mission_flown_again_with_that_one_change_costs_more(channel, horizon):
    """Two missions of random talk, and in each of the others one robot does otherwise once."""
    num_changes = 24
    rng = np.random.default_rng(horizon)
    mission = paper("stationary", num_robots=NUM_ROBOTS, num_windows=NUM_SLOTS // 2, **channel)
    talk = rng.random((NUM_SLOTS, 2, NUM_ROBOTS)) < 0.3
    of, slots = rng.integers(0, 2, num_changes), rng.integers(0, NUM_SLOTS, num_changes)
    script, changes = talk[:, [0, 1, *of]], 2 + np.arange(num_changes)
    robots = rng.integers(0, NUM_ROBOTS, num_changes)
    script[slots, changes, robots] ^= True
    observed, heard = flown(mission, [5, 6, *(5 + of)], script)
    age_saved = observed[:, changes].astype(int) - observed[:, of]
    expected = [
        age_saved[s + 1 : s + 1 + horizon, n].sum() for n, s in enumerate(slots)
    ]  # younger by so much, summed over pairs and slots
    course = Course(observed[:, :2].copy(), heard[:, :2].copy())
    found = worths(course, slots, of, heard[slots, changes], horizon)
    np.testing.assert_array_equal(found, expected)
    assert np.count_nonzero(found > 0.0) > 3
    assert np.count_nonzero(found < 0.0) > 1


# Robot 0 tells robot 1 in slot 0, robot 1 tells robot 2 in slot 1, and nobody talks in slot 2.
HEARD = np.array([[[0, 0, 2]], [[0, 1, 1]], [[0, 1, 2]]])
OBSERVED = np.array(
    [
        [[[0, 0, 0], [0, 0, 0], [0, 0, 0]]],
        [[[1, 0, 0], [1, 1, 0], [0, 0, 1]]],
        [[[2, 0, 0], [1, 2, 0], [1, 2, 2]]],
        [[[3, 0, 0], [1, 3, 0], [1, 2, 3]]],
    ],
    dtype=np.int32,
)
COURSE = Course(OBSERVED, HEARD)
NOBODY = np.arange(3)


@pytest.mark.parametrize(
    ("horizon", "lost"),
    [
        (1, 1),  # robot 1 knows nothing of robot 0
        (2, 1 + 2),  # nor has it anything to pass on to robot 2
        (3, 1 + 2 + 2),
        (4, 1 + 2 + 2),  # the mission is over
    ],
)
def test_what_a_packet_leads_to_is_counted_up_to_the_horizon(horizon, lost):
    assert worths(COURSE, [0], [0], [NOBODY], horizon) == [-lost]


def test_a_slot_that_goes_as_it_went_is_worth_nothing():
    assert np.all(worths(COURSE, [0, 1, 2], [0, 0, 0], HEARD[:, 0], 3) == 0.0)


def test_old_news_is_worth_nothing():
    """In slot 2 robot 2 hears of robot 0 again, from robot 1: only of robot 1 there is news."""
    assert worths(COURSE, [2], [0], [[0, 1, 1]], 3) == [1]


def test_whoever_is_switched_off_learns_nothing_of_itself():
    """Robot 2 stands still at tick 1; what robot 1 says of itself in slot 2 is news to robot 0."""
    observed = OBSERVED.copy()
    observed[2:, 0, 2] = [0, 0, 1]
    heard = np.tile(NOBODY, (3, 1, 1))
    heard[0] = HEARD[0]
    assert worths(Course(observed, heard), [2], [0], [[1, 1, 2]], 1) == [3]
