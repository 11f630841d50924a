"""One broadcast after the other, or several far apart: the orders, the rule by hand, the law."""

import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.spatial.distance import pdist, squareform
from spatial_rule import agreed_senders

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.tdma import SpatialTdma, Tdma, winners
from swarm_mj.protocol.buffers import NEVER, empty_buffers
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm

NUM_ROBOTS = 6
MISSION = paper("stationary", num_robots=20)


def views_at(half, num_missions, num_robots):
    """Views of robots that know of nobody."""
    now = np.full(num_missions, half * SLOT_WINDOWS)
    return LocalViews(buffers=empty_buffers(num_missions, num_robots), now=now, phases=())


def decided(num_slots, num_missions=2):
    """Who transmits [slot, mission, robot]."""
    policy = Tdma()
    policy.start(NUM_ROBOTS, [np.random.default_rng((7, b)) for b in range(num_missions)])
    views = (views_at(slot, num_missions, NUM_ROBOTS) for slot in range(num_slots))
    return np.stack([policy.transmits(each) for each in views])


def speakers(is_sending):
    """The one robot that transmits [slot, mission]."""
    assert np.all(np.sum(is_sending, axis=-1) == 1)
    return np.argmax(is_sending, axis=-1)


def test_everyone_broadcasts_once_a_round_in_the_same_order():
    speaking = speakers(decided(3 * NUM_ROBOTS))
    for b in range(2):
        rounds = speaking[:, b].reshape(3, NUM_ROBOTS)
        assert sorted(rounds[0]) == list(range(NUM_ROBOTS))
        np.testing.assert_array_equal(rounds[1:], [rounds[0]] * 2)


def test_orders_are_drawn_alike_from_each_missions_own_numbers():
    """The robot that begins is uniform over the team, and missions do not depend on each other."""
    first = speakers(decided(1, num_missions=1200))[0]
    assert stats.chisquare(np.bincount(first, minlength=NUM_ROBOTS)).pvalue > 1e-4
    np.testing.assert_array_equal(decided(9, 3)[:, :1], decided(9, 1))


@pytest.mark.parametrize("num_robots", [2, 5, 8])
def test_age_of_a_fully_connected_team_is_its_closed_form(num_robots):
    """Whoever spoke is as old, at the N - 1 others, as the slots since.

    After h >= N of them those are 0, 1, ..., N - 1 for the N robots, together N (N - 1) / 2 slots
    of 0.5. Over all N² pairs, own ages of 0 included, that is (N - 1)² / (4 N): 0.8 windows
    for 5 robots. Earlier, the h that spoke are 0, ..., h - 1 old, the other N - h are h old.
    """
    mission = paper("stationary", num_robots=num_robots, range_ratio=10.0)
    swarm, policy = Swarm(mission, [1, 2]), Tdma()
    for window in range(1, 30):
        h = 2 * window
        if h >= num_robots:
            expected = (num_robots - 1) ** 2 / (4 * num_robots)
        else:
            halves_old = h * (h - 1) / 2 + (num_robots - h) * h
            expected = 0.5 * halves_old * (num_robots - 1) / num_robots**2
        np.testing.assert_allclose(swarm.step(policy).age_windows, expected, rtol=1e-12)


# With spatial reuse.


def views_of(position_m, is_known, half=0):
    """Views of one mission in which robot i just heard that j is at position_m[j], if ever."""
    views = views_at(half, 1, len(position_m))
    views.buffers.position_m[:] = position_m
    views.buffers.timestamp[:] = np.where(is_known, 1.0 + views.now, NEVER)
    return views


def senders(policy, views):
    """Who broadcasts in the one mission."""
    return set(np.flatnonzero(policy.transmits(views)[0]).tolist())


def in_order(threshold=1.0):
    """The policy of four robots with a range of 250 m, in the order of their identities."""
    policy = SpatialTdma(replace(MISSION, sinr_threshold_db=10.0 * math.log10(threshold)))
    policy.start(4, [np.random.default_rng(0)])
    policy._order = np.arange(4)[None]
    return policy


