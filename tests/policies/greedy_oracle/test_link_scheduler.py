import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from standing_teams import after_windows, flooded_team, knowledge_after, single_pairs

from swarm_mj.mission import paper, reference
from swarm_mj.policies.greedy_oracle.link_scheduler import (
    NO_PAIR,
    NOT_A_PAIR,
    first_pairs,
    schedule,
)
from swarm_mj.radio.decode_curves import KNOWN
from swarm_mj.radio.links import Links, links_between

seeds = st.integers(0, 2**32 - 1)


def in_halves(team):
    """T and t in the scheduler's unit."""
    return (2 * team.timestamp).astype(np.float32), 2.0 * team.now


def rises(sent, heard, power):
    """The sum over receivers j and subjects k of how much T^{j,k} rises, to a power."""
    return sum(
        max(sent[i][k] - sent[j][k], 0.0) ** power
        for j, i in enumerate(heard)
        if i != j
        for k in range(len(sent))
    )


def window_gain(team, recipient, power):
    """What one window gains by Alg. 1, phase by phase, in halves to the power.

    Rises of the transmission phase count from what everyone knows at t + 1/2, its own time
    included; those of the responses from what it knows at t + 1. An entry that rises by a and then
    by b counts a² + b² when squared.
    """
    num_robots = team.num_robots
    sent = [[2 * t for t in row] for row in team.timestamp.tolist()]
    total = 0.0
    for phase in (1, 2):
        for i in range(num_robots):
            sent[i][i] = 2 * team.now + phase
        heard = team.radio(team.position_m[None], np.array([recipient]))[0].tolist()
        total += rises(sent, heard, power)
        sent = [
            [max(pair) for pair in zip(sent[j], sent[i], strict=True)] for j, i in enumerate(heard)
        ]
        recipient = [i if i != j and recipient[i] == j else j for j, i in enumerate(heard)]
    return total


def best_pair(team, recipient, power):
    """The first of the free pairs whose addition gains most, and the gain."""
    taken = {i for i, r in enumerate(recipient) if r != i}
    taken |= {recipient[i] for i in taken}
    free = [i for i in range(team.num_robots) if i not in taken]
    best = (-1, -1, -1.0)
    for i in free:
        for r in free:
            if r != i:
                gain = window_gain(team, [*recipient[:i], r, *recipient[i + 1 :]], power)
                best = (i, r, gain) if gain > best[2] else best
    return best


def plain_greedy_window(team, power):
    """Pairs are added while the whole window gains by it; the radio and Alg. 1 are the judges."""
    recipient, gained = list(range(team.num_robots)), 0.0
    while True:
        i, r, gain = best_pair(team, recipient, power)
        if gain <= gained:
            return recipient
        recipient[i], gained = r, gain


@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize("power", [1, 2])
@given(seed=seeds, num_robots=st.integers(2, 8))
@settings(max_examples=30)
def test_pairs_are_added_while_the_real_window_gains(preset, power, seed, num_robots):
    team = flooded_team(preset("stationary", num_robots=num_robots), seed)
    timestamp, now = in_halves(team)
    recipient = np.empty((1, num_robots), dtype=np.int64)
    links = links_between(team.radio, team.position_m)
    schedule(timestamp, now, links, power == 2, NO_PAIR, 0.0, recipient)
    assert recipient[0].tolist() == plain_greedy_window(team, power)


@pytest.mark.parametrize("preset", [paper, reference])
@given(seed=seeds, num_robots=st.integers(2, 12))
def test_eq10_the_gain_of_a_first_pair_is_the_fall_of_age(preset, seed, num_robots):
    """N² times it, in halves; of all r that do not decode i, the first stands for all."""
    team = flooded_team(preset("stationary", num_robots=num_robots), seed)
    gain = first_pairs(*in_halves(team), links_between(team.radio, team.position_m), False)
    known = knowledge_after(team, single_pairs(num_robots)).reshape(num_robots, num_robots)
    fall = 2 * (known - np.diag(known))  # addressing oneself is silence
    for i in range(num_robots):
        alone = np.arange(num_robots)
        alone[i] = (i + 1) % num_robots
        heard = team.radio(team.position_m[None], alone[None])[0]
        deaf = [r for r in range(num_robots) if r != i and heard[r] != i]
        absent = [i, *deaf[1:]]
        assert gain[i, absent].tolist() == [NOT_A_PAIR] * len(absent)
        present = np.setdiff1d(np.arange(num_robots), absent)
        assert gain[i, present].tolist() == fall[i, present].tolist()
        assert fall[i, deaf].tolist() == fall[i, deaf[:1]].tolist() * len(deaf)


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_squared_gains_of_first_pairs_count_phase_by_phase(seed, num_robots):
    team = flooded_team(paper("stationary", num_robots=num_robots), seed)
    gain = first_pairs(*in_halves(team), links_between(team.radio, team.position_m), True)
    for pair, recipient in enumerate(single_pairs(num_robots).tolist()):
        i, r = divmod(pair, num_robots)
        if gain[i, r] != NOT_A_PAIR:
            assert gain[i, r] == window_gain(team, recipient, 2)


