"""A frame against the radio itself, and against loops that follow one timestamp at a time."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.sotdma.periodic import NOWHERE, best_slot, empty_frame, mean_age, move
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.radio.power_law import power_law, powers_between

RADIO = radio_of(paper("stationary"))
NUM_ROBOTS, NUM_SLOTS, FRAMES = 9, 5, 3


def team(seed):
    """Positions [m], and powers between them [noise]."""
    position_m = np.random.default_rng(seed).uniform(-400.0, 400.0, (NUM_ROBOTS, 2))
    at_1_m = np.full(NUM_ROBOTS, RADIO.received_at_1_m_mw / RADIO.noise_mw)
    return position_m, powers_between(position_m, power_law(at_1_m))


def frame_of(power, slots, interference=1.0):
    """A frame in which robot k transmits in `slots[k]`, unless that is `NOWHERE`."""
    frame = empty_frame(power, RADIO.threshold, interference, NUM_SLOTS, FRAMES, 10.0)
    for k, slot in enumerate(slots):
        move(frame, k, NOWHERE, slot)
    return frame


def aged(heard):
    """Mean age in the last frame [slots]: every robot is told, one after the other."""
    known = np.full((NUM_ROBOTS, NUM_ROBOTS), -10.0)
    ages = []
    for now in range(1, FRAMES * NUM_SLOTS + 1):
        np.fill_diagonal(known, now)
        said = known.copy()
        for j, sender in enumerate(heard[(now - 1) % NUM_SLOTS]):
            known[j] = np.maximum(known[j], said[sender])
        ages.append(np.mean(now - known))
    return np.mean(ages[-NUM_SLOTS:])


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


@pytest.mark.parametrize("seed", range(4))
def test_eq10_the_mean_age_is_that_of_robots_told_one_by_one(seed):
    _, power = team(seed)
    frame = frame_of(power, np.random.default_rng(seed).integers(0, NUM_SLOTS, NUM_ROBOTS))
    assert mean_age(frame) == pytest.approx(aged(frame.heard), rel=1e-5)


@pytest.mark.parametrize("seed", range(6))
def test_the_best_slot_is_the_youngest_of_all_that_were_tried(seed):
    """The frame is as before; a marked listener is deaf; the least gain keeps the present slot."""
    _, power = team(seed)
    rng = np.random.default_rng(seed)
    slots = rng.integers(0, NUM_SLOTS, NUM_ROBOTS)
    slots[4] = NOWHERE
    frame = frame_of(power, slots)
    before = frame.heard.copy(), frame.transmits.copy()
    is_marked = rng.random((NUM_SLOTS, NUM_ROBOTS)) < 0.3
    ages = []
    for s in range(NUM_SLOTS):
        heard = frame_of(power, [*slots[:4], s, *slots[5:]]).heard
        deaf = (heard[s] == 4) & is_marked[s]
        heard[s] = np.where(deaf & (np.arange(NUM_ROBOTS) != 4), np.arange(NUM_ROBOTS), heard[s])
        ages.append(aged(heard))
    worst, apart = int(np.argmax(ages)), max(ages) - min(ages)
    for own, least_gain in ((0, 0.0), (worst, 0.5 * apart)):
        chosen = best_slot(frame, 4, own, least_gain, is_marked)
        assert ages[chosen] == pytest.approx(min(ages), rel=1e-5)
    assert best_slot(frame, 4, worst, 1.5 * apart, is_marked) == worst
    np.testing.assert_array_equal(frame.heard, before[0])
    np.testing.assert_array_equal(frame.transmits, before[1])
