import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from standing_teams import Team, flooded_team, knowledge_after, received, single_pairs

from swarm_mj.mission import paper, reference
from swarm_mj.physics.state import BOX, Obstacles, RobotStates
from swarm_mj.policies.greedy_oracle import greedy_window, packet_gains, window_gains
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.links import KNOWN, Links, links_between
from swarm_mj.radio.mission_radio import TrueLinks, mission_radio, radio_of
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

seeds = st.integers(0, 2**32 - 1)


def decided(policy, team):
    """Whom each robot addresses."""
    buffers = empty_buffers(1, team.num_robots)
    buffers.timestamp[:] = team.timestamp
    views = LocalViews(buffers=buffers, now=np.array([team.now]), phases=())
    position_m = team.position_m[None]
    states = RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
    return policy.recipients(views, states)[0].tolist()


def aoi(name, task):
    mission = paper(task, num_robots=12, num_windows=60)
    costs = summarise(list(rollout(Swarm(mission, range(3)), make_policy(name, mission))))
    return np.mean(costs.aoi_mean)


@pytest.mark.parametrize("task", ["stationary", "random-walk"])
def test_the_oracle_beats_every_policy_but_planners_on_average(task):
    """Those that plan look ahead, and choose freely in both halves of a window; it does not."""
    plan = {"lookahead-oracle", "planner", "planner --payload none"}
    others = set(POLICIES) - plan - {"greedy-oracle"}
    assert aoi("greedy-oracle", task) < min(aoi(name, task) for name in others)


def test_the_oracle_addresses_nobody_behind_a_wall_of_the_true_channel():
    """Two robots, 100 m apart, with 40 dB between them."""
    wall = Obstacles(
        kind=np.array([BOX]),
        centre_m=np.array([[50.0, 0.0, 0.0]]),
        rotation=np.eye(3)[None],
        size_m=np.array([[1.0, 1e4, 1e4]]),
        reach_m=np.array([2e4]),
        power_left=np.array([1e-4]),
    )
    mission = paper("stationary", num_robots=2)
    channel, policy = mission_radio(mission, wall).channel, make_policy("greedy-oracle", mission)
    channel.start(2, [np.random.default_rng(0)])
    position_m, timestamp = np.array([[0.0, 0.0], [100.0, 0.0]]), np.diag([9.0, 9.0])
    team = Team(radio=radio_of(mission), position_m=position_m, timestamp=timestamp, now=9.0)
    assert decided(policy, team) in ([1, 1], [0, 0])
    policy.inform(TrueLinks(radio=radio_of(mission), channel=channel))
    assert decided(policy, team) == [0, 1]


def test_the_oracle_wastes_no_packet_on_a_robot_that_has_failed():
    """Robot 2 is the oldest to both others, but off; robots 0 and 1 exchange."""
    buffers = empty_buffers(1, 3)
    buffers.timestamp[0] = [[9.0, 8.0, 0.0], [8.0, 9.0, 0.0], [0.0, 0.0, 5.0]]
    views = LocalViews(buffers=buffers, now=np.array([9.0]), phases=())
    position_m = np.array([[[0.0, 0.0], [100.0, 0.0], [50.0, 50.0]]])
    is_active = np.array([[True, True, False]])
    states = RobotStates(
        position_m=position_m, velocity_mps=np.zeros_like(position_m), is_active=is_active
    )
    policy = make_policy("greedy-oracle", paper("stationary", num_robots=3))
    (recipient,) = policy.recipients(views, states).tolist()
    assert recipient in ([1, 1, 2], [0, 0, 2])


def in_halves(team):
    """T and t in the scheduler's unit."""
    return (2 * team.timestamp).astype(np.float32), 2.0 * team.now


def gains_beside(recipient, timestamp, now, links):
    """What the window gains when i also sends, to r."""
    sent = timestamp.copy()
    np.fill_diagonal(sent, now + 1.0)
    return window_gains(sent, packet_gains(sent, links), now, links, np.array(recipient))