@given(seed=seeds, num_windows=st.integers(1, 5))
def test_a_schedule_is_worth_the_sum_of_all_times_after_each_window(seed, num_windows):
    """Also with a first pair, which speaks whatever else happens."""
    team = flooded_team(paper("stationary", num_robots=7), seed)
    links = links_between(team.radio, team.position_m)
    gain = first_pairs(*in_halves(team), links, True)
    for pair in np.flatnonzero(gain > 0.0)[:4].tolist():
        i, r = divmod(pair, 7)
        timestamp, now = in_halves(team)
        recipient = np.empty((num_windows, 7), dtype=np.int64)
        worth = schedule(timestamp, now, links, True, (i, r), float(gain[i, r]), recipient)
        real = after_windows(team, recipient)
        assert recipient[0, i] == r
        assert worth == 2 * np.sum(real)
        np.testing.assert_array_equal(timestamp, 2 * real[-1])


def test_expected_times_are_mixed_by_chance_by_hand():
    """Two robots at the range, t = 5 windows or 10 slots; robot 1 knows 0 of 4 slots.

    Robot 0 would gain 7/2 + 12/4 by speaking: robot 1 decodes 11 instead of 4 with chance 1/2, and
    its answer, sent with chance 1/2, brings 12 instead of 0 with chance 1/2. Robot 1 would gain
    11/2 + (12 - 4)/4 = 7.5, so it speaks.
    """
    power_mw, row = np.array([[0.0, 1.0], [1.0, 0.0]]), np.zeros((2, 2), dtype=np.int64)
    links = Links(power_mw, np.ones((2, 2)), 1.0, 1.0, KNOWN, row, power_mw)
    timestamp = np.array([[10, 0], [4, 10]], dtype=np.float32)
    np.testing.assert_array_equal(
        first_pairs(timestamp, 10.0, links, False), [[-1.0, 6.5], [7.5, -1.0]]
    )
    recipient = np.empty((1, 2), dtype=np.int64)
    worth = schedule(timestamp, 10.0, links, False, NO_PAIR, 0.0, recipient)
    assert recipient.tolist() == [[0, 0]]
    assert timestamp.tolist() == [[12.0, 5.5], [6.0, 12.0]]
    assert worth == 35.5


def heard_with_chance(links, senders, listeners):
    """For each robot whom it decodes, and how probably: plain loops over Eqs. 1-4."""
    heard = []
    for j in range(len(links.received_mw)):
        powers = {i: links.received_mw[i, j] for i in senders if links.received_mw[i, j] > 0.0}
        if j not in listeners or not powers:
            heard.append((j, 0.0))
            continue
        i = max(powers, key=lambda sender: powers[sender])
        ratio = powers[i] / (links.noise_mw + sum(powers.values()) - powers[i]) / links.threshold
        z = (math.sqrt(ratio) - 1.0) * links.distance_over_std[i, j]
        p = 1.0 / (1.0 + math.exp(-1.702 * z)) if abs(z) <= 2.5 else float(z > 0.0)
        heard.append((i, p) if p > 0.0 else (j, 0.0))
    return heard


def expected_window(known, now, links, recipient):
    """T as expected after a window: each entry rises by its chance times its rise, twice."""
    robots = range(len(known))
    senders = {i for i in robots if recipient[i] != i}
    heard = heard_with_chance(links, senders, set(robots) - senders)
    answers = {j for j, (i, _) in enumerate(heard) if i != j and recipient[i] == j}
    answered = heard_with_chance(links, answers, set(robots) - answers)
    answered = [(i, p * heard[i][1]) for i, p in answered]
    for phase, decoded in ((1, heard), (2, answered)):
        sent = [[now + phase if i == k else known[i][k] for k in robots] for i in robots]
        known = [
            [sent[j][k] + p * max(sent[i][k] - sent[j][k], 0.0) for k in robots]
            for j, (i, p) in enumerate(decoded)
        ]
    return [[now + 2 if i == k else known[i][k] for k in robots] for i in robots]


@given(seed=seeds, num_robots=st.integers(2, 10), spread_m=st.sampled_from([3.0, 40.0, 150.0]))
def test_expected_times_of_doubtful_teams_as_plain_loops_have_them(seed, num_robots, spread_m):
    team = flooded_team(paper("stationary", num_robots=num_robots), seed)
    spread = np.random.default_rng(seed).uniform(0.0, spread_m, num_robots)
    links = links_between(team.radio, team.position_m, spread)
    timestamp, now = in_halves(team)
    expected = timestamp.tolist()
    gain = first_pairs(timestamp, now, links, False)
    silent = np.sum(expected_window(expected, now, links, list(range(num_robots))))
    for pair, alone in enumerate(single_pairs(num_robots).tolist()):
        if gain.flat[pair] != NOT_A_PAIR:
            known = np.sum(expected_window(expected, now, links, alone))
            assert gain.flat[pair] == pytest.approx(known - silent, rel=1e-4, abs=1e-3)
    recipient = np.empty((3, num_robots), dtype=np.int64)
    schedule(timestamp, now, links, True, NO_PAIR, 0.0, recipient)
    for w, row in enumerate(recipient.tolist()):
        expected = expected_window(expected, now + 2 * w, links, row)
    np.testing.assert_allclose(timestamp, expected, rtol=1e-4, atol=1e-3)