@pytest.mark.parametrize(
    ("x_m", "threshold", "half", "expected"),
    [
        # At 250 m of range and threshold 1 robot 2 joins robot 0: robot 1 decodes (250/100)² = 6.25
        # against 1 + (250/900)², and robot 3 gains. In turn 1 robot 3 is asked first, in turn 2
        # robot 0, in turn 3 robot 1.
        *(
            ([0.0, 100.0, 1000.0, 1100.0], 1.0, half, expected)
            for half, expected in enumerate([{0, 2}, {1, 3}, {0, 2}, {1, 3}, {0, 2}])
        ),
        # Robot 1 decodes robot 0 at (250/240)² = 1.09, and needs 1.92 beside robot 2, 260 m off, or
        # 1.48 beside robot 3, 360 m off: nobody joins who would take a packet from somebody.
        ([0.0, 240.0, 500.0, 600.0], 1.0, 0, {0}),
        # Robot 2 is 2 km from all others: its packet would be of no use.
        ([0.0, 100.0, 2000.0, 50.0], 1.0, 0, {0}),
        # Robot 2 joins robot 0, for robot 3. Robot 1 decodes neither: (250/200)² = 1.56 against
        # 1 + (250/260)². Only robot 2 could decode it, and is sending: no listener gains.
        ([0.0, 260.0, 460.0, 560.0], 1.0, 0, {0, 2}),
        # With threshold h packets at the range arrive h above the noise. Robot 1 decodes
        # (250/100)² = 6.25 of them against 1 + h (250/200)² beside robot 2: up to h = 3.36. Beside
        # robot 3 it needs 1 + h (250/300)², which is 3.78 at h = 4.
        ([0.0, 100.0, 300.0, 400.0], 1.0, 0, {0, 2}),
        ([0.0, 100.0, 300.0, 400.0], 3.3, 0, {0, 2}),
        ([0.0, 100.0, 300.0, 400.0], 4.0, 0, {0, 3}),
    ],
)
def test_who_joins_by_hand(x_m, threshold, half, expected):
    """Of four on a line that know where everyone is, in the order of their identities."""
    policy = in_order(threshold)
    assert senders(policy, views_of(np.stack([x_m, np.zeros(4)], axis=1), True, half)) == expected


def test_an_owner_without_news_for_two_rounds_a_hop_is_left_alone():
    """Robot 2 is 1000 m, four ranges, from robot 0: five hops, ten rounds of two windows."""
    position_m = np.stack([[0.0, 100.0, 1000.0, 1100.0], np.zeros(4)], axis=1)
    views = views_of(position_m, True, half=100)
    views.buffers.timestamp[0, 2, 0] = views.now[0] - 20.0
    assert senders(in_order(), views) == {0, 2}
    views.buffers.timestamp[0, 2, 0] -= 0.5
    assert senders(in_order(), views) == {0}
    views.buffers.timestamp[0, 2, 1] -= 100.0  # not of the owner
    assert senders(in_order(), replace(views, now=views.now + 0.5)) == {1, 3}


