"""Carrier sensing: who holds back for whom, hidden terminals, and how often two begin at once."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.carrier_sense import (
    DRAWN_MINISLOTS,
    MINISLOTS,
    AgeGainCsma,
    CarrierSense,
    beginners,
    covered_share,
    sensed_dbm,
)
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.protocol.window import LocalViews, Phase
from swarm_mj.radio.mission_radio import TrueLinks, radio_of
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("stationary")
SENSED_MW = 10**-5.7


@pytest.mark.parametrize(("noise_dbm", "expected"), [(-50.0, -57.0), (-94.0, -101.0)])
def test_robots_sense_two_and_a_half_times_as_far_as_they_decode(noise_dbm, expected):
    mission = paper("stationary", noise_dbm=noise_dbm)
    assert sensed_dbm(mission) == expected
    radio = radio_of(mission)
    sensed_m = np.sqrt(radio.received_at_1_m_mw / 10 ** (expected / 10))
    assert sensed_m == pytest.approx(2.5 * mission.range_m, rel=0.01)
    assert sensed_dbm(paper("stationary", sensing_dbm=-60.0)) == -60.0


def begun(minislot, power_mw, sensed_mw=1.0, is_active=None):
    """The robots that transmit, by name of their place in the list."""
    minislot = np.asarray(minislot, dtype=float)
    active = np.ones(len(minislot), dtype=bool) if is_active is None else np.array(is_active)
    power_mw = np.asarray(power_mw, dtype=float)
    return list(np.flatnonzero(beginners(minislot, active, power_mw, sensed_mw)))


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


def test_a_robot_that_failed_neither_transmits_nor_is_sensed():
    assert begun([0, 1, 2], in_line(3), is_active=[False, True, True]) == [1]


def test_power_that_is_just_sensed_is_busy_and_powers_add_up():
    power_mw = np.zeros((3, 3))
    power_mw[0, 2] = power_mw[1, 2] = 0.5
    assert begun([0, 1, 2], power_mw) == [0, 1]
    assert begun([0, 1, 2], power_mw, sensed_mw=1.01) == [0, 1, 2]


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 12))
def test_who_transmits_is_who_heard_too_little_before(seed, num_robots):
    """The rule read backwards: a robot transmits if, and only if, those before it are too weak."""
    rng = np.random.default_rng(seed)
    minislot = rng.integers(0, 5, num_robots).astype(float)
    power_mw = rng.exponential(1.0, (num_robots, num_robots))
    found = begun(minislot, power_mw, 1.5)
    for j in range(num_robots):
        earlier_mw = sum(power_mw[i, j] for i in found if minislot[i] < minislot[j])
        assert (j in found) == (earlier_mw < 1.5)


def started(probability, num_robots, num_missions=1):
    policy = CarrierSense(probability, -57.0)
    policy.inform(TrueLinks(radio=radio_of(MISSION)))
    policy.start(num_robots, [np.random.default_rng((3, b)) for b in range(num_missions)])
    return policy


def slots(probability, position_m, num_slots):
    """Who transmits [slot, robot]."""
    position_m = np.array([position_m], dtype=float)
    num_robots = position_m.shape[1]
    policy, buffers = started(probability, num_robots), empty_buffers(1, num_robots)
    views = LocalViews(buffers=buffers, now=np.zeros(1), phases=())
    states = RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
    return np.stack([policy.recipients(views, states)[0] == BROADCAST for _ in range(num_slots)])


@pytest.mark.parametrize("probability", [0.1, 0.6])
def test_two_neighbours_begin_together_as_geometric_draws_do(probability):
    """The sum of p² (1 - p)^2k over minislots k is p / (2 - p); else one of them transmits."""
    sent = slots(probability, [[0, 0], [100, 0]], 3000)
    expected = probability / (2 - probability)
    error = 5 * math.sqrt(expected * (1 - expected) / 3000)
    assert np.mean(np.all(sent, axis=1)) == pytest.approx(expected, abs=error)
    assert np.all(np.any(sent, axis=1))


def test_robots_that_never_begin_or_always():
    assert not np.any(slots(0.0, [[0, 0], [100, 0]], 20))
    assert np.all(slots(1.0, [[0, 0], [100, 0]], 20))


def test_the_default_threshold_is_sensed_at_two_and_a_half_times_the_range():
    sensed_m = radio_of(MISSION).received_at_1_m_mw / SENSED_MW
    assert math.sqrt(sensed_m) == pytest.approx(2.5 * MISSION.range_m, rel=0.01)
    apart_m = 2.4 * MISSION.range_m
    assert np.mean(np.all(slots(0.01, [[0, 0], [apart_m, 0]], 500), axis=1)) < 0.05
    assert np.all(slots(0.01, [[0, 0], [apart_m * 1.1, 0]], 20))


def test_most_packets_of_robots_that_sense_are_heard():
    """Most broadcasts are heard by somebody, which is not so under slotted ALOHA."""
    shares = {}
    for name in ("csma", "aloha"):
        swarm = Swarm(paper("stationary", num_windows=60), range(4))
        policy = make_policy(name, swarm.mission, 0.02 if name == "csma" else 0.8)
        packets = [swarm.step(policy).packets for _ in range(60)]
        shares[name] = sum(p.heard.sum() for p in packets) / sum(p.sent.sum() for p in packets)
    assert shares["csma"] > 0.8 > shares["aloha"]


def views_of(timestamp, position_m, heard, now=10.0):
    """One mission's views: T, where all are and everyone believes all are, and whom each heard."""
    num_robots = len(position_m)
    buffers = empty_buffers(1, num_robots)
    buffers.timestamp[0] = timestamp
    buffers.position_m[0] = np.broadcast_to(position_m, (num_robots, num_robots, 2))
    heard = np.array([heard])
    phases = (Phase(recipient=np.full_like(heard, BROADCAST), heard=heard),)
    return LocalViews(buffers=buffers, now=np.full(1, now), phases=phases)


