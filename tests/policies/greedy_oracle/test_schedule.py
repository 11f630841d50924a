import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm
from standing_teams import Team, after_windows, flooded_team

from swarm_mj.mission import paper, reference
from swarm_mj.policies.greedy_oracle.link_scheduler import first_pairs, schedule
from swarm_mj.policies.greedy_oracle.schedule import greedy_schedule, lookahead_window
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of

seeds = st.integers(0, 2**32 - 1)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence


def pair_apart(distance_m):
    """Two robots, of which one has only its own time to tell."""
    position_m = np.array([[0.0, 0.0], [distance_m, 0.0]])
    return Team(radio=RADIO, position_m=position_m, timestamp=np.zeros((2, 2)), now=0.0)


def told(distance_m, spread_m):
    """How much of robot 0's news robot 1 is expected to have, of 1, if robot 0 cannot hear."""
    links = links_between(RADIO, pair_apart(distance_m).position_m, np.array(spread_m))
    links.received_mw[1, 0] = 0.0
    recipient, after = greedy_schedule(np.zeros((2, 2)), 0.0, links, 1, is_squared=False)
    assert recipient.tolist() in ([[1, 1]], [[0, 1]])
    return 2.0 * after[1, 0]


@pytest.mark.parametrize("preset", [paper, reference])
@given(
    seed=seeds,
    num_robots=st.integers(2, 12),
    num_windows=st.integers(1, 6),
    is_squared=st.booleans(),
)
def test_alg1_expected_times_are_the_real_ones(preset, seed, num_robots, num_windows, is_squared):
    """Where positions are true and the team stands: the protocol plays the schedule to the same T.

    Nobody is counted on twice in a window: neither senders nor those addressed send or are
    addressed by another.
    """
    team = flooded_team(preset("stationary", num_robots=num_robots), seed)
    links = links_between(team.radio, team.position_m)
    before = team.timestamp.copy()
    recipient, after = greedy_schedule(
        team.timestamp, team.now, links, num_windows, is_squared=is_squared
    )
    assert recipient.shape == (num_windows, num_robots)
    np.testing.assert_array_equal(after, after_windows(team, recipient)[-1])
    np.testing.assert_array_equal(team.timestamp, before)
    for row in recipient.tolist():
        involved = [k for i, r in enumerate(row) if i != r for k in (i, r)]
        assert len(involved) == len(set(involved))


@given(seed=seeds, num_windows=st.integers(2, 5), is_squared=st.booleans())
def test_windows_in_a_row_are_scheduled_one_after_the_other(seed, num_windows, is_squared):
    team = flooded_team(paper("stationary", num_robots=9), seed)
    links = links_between(team.radio, team.position_m)
    together, last = greedy_schedule(
        team.timestamp, team.now, links, num_windows, is_squared=is_squared
    )
    known = team.timestamp
    for w in range(num_windows):
        alone, known = greedy_schedule(known, team.now + w, links, 1, is_squared=is_squared)
        np.testing.assert_array_equal(together[w], alone[0])
    np.testing.assert_array_equal(last, known)


@pytest.mark.parametrize("spread_m", [[3.0, 4.0], [30.0, 40.0], [0.0, 60.0]])
def test_chance_is_that_of_being_in_range(spread_m):
    """By the normal distribution of the distance, with a step where doubt is beyond 2.5 of it."""
    deviation_m = math.hypot(*spread_m)
    for distance_m in np.linspace(250.0 - 2.4 * deviation_m, 250.0 + 2.4 * deviation_m, 41):
        likely = norm.cdf((250.0 - distance_m) / deviation_m)
        assert told(distance_m, spread_m) == pytest.approx(likely, abs=0.0096)
    assert told(250.0, spread_m) == pytest.approx(0.5, abs=1e-3)
    assert told(250.0 - 2.6 * deviation_m, spread_m) == 1.0
    assert told(250.0 + 2.6 * deviation_m, spread_m) == 0.0


