"""Schedules of broadcasts, held against plain loops, and flown over the real radio."""

import math

import numpy as np
import pytest
from decentralised_reference import scheduled
from hypothesis import given, settings
from hypothesis import strategies as st
from standing_teams import flooded_team, received

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.planner.broadcast_scheduler import Problem, schedule_slot
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import broadcast
from swarm_mj.radio.links import KNOWN, Links, links_between, lone_probabilities
from swarm_mj.radio.mission_radio import radio_of

seeds = st.integers(0, 2**32 - 1)
shares = st.sampled_from([0.0, 0.5, 0.8, 0.95, 1.0, 1.05])
sizes = st.integers(3, 6)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence


def sparse_team(num_robots, seed):
    """Of 1 to 4 hops, mostly; a fifth of it spoke for some windows."""
    ratio = 0.15 + 0.05 * (seed % 4)
    return flooded_team(paper("stationary", num_robots=num_robots, range_ratio=ratio), seed)


def whole_weights(num_robots, seed):
    """Whole numbers add up exactly in any order; some are below zero, as learned ones may be."""
    return np.random.default_rng([seed, 1]).integers(-1, 4, (num_robots, num_robots))


def problem(links, weight, share=0.9, width=1, depth=1):
    """By greed, unless it looks ahead."""
    weight = np.broadcast_to(np.asarray(weight, np.float32), links.received_mw.shape).copy()
    lone = lone_probabilities(links)
    return Problem(links=links, lone=lone, weight=weight, min_share=share, width=width, depth=depth)


def solved(team, problem, is_free):
    """Who speaks in each slot, and T after the last [slots]."""
    timestamp = (2 * team.timestamp).astype(np.float32)
    return scheduled(timestamp, 2.0 * team.now, problem, is_free), timestamp


def really(team, speaks):
    """T after each of these slots, by the protocol over the mission's radio [windows]."""
    buffers, after = empty_buffers(1, team.num_robots), []
    buffers.timestamp[0] = team.timestamp
    velocity_mps = np.zeros((1, team.num_robots, 2))
    states = RobotStates(position_m=team.position_m[None], velocity_mps=velocity_mps)
    robots = np.arange(team.num_robots)
    for p, row in enumerate(speaks):
        recipient = np.where(row, (robots + 1) % team.num_robots, robots)[None]
        now = np.array([team.now + p * SLOT_WINDOWS])
        broadcast(buffers, states, recipient, team.radio, now)
        after.append(buffers.timestamp[0].copy())
    return np.array(after)


def worth_of(known, problem, speakers, receivers=None):
    """The worth of a slot: the sum over receivers and subjects of w r²."""
    total, subjects = 0.0, range(len(known))
    for j in subjects if receivers is None else receivers:
        sender, chance = received(problem.links, speakers, j)
        for k in subjects if chance else ():
            r = max(known[sender][k] - known[j][k], 0.0)
            total += chance * r**2 * float(problem.weight[j, k])
    return total


def choices(known, problem, first=(), tolerance=0.0):
    """The speakers by greed; several answers where candidates are as good up to a tolerance."""
    speakers = list(first)
    value = worth_of(known, problem, speakers)
    robots = range(len(known))
    has_news = {i for i in robots if any(worth_of(known, problem, [i], [j]) > 0.0 for j in robots)}
    others = [i for i in robots if i in has_news and i not in speakers]
    values = {i: worth_of(known, problem, [*speakers, i]) for i in others}
    enough = {i: v for i, v in values.items() if v > value * problem.min_share - tolerance}
    best = max(enough.values(), default=-math.inf)
    ends = not enough or best <= value * problem.min_share + tolerance
    answers = [sorted(speakers)] if ends else []
    good = [i for i, v in enough.items() if v >= best - tolerance]
    for i in good if tolerance else good[:1]:
        answers += choices(known, problem, [*speakers, i], tolerance)
    return answers


def as_loops_see(timestamp, now):
    """T in slots when everyone has just observed itself."""
    known = [[2.0 * t for t in row] for row in timestamp.tolist()]
    for i, row in enumerate(known):
        row[i] = now
    return known


@given(seed=seeds, num_robots=sizes, share=shares)
@settings(max_examples=60)
def test_speakers_are_added_while_the_share_remains(seed, num_robots, share):
    """Half window by slot, from what the real radio made of the ones before."""
    team = sparse_team(num_robots, seed)
    links = links_between(team.radio, team.position_m)
    greedy = problem(links, whole_weights(num_robots, seed), share)
    speaks, _ = solved(team, greedy, [True] * 4)
    before = [team.timestamp, *really(team, speaks)[:-1]]
    for p, (row, timestamp) in enumerate(zip(speaks, before, strict=True)):
        now = 2.0 * team.now + p + 1
        (speakers,) = choices(as_loops_see(timestamp, now), greedy)
        assert np.flatnonzero(row).tolist() == speakers


