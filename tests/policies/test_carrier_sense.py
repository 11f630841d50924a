"""Policies that sense: when their robots listen, and how often two begin at once."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.carrier_sense import (
    DRAWN_SHARE,
    LEAST_NEWS,
    NUM_TURNS,
    TURN_EVERY,
    AgeGainCsma,
    CarrierSense,
    SensingPolicy,
    covered_share,
)
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.protocol.window import LocalViews, Phase
from swarm_mj.radio.carrier_sensing import Contention
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("stationary")
TURN = TURN_EVERY - 1  # the first slot of a mission that is a turn


class Alone:
    """A radio over which nobody senses anybody; it remembers what it was asked."""

    def __call__(self, contention):
        self.minislot, self.busy_dbm = contention
        return np.isfinite(contention.minislot)


def started(policy, num_robots, sensing=None):
    policy.listen(sensing or Alone())
    policy.start(num_robots, [np.random.default_rng(5)])
    return policy


def views_of(timestamp, position_m, heard, now=10.0, sent=()):
    """One mission's views: T, where all are and everyone believes all are, whom each heard."""
    num_robots = len(position_m)
    buffers = empty_buffers(1, num_robots)
    buffers.timestamp[0] = timestamp
    buffers.position_m[0] = np.broadcast_to(position_m, (num_robots, num_robots, 2))
    recipient = np.arange(num_robots)
    recipient[list(sent)] = BROADCAST
    phases = (Phase(recipient=recipient[None], heard=np.array([heard])),)
    return LocalViews(buffers=buffers, now=np.full(1, now), phases=phases)


def drawn(probability, num_slots, num_robots=2):
    """The minislots that robots draw [slot, robot]."""
    policy = started(CarrierSense(probability, -57.0), num_robots)
    views = views_of(0.0, np.zeros((num_robots, 2)), range(num_robots))
    return np.stack([policy.contend(views).minislot[0] for _ in range(num_slots)])


@pytest.mark.parametrize("probability", [0.1, 0.6])
def test_minislots_are_drawn_as_geometric_numbers(probability):
    """The share of minislot m is p (1 - p)^m; two are equal in p / (2 - p) of all slots."""
    minislot = drawn(probability, 6000)
    for m in range(4):
        expected = probability * (1 - probability) ** m
        error = 5 * math.sqrt(expected * (1 - expected) / minislot.size)
        assert np.mean(minislot == m) == pytest.approx(expected, abs=error)
    expected = probability / (2 - probability)
    error = 5 * math.sqrt(expected * (1 - expected) / len(minislot))
    assert np.mean(minislot[:, 0] == minislot[:, 1]) == pytest.approx(expected, abs=error)


def test_robots_that_never_begin_or_always():
    assert np.all(np.isinf(drawn(0.0, 20)))
    assert not np.any(drawn(1.0, 20))


def test_a_robot_that_draws_no_minislot_of_the_slot_is_silent():
    """Of two that do not sense each other, each begins in 1 - 0.98^32 of all slots: 0.476."""
    mission = paper("stationary", num_robots=2, minislots=32, sensing_miss=1.0)
    swarm = Swarm(mission, range(200))
    policy = make_policy("csma", mission, 0.02)
    swarm.start(policy)
    share = np.mean([swarm.decide() == BROADCAST for _ in range(20)])
    assert share == pytest.approx(0.476, abs=5 * math.sqrt(0.25 / 8000))


@pytest.mark.parametrize("name", ["csma", "age-gain-csma"])
def test_robots_hold_back_from_the_missions_power(name):
    for busy_dbm in (-57.0, -50.0):
        mission = paper("stationary", num_robots=3, sensing_dbm=busy_dbm)
        radio = Alone()
        policy = started(make_policy(name, mission), 3, radio)
        policy.recipients(views_of(np.eye(3), np.zeros((3, 2)), range(3), now=0.0))
        assert radio.busy_dbm.tolist() == [[busy_dbm] * 3]


@pytest.mark.parametrize("name", ["csma", "age-gain-csma", "index-csma"])
def test_a_policy_learns_of_the_truth_who_transmits_and_nothing_else(name):
    """Its robots transmit if the radio says so, and it is handed no true links."""

    def only_the_second(_):
        return np.array([[False, True, False]])

    policy = started(make_policy(name, MISSION), 3, only_the_second)
    views = views_of(np.eye(3), np.zeros((3, 2)), range(3))
    assert policy.recipients(views).tolist() == [[0, BROADCAST, 2]]
    swarm = Swarm(paper("stationary", num_robots=3), [1])
    swarm.start(policy)
    assert not hasattr(policy, "_truth")