def first_pairs(timestamp, now, links):
    """What a window gains when i alone sends, to r."""
    return gains_beside(range(len(timestamp)), timestamp, now, links)


def best_pair(team, recipient):
    """The first of the free pairs whose addition leaves most known after Alg. 1, and how much."""
    taken = {i for i, r in enumerate(recipient) if r != i}
    taken |= {recipient[i] for i in taken}
    free = [i for i in range(team.num_robots) if i not in taken]
    pairs = [(i, r) for i in free for r in free if r != i]
    if not pairs:
        return 0, 0, -math.inf
    known = knowledge_after(
        team, np.array([[*recipient[:i], r, *recipient[i + 1 :]] for i, r in pairs])
    )
    best = int(np.argmax(known))
    return *pairs[best], known[best]


def plain_greedy_window(team):
    """Pairs are added while the whole window gains by it; the radio and Alg. 1 are the judges."""
    recipient = list(range(team.num_robots))
    (known,) = knowledge_after(team, np.array([recipient]))
    while True:
        i, r, with_pair = best_pair(team, recipient)
        if with_pair <= known:
            return recipient
        recipient[i], known = r, with_pair


@pytest.mark.parametrize("preset", [paper, reference])
@given(seed=seeds, num_robots=st.integers(2, 8))
@settings(max_examples=50)
def test_alg1_pairs_are_added_while_the_real_window_gains(preset, seed, num_robots):
    """No robot is counted on twice: neither senders nor addressees are in another pair."""
    team = flooded_team(preset("stationary", num_robots=num_robots), seed)
    timestamp, now = in_halves(team)
    recipient = greedy_window(timestamp, now, links_between(team.radio, team.position_m)).tolist()
    assert recipient == plain_greedy_window(team)
    np.testing.assert_array_equal(timestamp, in_halves(team)[0])
    involved = [k for i, r in enumerate(recipient) if i != r for k in (i, r)]
    assert len(involved) == len(set(involved))


@pytest.mark.parametrize("preset", [paper, reference])
@given(seed=seeds, num_robots=st.integers(2, 12))
def test_eq10_the_gain_of_a_first_pair_is_the_fall_of_age(preset, seed, num_robots):
    """N² times it, in halves; of all r that do not decode i, the first stands for all."""
    team = flooded_team(preset("stationary", num_robots=num_robots), seed)
    gain = first_pairs(*in_halves(team), links_between(team.radio, team.position_m))
    known = knowledge_after(team, single_pairs(num_robots)).reshape(num_robots, num_robots)
    fall = 2 * (known - np.diag(known))  # addressing oneself is silence
    for i in range(num_robots):
        alone = np.arange(num_robots)
        alone[i] = (i + 1) % num_robots
        heard = team.radio(team.position_m[None], alone[None])[0]
        deaf = [r for r in range(num_robots) if r != i and heard[r] != i]
        absent = [i, *deaf[1:]]
        assert gain[i, absent].tolist() == [-math.inf] * len(absent)
        present = np.setdiff1d(np.arange(num_robots), absent)
        assert gain[i, present].tolist() == fall[i, present].tolist()
        assert fall[i, deaf].tolist() == fall[i, deaf[:1]].tolist() * len(deaf)


def test_expected_times_are_mixed_by_chance_by_hand():
    """Two robots at the range, t = 5 windows or 10 slots; robot 1 knows 0 of 4 slots.

    Robot 0 would gain 7/2 + 12/4 by speaking: robot 1 decodes 11 instead of 4 with chance 1/2, and
    its answer, sent with chance 1/2, brings 12 instead of 0 with chance 1/2. Robot 1 would gain
    11/2 + (12 - 4)/4 = 7.5, so it speaks.
    """
    power_mw, row = np.array([[0.0, 1.0], [1.0, 0.0]]), np.zeros((2, 2), dtype=np.int64)
    links = Links(power_mw, np.ones((2, 2)), 1.0, 1.0, KNOWN, row, power_mw)
    timestamp = np.array([[10, 0], [4, 10]], dtype=np.float32)
    gain = first_pairs(timestamp, 10.0, links)
    np.testing.assert_array_equal(gain, [[-math.inf, 6.5], [7.5, -math.inf]])
    assert greedy_window(timestamp, 10.0, links).tolist() == [0, 0]


