"""A frame against the radio itself, and against loops that follow one timestamp at a time."""

import numpy as np
import pytest
from small_frames import NUM_ROBOTS, NUM_SLOTS, RADIO, RULE, aged, frame_of, team

from swarm_mj.policies.sotdma.frame import NOWHERE, add, empty_frame, mean_age, mean_ages, remove


@pytest.mark.parametrize("seed", range(8))
def test_eqs_3_4_robots_hear_in_a_frame_whom_the_radio_lets_them_hear(seed):
    position_m, power = team(seed)
    slots = np.random.default_rng(seed).integers(0, 3, NUM_ROBOTS)
    frame = frame_of(power, slots)
    everyone = np.arange(NUM_ROBOTS)
    for s in range(NUM_SLOTS):
        recipient = np.where(slots == s, -1, everyone)
        heard = RADIO(position_m[None], recipient[None])[0]
        np.testing.assert_array_equal(frame.heard[s], heard)


def test_more_interference_than_believed_can_only_silence():
    _, power = team(3)
    slots = np.random.default_rng(3).integers(0, 2, NUM_ROBOTS)
    plain, cautious = frame_of(power, slots), frame_of(power, slots, interference=3.0)
    is_heard = cautious.heard != np.arange(NUM_ROBOTS)
    np.testing.assert_array_equal(cautious.heard[is_heard], plain.heard[is_heard])
    assert np.sum(is_heard) < np.sum(plain.heard != np.arange(NUM_ROBOTS))


@pytest.mark.parametrize(
    ("seed", "num_robots"), [(0, 9), (1, 9), (2, 9), (3, 64), (4, 65), (5, 130)]
)
def test_eq10_the_mean_ages_are_those_of_robots_told_one_by_one(seed, num_robots):
    """A robot is tried in each slot, in teams of a word of robots and of more; some are silent."""
    rng, everyone = np.random.default_rng(seed), np.arange(num_robots)
    own = rng.integers(NOWHERE, NUM_SLOTS, num_robots)
    own[0] = NOWHERE
    heard = np.tile(everyone, (NUM_SLOTS, 1))
    for s in range(NUM_SLOTS):
        senders, hears = np.flatnonzero(own == s), (rng.random(num_robots) < 0.5) & (own != s)
        if len(senders) > 0:
            heard[s, hears] = rng.choice(senders, np.sum(hears))
    hears_it = (rng.random(heard.shape) < 0.3) & (own != np.arange(NUM_SLOTS)[:, None])
    tried = np.where(hears_it | (everyone == 0), 0, heard)
    frame = empty_frame(np.zeros((num_robots, num_robots)), RULE)
    frame = frame._replace(heard=heard, slot=own)
    ages = mean_ages(frame, tried, 0)
    for s in range(NUM_SLOTS):
        trial = heard.copy()
        trial[s] = tried[s]
        expected = pytest.approx(aged(trial), rel=1e-12)
        assert ages[s] == expected
        assert mean_age(frame, tried, s) == expected


@pytest.mark.parametrize("seed", range(3))
def test_a_robot_that_is_removed_leaves_the_frame_as_if_it_had_never_been_added(seed):
    _, power = team(seed)
    slots = np.random.default_rng(seed).integers(0, NUM_SLOTS, NUM_ROBOTS)
    frame = frame_of(power, slots)
    remove(frame, 4)
    without = np.where(np.arange(NUM_ROBOTS) == 4, NOWHERE, slots)
    expected = frame_of(power, without)
    np.testing.assert_array_equal(frame.slot, without)
    np.testing.assert_array_equal(frame.heard, expected.heard)
    add(frame, int(slots[4]), 4)
    np.testing.assert_array_equal(frame.heard, frame_of(power, slots).heard)