def test_what_others_sense_by_the_true_places_reaches_no_policy():
    """Teams that are alike but for where they truly are contend alike until they have talked."""

    class Seen(CarrierSense):
        def contend(self, views):
            contention = super().contend(views)
            asked.append(contention.minislot.tolist())
            return contention

    mission = paper("stationary", num_robots=10)
    sent = []
    asked = []
    for scale in (1.0, 30.0):
        swarm = Swarm(mission, [1])
        swarm._physics.place(scale * swarm.states.position_m, swarm.states.velocity_mps)
        swarm.start(Seen(0.1, -57.0))
        sent.append(np.sum(swarm.decide() == BROADCAST))
    assert asked[0] == asked[1]
    assert sent[0] < sent[1]  # far apart, nobody holds back


class InOrder(SensingPolicy):
    """Robots go by their numbers, and hold back for all that they sense."""

    def contend(self, views):
        minislot = views.silence.astype(float)
        return Contention(minislot, np.full_like(minislot, -57.0))


def test_a_policy_of_ones_own_may_sense():
    swarm = Swarm(paper("stationary", num_robots=5, range_ratio=1.0), [1, 2])
    for _ in range(3):
        packets = swarm.step(InOrder()).packets
        assert packets.sent.tolist() == [2, 2]  # the first robot, in both slots


@pytest.mark.parametrize(("minislot_us", "entries"), [(0.0, 40), (20.0, 38), (100.0, 34)])
def test_minislots_take_their_time_from_packets(minislot_us, entries):
    """A slot of 367 bytes; 64 of 20 µs take 9.4 bytes of it, and leave 357: 7 and 38 times 9."""
    mission = paper(bit_rate=367 * 160.0, minislot_us=minislot_us)
    for name in ("csma", "age-gain-csma", "index-csma"):
        assert make_policy(name, mission).packet(mission).num_entries == entries
    assert make_policy("tdma", mission).packet(mission).num_entries == 40
    short = paper(bit_rate=16 * 160.0, minislot_us=minislot_us)
    if minislot_us > 0.0:
        with pytest.raises(ValueError, match="16 bytes for a single entry, but a slot holds 1"):
            make_policy("csma", short).packet(short)


def test_most_packets_of_robots_that_sense_are_heard():
    """Most broadcasts are heard by somebody, which is not so under slotted ALOHA."""
    shares = {}
    for name in ("csma", "aloha"):
        swarm = Swarm(paper("stationary", num_windows=60), range(4))
        policy = make_policy(name, swarm.mission, 0.02 if name == "csma" else 0.8)
        packets = [swarm.step(policy).packets for _ in range(60)]
        shares[name] = sum(p.heard.sum() for p in packets) / sum(p.sent.sum() for p in packets)
    assert shares["csma"] > 0.8 > shares["aloha"]


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


class Undrawn:
    """Draws that are all 0."""

    def __init__(self, num_robots):
        self._num_robots = num_robots

    def next(self):
        return np.zeros((1, self._num_robots))


def age_gain_csma(num_robots, mission=MISSION, sensing=None):
    return started(AgeGainCsma(mission), num_robots, sensing)


@pytest.mark.parametrize("minislots", [64, 256])
def test_twice_the_news_begins_earlier_and_who_has_little_does_not_begin(minislots):
    """News of 1, 2 and 4 windows; the first robot has less than `LEAST_NEWS`.

    From that to 4 windows, which begin first in a team of 4, news doubles 3.32 times.
    """
    assert LEAST_NEWS == 0.4
    timestamp = 4.0 * np.diag([0.3, 1.0, 2.0, 4.0])
    views = views_of(timestamp, np.zeros((4, 2)), range(4), now=200.0)
    policy = age_gain_csma(4, paper("stationary", minislots=minislots))
    (minislot,) = policy.contend(views).minislot
    assert np.isinf(minislot[0])
    most_drawn = DRAWN_SHARE * minislots + 1.0
    np.testing.assert_allclose(-np.diff(minislot[1:]), minislots / 3.32, atol=most_drawn)


def test_much_news_begins_first_and_little_news_last():
    """Three robots with news of 3 windows and more begin in the first minislots, as is drawn."""
    timestamp = 3.0 * np.diag([3.0, 100.0, LEAST_NEWS + 1e-9])
    views = views_of(timestamp, np.zeros((3, 2)), range(3), now=200.0)
    for seed in range(20):
        policy = age_gain_csma(3)
        policy.start(3, [np.random.default_rng(seed)])
        (minislot,) = policy.contend(views).minislot
        assert 0 <= minislot[0] < 4
        assert 0 <= minislot[1] < 4
        assert minislot[2] == 63