@given(
    seed=st.integers(0, 2**32 - 1),
    num_robots=st.integers(2, 25),
    threshold_db=st.sampled_from([-5.0, 1.0, 6.0]),
)
def test_eq3_robots_that_know_all_decide_by_the_rule_and_the_others_wait(
    seed, num_robots, threshold_db
):
    """The radio judges; half of the robots do not know one of the others."""
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-500, 500, size=(num_robots, 2))
    is_known = np.ones((num_robots, num_robots))
    ignorant = rng.permutation(num_robots)[: num_robots // 2]
    is_known[ignorant, (ignorant + rng.integers(1, num_robots)) % num_robots] = 0
    mission = replace(MISSION, sinr_threshold_db=threshold_db)
    policy = SpatialTdma(mission)
    policy.start(num_robots, [rng])
    (order,) = policy._order
    half = int(rng.integers(0, 100))
    agreed = agreed_senders(order, half, position_m, radio_of(mission))
    expected = (agreed - set(ignorant.tolist())) | {order[half % num_robots]}
    assert senders(policy, views_of(position_m, is_known, half)) == expected


@pytest.mark.parametrize("seed", [1, 2])
def test_a_team_at_rest_loses_nothing_and_gains_by_joining(seed):
    """From the start on all in range decode the owner; so nobody's knowledge is ever older than
    under plain TDMA in the same order, and in the end it is younger."""
    swarms = Swarm(MISSION, [seed]), Swarm(MISSION, [seed])
    spatial, plain = make_policy("spatial-tdma", MISSION), Tdma()
    distance_m = squareform(pdist(swarms[0].states.position_m[0]))
    is_near = (distance_m <= MISSION.range_m) & ~np.eye(20, dtype=bool)
    for window in range(150):
        swarms[0].step(spatial)
        swarms[1].step(plain)
        for half, phase in enumerate(swarms[0].phases):
            owner = spatial._order[0, (2 * window + half) % 20]
            assert np.all(phase.heard[0, is_near[owner]] == owner)
        assert np.all(swarms[0].buffers.timestamp >= swarms[1].buffers.timestamp)
    assert np.any(swarms[0].buffers.timestamp > swarms[1].buffers.timestamp)


# Contention in large teams.

LARGE = paper("random-walk", num_robots=130)


def contend(believed_m, timestamp, draw, noted_at=None, news=None, heard=None, num_expected=0.0):
    """Who wins in one mission with a range of 250 m, hence a reach of 350 m; news is written."""
    num_robots = len(timestamp)
    noted_at = timestamp if noted_at is None else noted_at
    news = np.zeros_like(timestamp) if news is None else news
    news = news.astype(np.float32)[None]
    heard = np.arange(num_robots) if heard is None else heard
    noted_at = noted_at.astype(np.float32)[None]
    wins = winners(
        timestamp=timestamp[None],
        believed_m=believed_m[None],
        heard=heard[None],
        priority_draw=draw[None, 0],
        rarity_draw=draw[None, 1],
        range_m=250.0,
        num_expected=num_expected,
        noted_at=noted_at,
        news=news,
    )
    return wins[0], news[0]


def test_news_by_hand():
    """Robot 0 decodes robot 1, which had heard robot 2: T rises by 1 + 2 of others, 0.5 of itself.

    Robot 3 is in range of robot 1, so it learned these 3, too, and is silent for another 0.5;
    robot 4 is out of its range. Robots 1 and 2 have sent: their news is the time since, and for
    robot 2 what it decoded with robot 0.
    """
    believed_m = np.zeros((5, 5, 2))
    believed_m[..., 0] = [0.0, 100.0, 200.0, 300.0, 400.0]
    before, timestamp = np.full((5, 5), 8.0), np.full((5, 5), 8.0)
    before[0], timestamp[0] = [10, 9, 8, 7, 6], [10.5, 10, 10, 7, 6]
    heard, draw = np.array([1, 1, 2, 3, 4]), np.full((2, 5), 0.5)
    _, news = contend(believed_m, timestamp, draw, before, np.full((5, 5), 20.0), heard)
    np.testing.assert_array_equal(news[0], [23.5, 0.5, 3.5, 23.5, 20.5])
    np.testing.assert_array_equal(news[1:], 20.0)  # they decoded nothing


@given(seed=st.integers(0, 2**32 - 1))
def test_of_robots_that_believe_the_same_one_wins_wherever_robots_are_in_reach(seed):
    """The first by ln(u) / news³ wins, and none in reach of it does."""
    rng = np.random.default_rng(seed)
    position_m, news = rng.uniform(0, 1000, (30, 2)), rng.uniform(0, 50, 30)
    draw = rng.random((2, 30))
    wins, _ = contend(
        np.tile(position_m, (30, 1, 1)), np.ones((30, 30)), draw, news=np.tile(news, (30, 1))
    )
    priority = np.log(draw[0]) / (news.astype(np.float32) + 0.5) ** 3
    is_near = squareform(pdist(position_m)) <= 350.0
    first = [bool(np.all(priority[is_near[i]] <= priority[i])) for i in range(30)]
    assert wins.tolist() == first


def test_robots_that_are_expected_but_not_known_make_a_robot_win_less_often():
    """Robot 1 has lower numbers; of 4 robots expected 2 are known, so half of all draws win."""
    draw, timestamp = np.array([[0.9, 0.1, 0.99], [0.49, 0.0, 0.0]]), np.ones((3, 3))
    timestamp[:, 2] = 0.0  # never heard of
    for second, wins in ((0.49, True), (0.51, False)):
        draw[1, 0] = second
        decided, _ = contend(np.zeros((3, 3, 2)), timestamp, draw, num_expected=4.0)
        assert decided.tolist()[:2] == [wins, False]


@pytest.mark.parametrize(("silence", "wins"), [(1.0, False), (2.0, True)])
def test_robots_that_were_silent_for_a_round_of_turns_do_not_contend(silence, wins):
    """Three robots' round takes one and a half windows; robot 2 has the highest number."""
    draw, timestamp = np.array([[0.5, 0.1, 0.9], [0.0, 0.0, 0.0]]), np.full((3, 3), 100.0)
    timestamp[0, 2] -= silence
    assert contend(np.zeros((3, 3, 2)), timestamp, draw)[0][0] == wins


def test_a_robot_s_own_news_grows_by_what_it_decodes_from_afar():
    """Fading may carry a packet further than the range."""
    believed_m, before = np.zeros((2, 2, 2)), np.full((2, 2), 8.0)
    believed_m[:, 1] = 300.0
    timestamp, heard = before + np.array([[0.5, 3.0], [0.0, 0.0]]), np.array([1, 1])
    _, news = contend(believed_m, timestamp, np.full((2, 2), 0.5), before, before, heard)
    assert news[0, 0] == 8.0 + 0.5 + 3.0


class Doubted(SpatialTdma):
    """Decides twice: as it is, and with all that has not reached one robot replaced by anything."""

    def start(self, num_robots, rngs):
        """Prepare both, with the same order."""
        super().start(num_robots, rngs)
        self.rng, self.decided, self.other = np.random.default_rng(5), [], SpatialTdma(LARGE)
        self.other.start(num_robots, [self.rng])
        self.other._order, self.other._draws = self._order, copy.deepcopy(self._draws)

    def transmits(self, views):
        """Note what robot 5 decides either way."""
        is_sending = super().transmits(views)
        buffers, phases = copy.deepcopy(views.buffers), copy.deepcopy(views.phases)
        others = np.arange(130) != 5
        buffers.position_m[:, others] = self.rng.uniform(-900, 900, (1, 129, 130, 2))
        buffers.timestamp[:, others] *= self.rng.random((1, 129, 130)) < 0.9
        for phase in phases:
            phase.heard[:, others] = self.rng.integers(0, 130, (1, 129))
        again = self.other.transmits(replace(views, buffers=buffers, phases=phases))
        self.decided.append((bool(is_sending[0, 5]), bool(again[0, 5])))
        return is_sending


def test_a_robot_decides_by_what_has_reached_it_alone():
    """In a flight of a large team, all that the others know and hear is replaced by anything."""
    policy, swarm = Doubted(LARGE), Swarm(LARGE, [3])
    for _ in range(100):
        swarm.step(policy)
    once, again = zip(*policy.decided, strict=True)
    assert once == again
    assert sum(once) > 4  # turns alone are 2 of 200 slots


def test_large_teams_are_younger_than_by_turns_and_small_ones_fly_as_if_nobody_contended():
    ages = {}
    for mission in (LARGE, replace(LARGE, num_robots=100)):
        for contends in (True, False):
            policy, swarm = SpatialTdma(mission), Swarm(mission, [1])
            policy._contends = policy._contends and contends
            policy.start(mission.num_robots, [np.random.default_rng(2)])
            ages[mission.num_robots, contends] = [swarm.step(policy).age_windows for _ in range(60)]
    assert np.mean(ages[130, True]) < 0.95 * np.mean(ages[130, False])
    np.testing.assert_array_equal(ages[100, True], ages[100, False])
