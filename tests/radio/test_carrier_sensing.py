"""Carrier sensing: who holds back for whom, hidden terminals, and what no receiver senses."""

import math
from dataclasses import replace

import numpy as np
import pytest
from antennas import write_rover
from hypothesis import given
from hypothesis import strategies as st
from walls import walls

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.radio.carrier_sensing import CarrierSensing, Contention, beginners, usual_busy_dbm
from swarm_mj.radio.mission_radio import mission_radio, radio_of

MISSION = paper("stationary")
NEVER = math.inf


@pytest.mark.parametrize("noise_dbm", [-50.0, -94.0])
def test_robots_sense_two_and_a_half_times_as_far_as_they_decode(noise_dbm):
    """8 dB less than what just decodes, 7 dB below the noise, is 10^(8/20) = 2.5 times the way."""
    mission = paper("stationary", noise_dbm=noise_dbm)
    busy_dbm = usual_busy_dbm(mission)
    assert busy_dbm == noise_dbm - 7.0
    sensed_m = np.sqrt(radio_of(mission).received_at_1_m_mw / 10 ** (busy_dbm / 10))
    assert sensed_m == pytest.approx(2.5 * mission.range_m, rel=0.01)


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"sensing_dbm": -52.0}, -52.0),
        ({"sensing_gain_db": 6.0}, -53.0),  # the floor: -50 + 3 - 6
        ({"sensing_gain_db": 20.0}, -57.0),  # far enough
        ({"sinr_threshold_db": 6.0}, -52.0),  # -50 + 6 - 8
        ({"sinr_threshold_db": -6.0}, -57.0),  # the floor, not -64
    ],
)
def test_the_usual_power_is_the_missions_own_or_as_far_as_robots_sense(fields, expected):
    assert usual_busy_dbm(paper("stationary", **fields)) == expected


def begun(minislot, power_mw, busy_mw=1.0, contends=None):
    """The robots that transmit, by name of their place in the list."""
    minislot = np.asarray(minislot, dtype=float)
    contends = np.ones(len(minislot), dtype=bool) if contends is None else np.array(contends)
    power_mw = np.asarray(power_mw, dtype=float)
    busy_mw = np.broadcast_to(np.asarray(busy_mw, dtype=float), minislot.shape).copy()
    return list(np.flatnonzero(beginners(minislot, contends, power_mw, busy_mw)))


def in_line(num_robots, reach=1):
    """Robots in a line that each sense those at most `reach` places away."""
    place = np.arange(num_robots)
    return (abs(place[:, None] - place) <= reach) * 2.0


def test_a_robot_holds_back_for_those_it_senses_only():
    assert begun([0, 1, 2], in_line(3)) == [0, 2]  # hidden terminals: 0 and 2 both reach 1
    assert begun([1, 0, 2], in_line(3)) == [1]
    assert begun([0, 1, 2, 3, 4], in_line(5, reach=2)) == [0, 3]


def test_robots_of_one_minislot_do_not_sense_each_other():
    assert begun([3, 3, 4], in_line(3)) == [0, 1]


def test_a_robot_that_held_back_silences_nobody():
    assert begun([0, 1, 2, 3], in_line(4)) == [0, 2]


def test_a_robot_that_does_not_contend_neither_transmits_nor_is_sensed():
    assert begun([0, 1, 2], in_line(3), contends=[False, True, True]) == [1]


def test_power_that_is_just_sensed_is_busy_and_powers_add_up():
    power_mw = np.zeros((3, 3))
    power_mw[0, 2] = power_mw[1, 2] = 0.5
    assert begun([0, 1, 2], power_mw) == [0, 1]
    assert begun([0, 1, 2], power_mw, busy_mw=1.01) == [0, 1, 2]


def test_each_robot_holds_back_from_its_own_power():
    assert begun([0, 1, 2], in_line(3, reach=2), busy_mw=[1.0, 2.5, 2.5]) == [0, 1]
    assert begun([0, 1, 2], in_line(3, reach=2), busy_mw=[1.0, 1.0, np.inf]) == [0, 2]


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 12))
def test_who_transmits_is_who_heard_too_little_before(seed, num_robots):
    """The rule read backwards: a robot transmits if, and only if, those before it are too weak."""
    rng = np.random.default_rng(seed)
    minislot = rng.integers(0, 5, num_robots).astype(float)
    power_mw = rng.exponential(1.0, (num_robots, num_robots))
    busy_mw = rng.uniform(0.5, 2.5, num_robots)
    found = begun(minislot, power_mw, busy_mw)
    for j in range(num_robots):
        earlier_mw = sum(power_mw[i, j] for i in found if minislot[i] < minislot[j])
        assert (j in found) == (earlier_mw < busy_mw[j])


def at(*x_m):
    """Robots in a line, at these places."""
    position_m = np.array([[[x, 0.0] for x in x_m]])
    return RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))


def started(mission, num_robots=2, *, obstacles=None, seeds=(3,)):
    truth = mission_radio(mission, obstacles).truth
    if truth.channel is not None:
        truth.channel.start(num_robots, [np.random.default_rng(seed) for seed in seeds])
    sensing = CarrierSensing(mission, truth)
    sensing.start(num_robots, [np.random.default_rng(seed) for seed in seeds])
    return sensing


def transmits(sensing, minislot, states, busy_dbm=-57.0):
    minislot = np.array([minislot], dtype=float)
    return sensing.transmit(Contention(minislot, np.full(minislot.shape, busy_dbm)), states)[0]