@given(seed=seeds, num_robots=sizes, share=shares)
@settings(max_examples=40)
def test_doubtful_packets_count_by_their_chance(seed, num_robots, share):
    team = sparse_team(num_robots, seed)
    rng = np.random.default_rng(seed)
    links = links_between(team.radio, team.position_m, rng.uniform(0.0, 40.0, num_robots))
    greedy = problem(links, rng.uniform(0.0, 2.0, (num_robots, num_robots)), share)
    speaks, after = solved(team, greedy, [True])
    now = 2.0 * team.now + 1.0
    known = as_loops_see(team.timestamp, now)
    scale = worth_of(known, greedy, [0]) + 1.0
    speakers = np.flatnonzero(speaks[0]).tolist()
    assert speakers in choices(known, greedy, tolerance=1e-4 * scale)
    for j in range(num_robots):
        sender, chance = received(links, speakers, j)
        news = known[j] if sender is None else known[sender]
        expected = [t + chance * max(new - t, 0.0) for t, new in zip(known[j], news, strict=True)]
        assert after[j].tolist() == pytest.approx(expected, rel=1e-5)


@given(seed=seeds, num_robots=st.integers(2, 8), share=shares, branches=st.sampled_from([1, 3]))
@settings(max_examples=40)
def test_eq8_expected_times_are_the_real_ones(seed, num_robots, share, branches):
    """Where positions are true: the radio and the protocol play the schedule to the same T.

    Nobody speaks in slots that are not free.
    """
    team, weight = sparse_team(num_robots, seed), whole_weights(num_robots, seed)
    links = links_between(team.radio, team.position_m)
    is_free = np.random.default_rng(seed).random(9) < 0.7
    speaks, after = solved(team, problem(links, weight, share, branches, 3), is_free)
    assert not np.any(speaks[~is_free])
    np.testing.assert_array_equal(after, 2 * really(team, speaks)[-1])


def best_branch(team, problem, is_free):
    """The speakers of a slot, by trying the best first ones to the end."""
    now = 2.0 * team.now + 1.0
    known = as_loops_see(team.timestamp, now)
    alone = [worth_of(known, problem, [i]) for i in range(team.num_robots)]
    best, most_known = None, -math.inf
    for first in sorted(range(team.num_robots), key=lambda i: -alone[i])[: problem.width]:
        if alone[first] > 0.0:
            rows = [choices(known, problem, [first])[0]]
            for p in range(1, problem.depth):
                before = really(team, [np.isin(range(team.num_robots), row) for row in rows])[-1]
                seen = as_loops_see(before, now + p)
                rows += choices(seen, problem) if is_free[p] else [[]]
            after = really(team, [np.isin(range(team.num_robots), row) for row in rows])
            if after.sum() > most_known:
                best, most_known = rows[0], after.sum()
    return best


@given(seed=seeds, branches=st.integers(2, 5), slots=st.integers(1, 3))
@settings(max_examples=25)
def test_the_branch_that_knows_most_is_taken(seed, branches, slots):
    """Over its slots, those among them in which nobody may speak included."""
    team = sparse_team(5, seed)
    links = links_between(team.radio, team.position_m)
    ahead = problem(links, whole_weights(5, seed), width=branches, depth=slots)
    is_free = np.array([True, *(np.random.default_rng(seed).random(slots - 1) < 0.6)])
    timestamp = (2 * team.timestamp).astype(np.float32)
    speaks = schedule_slot(timestamp, 2.0 * team.now + 1.0, ahead, is_free)
    expected = best_branch(team, ahead, is_free)
    if expected is not None:
        assert np.flatnonzero(speaks).tolist() == expected


@pytest.mark.parametrize("share", [0.5, 1.0])
def test_robots_far_apart_speak_at_once_and_neighbours_do_not(share):
    """Two pairs, 5 km apart, of which both members have their own time to tell."""
    position_m = np.array([[0.0, 0.0], [100.0, 0.0], [5000.0, 0.0], [5100.0, 0.0]])
    greedy, nothing = problem(links_between(RADIO, position_m), 1.0, share), np.zeros((4, 4))
    speaks = schedule_slot(nothing.astype(np.float32), 1.0, greedy, np.array([True]))
    assert speaks.tolist() == [True, False, True, False]


@given(seed=seeds, num_robots=sizes)
def test_who_is_unknown_neither_tells_nor_learns(seed, num_robots):
    """The others may pass on what they know of it; that becomes no newer."""
    team, weight = sparse_team(num_robots, seed), whole_weights(num_robots, seed)
    unknown = seed % num_robots
    others = np.delete(np.arange(num_robots), unknown)
    links = links_between(team.radio, team.position_m, is_known=np.arange(num_robots) != unknown)
    _, after = solved(team, problem(links, weight), [True] * 6)
    before = 2 * team.timestamp
    assert np.max(after[others, unknown]) == np.max(before[others, unknown])
    np.testing.assert_array_equal(after[unknown, others], before[unknown, others])


def test_who_is_alone_in_the_world_says_nothing():
    silence_mw, row = np.zeros((2, 2)), np.zeros((2, 2), dtype=np.int64)
    links = Links(silence_mw, np.full((2, 2), math.inf), 1.0, 1.0, KNOWN, row, silence_mw)
    timestamp, ahead = np.zeros((2, 2), np.float32), problem(links, 1.0, 0.5, width=2, depth=2)
    assert not np.any(scheduled(timestamp, 0.0, ahead, [True] * 3))
    assert timestamp.tolist() == [[3.0, 0.0], [0.0, 3.0]]