@pytest.mark.parametrize("ranges", [0.0, 0.4, 1.0, 1.9, 3.0])
def test_the_share_of_a_range_that_the_sender_covers_is_that_of_points_drawn_in_it(ranges):
    apart_m = ranges * MISSION.range_m
    share = covered_share(views_of(0.0, [[0, 0], [apart_m, 0]], [1, 1]), MISSION.range_m)
    drawn = np.random.default_rng(1).uniform(-1, 1, (200_000, 2))
    inside = drawn[np.linalg.norm(drawn, axis=1) <= 1.0]
    expected = np.mean(np.linalg.norm(inside - [ranges, 0], axis=1) <= 1.0)
    assert share[0, 0] == pytest.approx(expected, abs=0.005)
    assert share[0, 1] == 0.0  # it decoded nobody
    before = replace(views_of(0.0, [[0, 0], [apart_m, 0]], [1, 1]), phases=())
    assert not np.any(covered_share(before, MISSION.range_m))


def age_gain_csma(num_robots, mission=MISSION):
    policy = AgeGainCsma(mission)
    policy.inform(TrueLinks(radio=radio_of(mission)))
    policy.start(num_robots, [np.random.default_rng(5)])
    return policy


def test_twice_the_news_begins_earlier_and_who_has_none_does_not_begin():
    timestamp = np.diag([0.0, 2.0, 4.0, 8.0])
    views = views_of(timestamp, np.zeros((4, 2)), range(4))
    (minislot,) = age_gain_csma(4).minislots(views)
    assert np.isinf(minislot[0])
    np.testing.assert_allclose(-np.diff(minislot[1:]), MINISLOTS, atol=DRAWN_MINISLOTS)


def test_news_that_neighbours_have_heard_with_one_count_less():
    """1 and 2 learn alike: 1 from a robot in its own place, and 2 from one at its range."""
    timestamp = np.array([[9, 0, 0], [9, 0.5, 0], [9, 0, 0.5]])
    edge = [[0.0, 0.0], [0.0, 0.0], [MISSION.range_m, 0.0]]
    policy = age_gain_csma(3)
    policy.minislots(views_of(timestamp, edge, [0, 0, 0]))
    assert policy._news[0, 0] == 3.0
    assert policy._news[0, 1] == pytest.approx(0.0)
    assert policy._news[0, 2] == pytest.approx(9.5 / 3 * (1 - 0.391), abs=1e-3)


def test_who_has_transmitted_has_no_news_until_it_learns_something():
    policy, place = age_gain_csma(2), np.array([[[0.0, 0.0], [100.0, 0.0]]])
    states = RobotStates(position_m=place, velocity_mps=np.zeros_like(place))
    views = views_of(np.diag([1.0, 8.0]), place[0], [0, 1])
    turns = [(policy.recipients(views, states)[0] == BROADCAST).tolist() for _ in range(3)]
    assert turns == [[False, True], [True, False], [False, False]]


@pytest.mark.parametrize(("slot", "ranges"), [(0, 2.0), (1, 2.5), (2, 3.15), (3, 4.0), (4, 2.0)])
def test_two_robots_transmit_together_if_they_do_not_sense_each_other_in_that_slot(slot, ranges):
    for factor, num_senders in ((0.98, 1), (1.02, 2)):
        place = np.array([[[0.0, 0.0], [factor * ranges * MISSION.range_m, 0.0]]])
        states = RobotStates(position_m=place, velocity_mps=np.zeros_like(place))
        views = views_of(np.diag([8.0, 1.0]), place[0], [0, 1], now=slot / 2)
        recipient = age_gain_csma(2).recipients(views, states)
        assert np.sum(recipient == BROADCAST) == num_senders


def test_a_robot_begins_by_what_has_reached_it_alone():
    """In a flight, all that the others know and hear is replaced by anything."""
    rng, mission = np.random.default_rng(4), paper("random-walk", num_robots=20)
    swarm, other = Swarm(mission, [1]), age_gain_csma(20, mission)
    others = np.arange(20) != 5

    class Doubted(AgeGainCsma):
        def minislots(self, views):
            buffers, phases = copy.deepcopy((views.buffers, views.phases))
            buffers.timestamp[:, others] += rng.uniform(0, 9, (1, 19, 20))
            buffers.position_m[:, others] = rng.uniform(-900, 900, (1, 19, 20, 2))
            for phase in phases:
                phase.heard[:, others] = rng.integers(0, 20, (1, 19))
            # Both draw the same numbers, and know who was silent.
            other._news[...], other._known[...] = self._news, self._known
            other._stream = copy.deepcopy(self._stream)
            again = other.minislots(replace(views, buffers=buffers, phases=phases))
            minislot = super().minislots(views)
            seen.append((minislot[0, 5], again[0, 5]))
            return minislot

    seen = []
    policy = Doubted(mission)
    for _ in range(60):
        swarm.step(policy)
    once, doubted = zip(*seen, strict=True)
    assert once == doubted
    assert len(set(once)) > 20


@pytest.mark.parametrize("task", ["stationary", "random-walk", "flocking"])
def test_robots_that_let_news_go_first_are_younger_than_those_that_draw(task):
    mission = paper(task, num_robots=30, num_windows=150)
    ages = {
        name: np.mean([swarm.step(policy).age_windows for _ in range(150)])
        for name in ("csma", "age-gain-csma")
        for swarm, policy in [(Swarm(mission, range(3)), make_policy(name, mission))]
    }
    assert ages["age-gain-csma"] < 0.8 * ages["csma"]