@given(seed=seeds, num_robots=st.integers(3, 12), is_squared=st.booleans())
@settings(max_examples=25)
def test_who_is_unknown_never_speaks_nor_tells_nor_learns(seed, num_robots, is_squared):
    """Wherever it is and whatever it knows: times are those of a team that it is far away from.

    It may lend its name to a packet that nobody is to answer.
    """
    team = flooded_team(paper("stationary", num_robots=num_robots), seed)
    rng = np.random.default_rng(seed)
    unknown = np.flatnonzero(rng.random(num_robots) < 0.4)
    far_m, otherwise = team.position_m.copy(), team.timestamp.copy()
    far_m[unknown] = 1e9 * (1.0 + rng.random((len(unknown), 2)))
    otherwise[unknown] = rng.integers(0, 2 * int(team.now) + 1, (len(unknown), num_robots)) / 2
    is_known = ~np.isin(np.arange(num_robots), unknown)
    links = links_between(team.radio, team.position_m, is_known=is_known)
    recipients = []
    for timestamp in (team.timestamp, otherwise):
        recipient, after = greedy_schedule(timestamp, team.now, links, 4, is_squared=is_squared)
        assert np.all(recipient[:, unknown] == unknown)
        far = replace(team, position_m=far_m, timestamp=timestamp)
        np.testing.assert_array_equal(after, after_windows(far, recipient)[-1])
        recipients.append(recipient)
    np.testing.assert_array_equal(*recipients)


def looked_ahead(team, num_branches, num_windows):
    links = links_between(team.radio, team.position_m)
    return lookahead_window(
        team.timestamp, team.now, links, num_branches=num_branches, num_windows=num_windows
    )


def followed_by_greed(team, first, num_windows):
    """The sum of all T after each window when `first` is followed by greedy windows [windows]."""
    (known,) = after_windows(team, [first])
    total, links = known.sum(), links_between(team.radio, team.position_m)
    for w in range(1, num_windows):
        after = replace(team, timestamp=known, now=team.now + w)
        (row,), _ = greedy_schedule(known, after.now, links, 1, is_squared=True)
        (known,) = after_windows(after, [row])
        total += known.sum()
    return total


@pytest.mark.parametrize("preset", [paper, reference])
@given(seed=seeds, num_robots=st.integers(2, 12))
def test_one_branch_of_one_window_is_the_greedy_window(preset, seed, num_robots):
    team = flooded_team(preset("stationary", num_robots=num_robots), seed)
    links = links_between(team.radio, team.position_m)
    greedy, _ = greedy_schedule(team.timestamp, team.now, links, 1, is_squared=True)
    np.testing.assert_array_equal(looked_ahead(team, 1, 1), greedy[0])


@given(seed=seeds, num_windows=st.integers(1, 4))
@settings(max_examples=25)
def test_more_branches_never_know_less_over_their_horizon(seed, num_windows):
    team = flooded_team(paper("stationary", num_robots=10), seed)
    worth = [
        followed_by_greed(team, looked_ahead(team, num_branches, num_windows), num_windows)
        for num_branches in (1, 2, 6, 100)
    ]
    assert worth == sorted(worth)


@given(seed=seeds, num_branches=st.integers(1, 30), num_windows=st.integers(1, 3))
@settings(max_examples=25)
def test_the_best_of_the_first_pairs_wins(seed, num_branches, num_windows):
    """Each is completed to a window and followed by greedy ones; of equal ones the first wins."""
    team = flooded_team(paper("stationary", num_robots=6), seed)
    links = links_between(team.radio, team.position_m)
    slots = (2 * team.timestamp).astype(np.float32)
    gain = first_pairs(slots, 2 * team.now, links, True).ravel().tolist()
    best, most_known = list(range(6)), -math.inf
    for pair in sorted(range(36), key=lambda pair: -gain[pair])[:num_branches]:
        if gain[pair] > 0.0:
            row = np.empty((1, 6), dtype=np.int64)
            schedule(slots.copy(), 2 * team.now, links, True, divmod(pair, 6), gain[pair], row)
            known = followed_by_greed(team, row[0], num_windows)
            best, most_known = (row[0], known) if known > most_known else (best, most_known)
    np.testing.assert_array_equal(looked_ahead(team, num_branches, num_windows), best)


def test_lookahead_of_a_team_with_nothing_to_gain_is_silence():
    """Nobody is in range of anybody."""
    team = replace(pair_apart(2000.0), timestamp=np.eye(2))
    assert looked_ahead(team, 6, 4).tolist() == [0, 1]