@pytest.mark.parametrize(("num_robots", "first"), [(20, 20.0), (40, 40.0), (90, 40.0)])
def test_news_of_as_many_windows_as_robots_but_at_most_40_begins_first(num_robots, first):
    """A fifth less begins later, in 1024 minislots that are enough to see it."""
    news = np.full(num_robots, first)
    news[1] = 0.8 * first
    timestamp = num_robots * np.diag(news)
    nowhere = np.zeros((num_robots, 2))
    policy = age_gain_csma(num_robots, paper("stationary", minislots=1024))
    policy._stream = Undrawn(num_robots)
    (minislot,) = policy.contend(views_of(timestamp, nowhere, range(num_robots))).minislot
    assert minislot[0] == 0
    assert minislot[1] > 0


def test_news_that_neighbours_have_heard_with_one_count_less():
    """1 and 2 learn alike: 1 from a robot in its own place, and 2 from one at its range."""
    timestamp = np.array([[9, 0, 0], [9, 0.5, 0], [9, 0, 0.5]])
    edge = [[0.0, 0.0], [0.0, 0.0], [MISSION.range_m, 0.0]]
    policy = age_gain_csma(3)
    policy.contend(views_of(timestamp, edge, [0, 0, 0]))
    assert policy._news[0, 0] == 3.0
    assert policy._news[0, 1] == pytest.approx(0.0)
    assert policy._news[0, 2] == pytest.approx(9.5 / 3 * (1 - 0.391), abs=1e-3)


def test_who_has_transmitted_has_no_news_until_it_learns_something():
    """Means of T rise by 2 and 4 windows, and then by none; the second robot transmits between."""
    policy, place = age_gain_csma(2), np.zeros((2, 2))
    timestamp = np.diag([4.0, 8.0])
    policy.contend(views_of(timestamp, place, [0, 1]))
    assert policy._news.tolist() == [[2.0, 4.0]]
    policy.contend(views_of(timestamp, place, [0, 1], sent=[1]))
    assert policy._news.tolist() == [[2.0, 0.0]]
    policy.contend(views_of(timestamp + np.diag([0.0, 1.0]), place, [0, 1]))
    assert policy._news.tolist() == [[2.0, 0.5]]


@pytest.mark.parametrize(
    ("num_robots", "turn", "owners"),
    [(3, 0, [0]), (3, 4, [1]), (40, 39, [39]), (90, 1, [1, 41, 81]), (90, 79, [39, 79])],
)
def test_in_each_fifth_slot_the_owner_of_the_turn_transmits(num_robots, turn, owners):
    assert (TURN_EVERY, NUM_TURNS) == (5, 40)
    radio = Alone()
    policy = age_gain_csma(num_robots, sensing=radio)
    now = (5 * turn + 4) / 2  # the turn's slot begins
    nowhere = np.zeros((num_robots, 2))
    recipient = policy.recipients(views_of(9.0, nowhere, range(num_robots), now=now))
    assert np.flatnonzero(recipient[0] == BROADCAST).tolist() == owners
    assert np.all(np.isinf(radio.busy_dbm))  # whatever it senses
    recipient = policy.recipients(views_of(9.0, nowhere, range(num_robots), now=now + 0.5))
    assert np.all(recipient == BROADCAST)  # all have news, and nobody senses the others


def test_a_robot_begins_by_what_has_reached_it_alone():
    """In a flight, all that the others know and hear is replaced by anything."""
    rng, mission = np.random.default_rng(4), paper("random-walk", num_robots=20)
    swarm, other = Swarm(mission, [1]), age_gain_csma(20, mission)
    others = np.arange(20) != 5

    class Doubted(AgeGainCsma):
        def contend(self, views):
            buffers, phases = copy.deepcopy((views.buffers, views.phases))
            buffers.timestamp[:, others] += rng.uniform(0, 9, (1, 19, 20))
            buffers.position_m[:, others] = rng.uniform(-900, 900, (1, 19, 20, 2))
            for phase in phases:
                phase.heard[:, others] = rng.integers(0, 20, (1, 19))
                phase.recipient[:, others] = rng.integers(0, 20, (1, 19))
            # Both draw the same numbers.
            other._news[...], other._known[...] = self._news, self._known
            other._stream = copy.deepcopy(self._stream)
            again = other.contend(replace(views, buffers=buffers, phases=phases))
            contention = super().contend(views)
            seen.append((contention.minislot[0, 5], again.minislot[0, 5]))
            return contention

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


@pytest.mark.parametrize(
    ("name", "robots"),
    [("csma", 3), ("age-gain-csma", 3), ("index-csma", 3), ("csma", 8), ("age-gain-csma", 20)],
)
def test_teams_among_blocks_come_to_know_everyone(name, robots):
    """Robots that no wall lets sense each other must not transmit in every slot."""
    mission = paper("stationary", num_robots=robots, arena="blocks")
    swarm = Swarm(mission, range(930_000, 930_006))
    policy = make_policy(name, mission)
    for _ in range(150):
        swarm.step(policy)
    knows = swarm.buffers.is_known | np.eye(robots, dtype=bool)
    assert np.all(knows)