@pytest.mark.parametrize(
    ("fields", "asked_dbm", "ranges"),
    [
        ({}, -57.0, 2.5),
        ({}, -67.0, 2.5),  # the floor, whatever a policy asks for
        ({}, -51.0, 1.26),  # 2 dB below what decodes
        ({"sensing_gain_db": 0.0}, -57.0, 0.79),  # 3 dB over the noise, 2 over what decodes
        ({"sensing_gain_db": 20.0}, -67.0, 7.9),
    ],
)
def test_how_far_robots_sense(fields, asked_dbm, ranges):
    mission = paper("stationary", **fields)
    sensing = started(mission)
    for factor, second in ((0.98, False), (1.02, True)):
        states = at(0.0, factor * ranges * mission.range_m)
        assert transmits(sensing, [0, 1], states, asked_dbm).tolist() == [True, second]


def test_robots_behind_a_wall_are_not_sensed():
    """A wall of 20 dB; as far away in the open, the second robot holds back."""
    assert transmits(started(MISSION), [0, 1], at(-200.0, 200.0)).tolist() == [True, False]
    behind = started(paper("stationary", num_robots=2), obstacles=walls(0.01, 0))
    assert transmits(behind, [0, 1], at(-200.0, 200.0)).tolist() == [True, True]


def test_antennas_with_gain_are_sensed_farther_off(tmp_path):
    """Twice 6 dB less 3 dB of power are 9 dB: 2.8 times as far as without, 2.5 ranges."""
    sensing = started(paper("stationary", num_robots=2, robot=write_rover(tmp_path)))
    for factor, second in ((0.98, False), (1.02, True)):
        position_m = np.full((1, 2, 3), 0.1)
        position_m[0, :, 0] = [0.0, factor * 2.5 * 10 ** (9.0 / 20.0) * MISSION.range_m]
        states = RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
        assert transmits(sensing, [0, 1], states).tolist() == [True, second]


def test_a_robot_that_failed_neither_transmits_nor_is_sensed():
    states = replace(at(0.0, 100.0), is_active=np.array([[False, True]]))
    assert transmits(started(MISSION), [0, 1], states).tolist() == [False, True]


def test_a_slot_has_so_many_minislots_and_no_moments_between_them():
    sensing = started(paper("stationary", minislots=4), num_robots=3)
    apart = at(0.0, 5000.0, 10_000.0)
    assert transmits(sensing, [3, 3.9, 4], apart).tolist() == [True, True, False]
    assert transmits(sensing, [0, NEVER, -1], apart).tolist() == [True, False, False]
    near = at(0.0, 10.0, 20.0)
    assert transmits(sensing, [2.1, 2.8, 3], near).tolist() == [True, True, False]


def shares(mission, minislot, num_slots=4000, busy_dbm=-57.0):
    """How often each of two neighbours transmits."""
    sensing = started(mission)
    states = at(0.0, 100.0)
    sent = [transmits(sensing, minislot, states, busy_dbm) for _ in range(num_slots)]
    return np.mean(sent, axis=0)


def test_who_misses_a_packet_transmits_into_it():
    share = shares(paper("stationary", sensing_miss=0.2), [0, 1])
    assert share[0] == 1.0
    assert share[1] == pytest.approx(0.2, abs=5 * math.sqrt(0.2 * 0.8 / 4000))


def test_who_senses_what_is_not_there_is_silent():
    """The second robot hears the first in 0.7 of all slots, and nothing in 0.7 of the others."""
    share = shares(paper("stationary", sensing_false_alarm=0.3), [0, 1])
    assert share[0] == pytest.approx(0.7, abs=5 * math.sqrt(0.21 / 4000))
    assert share[1] == pytest.approx(0.3 * 0.7, abs=5 * math.sqrt(0.21 * 0.79 / 4000))


def test_who_does_not_listen_has_no_false_alarm():
    mission = paper("stationary", sensing_false_alarm=1.0)
    assert shares(mission, [0, 1], 20, busy_dbm=math.inf).tolist() == [1.0, 1.0]
    assert shares(mission, [0, 1], 20).tolist() == [0.0, 0.0]


def test_errors_are_each_missions_own():
    """Two missions side by side err as each does alone."""
    mission = paper("stationary", sensing_miss=0.3, sensing_false_alarm=0.3)
    states = at(0.0, 100.0)
    both = RobotStates(
        position_m=np.repeat(states.position_m, 2, axis=0),
        velocity_mps=np.zeros((2, 2, 2)),
    )
    together = started(mission, seeds=(3, 8))
    contention = Contention(np.array([[0.0, 1.0]] * 2), np.full((2, 2), -57.0))
    sent = np.stack([together.transmit(contention, both) for _ in range(100)])
    for b, seed in enumerate((3, 8)):
        alone = started(mission, seeds=(seed,))
        expected = [transmits(alone, [0, 1], states) for _ in range(100)]
        np.testing.assert_array_equal(sent[:, b], expected)


@pytest.mark.parametrize(
    ("minislot", "busy_dbm", "complaint"),
    [
        (np.zeros((1, 3)), np.zeros((1, 2)), "minislots of a contention must be one number"),
        (np.zeros((1, 2)), np.zeros((2, 2)), "busy_dbm of a contention must be one number"),
        (np.array([[0.0, np.nan]]), np.zeros((1, 2)), r"of shape \(1, 2\), missions by robots"),
    ],
)
def test_what_is_no_contention_is_refused(minislot, busy_dbm, complaint):
    with pytest.raises(ValueError, match=complaint):
        started(MISSION).transmit(Contention(minislot, busy_dbm), at(0.0, 100.0))