def heard_with_chance(links, senders):
    """For each robot whom it decodes, and how probably; itself is nobody."""
    heard = [received(links, senders, j) for j in range(len(links.received_mw))]
    return [(i, p) if p > 0.0 else (j, 0.0) for j, (i, p) in enumerate(heard)]


def expected_window(known, now, links, recipient):
    """T as expected after a window: each entry rises by its chance times its rise, twice."""
    robots = range(len(known))
    senders = {i for i in robots if recipient[i] != i}
    heard = heard_with_chance(links, senders)
    answers = {j for j, (i, _) in enumerate(heard) if i != j and recipient[i] == j}
    answered = heard_with_chance(links, answers)
    answered = [(i, p * heard[i][1]) for i, p in answered]
    for phase, decoded in ((1, heard), (2, answered)):
        sent = [[now + phase if i == k else known[i][k] for k in robots] for i in robots]
        known = [
            [sent[j][k] + p * max(sent[i][k] - sent[j][k], 0.0) for k in robots]
            for j, (i, p) in enumerate(decoded)
        ]
    return [[now + 2 if i == k else known[i][k] for k in robots] for i in robots]


@given(seed=seeds, num_robots=st.integers(2, 10), spread_m=st.sampled_from([3.0, 40.0, 150.0]))
def test_gains_in_doubtful_teams_as_plain_loops_have_them(seed, num_robots, spread_m):
    team = flooded_team(paper("stationary", num_robots=num_robots), seed)
    spread = np.random.default_rng(seed).uniform(0.0, spread_m, num_robots)
    links = links_between(team.radio, team.position_m, spread)
    timestamp, now = in_halves(team)
    known = timestamp.tolist()
    silence = list(range(num_robots))
    silent = np.sum(expected_window(known, now, links, silence))
    gain = first_pairs(timestamp, now, links)
    best = np.argmax(gain)
    beside = np.array(silence)
    beside[best // num_robots] = best % num_robots
    for others in (silence, beside.tolist()):
        gain = gains_beside(others, timestamp, now, links)
        for i, r in zip(*np.nonzero(gain > -math.inf), strict=True):
            recipient = [*others[:i], int(r), *others[i + 1 :]]
            after = np.sum(expected_window(known, now, links, recipient))
            assert gain[i, r] == pytest.approx(after - silent, rel=1e-4, abs=1e-3)


@given(seed=seeds, num_robots=st.integers(3, 12))
@settings(max_examples=25)
def test_an_unknown_robot_never_speaks_nor_changes_what_others_do(seed, num_robots):
    """Wherever it is and whatever it knows. It may lend its name to an unanswered broadcast."""
    team = flooded_team(paper("stationary", num_robots=num_robots), seed)
    rng = np.random.default_rng(seed)
    unknown = np.flatnonzero(rng.random(num_robots) < 0.4)
    otherwise = team.timestamp.copy()
    otherwise[unknown] = rng.integers(0, 2 * int(team.now) + 1, (len(unknown), num_robots)) / 2
    is_known = ~np.isin(np.arange(num_robots), unknown)
    links = links_between(team.radio, team.position_m, is_known=is_known)
    recipients = [
        greedy_window((2 * timestamp).astype(np.float32), 2 * team.now, links)
        for timestamp in (team.timestamp, otherwise)
    ]
    assert np.all(recipients[0][unknown] == unknown)
    np.testing.assert_array_equal(*recipients)


def test_a_team_with_nothing_to_gain_is_silent():
    """Two robots out of each other's range."""
    position_m = np.array([[0.0, 0.0], [2000.0, 0.0]])
    radio = radio_of(paper("stationary"))
    team = Team(radio=radio, position_m=position_m, timestamp=np.eye(2), now=0.0)
    links = links_between(radio, position_m)
    assert greedy_window(*in_halves(team), links).tolist() == [0, 1]
