"""Plans of one snapshot and nothing else, and the weights of news, held against networkx."""

import copy
import math
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from decentralised_reference import planned as planned_at_once
from hypothesis import given, settings
from hypothesis import strategies as st
from standing_teams import flooded_team, view_of

from swarm_mj.mission import paper
from swarm_mj.policies.planner.plan import (
    Plan,
    epoch_plan,
    expected_hops,
    num_downstream,
    problem_of,
)
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import take_snapshots
from swarm_mj.radio.links import decode_curves, doubtful, links_between, lone_probabilities
from swarm_mj.radio.mission_radio import Belief, radio_of

seeds = st.integers(0, 2**32 - 1)
few = settings(max_examples=20)
NOW = 20.0
AGED = PlannerSettings(fresh_rounds=0.0, min_fresh_windows=8.0)
SETTINGS = PlannerSettings()


def snapshots_of(team, seed):
    """Beliefs of robots that heard of most others, some of them long ago."""
    rng, shape = np.random.default_rng(seed), (team.num_robots, team.num_robots)
    timestamp = NOW - rng.integers(0, 2 * int(NOW), shape) / 2
    timestamp *= rng.random(shape) < 0.8
    np.fill_diagonal(timestamp, NOW)
    position_m = team.position_m + rng.normal(0.0, 20.0, (*shape, 2))
    view = view_of(timestamp, position_m, rng.uniform(-3.0, 3.0, (*shape, 2)), now=NOW)
    return take_snapshots(view, AGED, window_s=0.1, windows_ahead=15.0)


def true_snapshots(team):
    """Everyone is known, fresh, at rest, and where it is believed to be."""
    view = view_of(np.ones_like(team.timestamp), team.position_m, now=9.0)
    return take_snapshots(view, SETTINGS, window_s=0.1, windows_ahead=15.0)


def team_of(num_robots, seed):
    return flooded_team(paper("stationary", num_robots=num_robots), seed)


def plan_of(team, snapshots, owner=0, is_free=None):
    return epoch_plan(
        snapshots,
        owner,
        Belief(radio=team.radio),
        SETTINGS,
        timestamp=team.timestamp,
        now=team.now,
        is_free=np.ones(24, dtype=bool) if is_free is None else is_free,
    )


def all_transmitters(planned, num_slots=24):
    return np.array([planned.transmits(h) for h in range(num_slots)])


@few
@given(seed=seeds, num_robots=st.integers(2, 8))
def test_a_plan_depends_on_one_snapshot_and_nothing_else(seed, num_robots):
    """Not on others' snapshots, nor on who made it, nor on where somebody unknown is written."""
    team, owner, maker = team_of(num_robots, seed), seed % num_robots, seed // 8 % num_robots
    mine, mixed = snapshots_of(team, seed), copy.deepcopy(snapshots_of(team, seed + 1))
    for name in ("is_known", "is_fresh", "position_m", "position_std_m", "timestamp"):
        getattr(mixed, name)[maker] = getattr(mine, name)[owner]
    mixed.position_m[maker, ~mixed.is_known[maker]] += 100.0
    mixed.position_std_m[maker, ~mixed.is_known[maker]] += 7.0
    planned, again = plan_of(team, mine, owner), plan_of(team, mixed, maker)
    np.testing.assert_array_equal(all_transmitters(planned), all_transmitters(again))
    np.testing.assert_array_equal(planned.outcome(), again.outcome())


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_what_was_expected_of_the_lost_is_corrected(seed, num_robots):
    """Of who is not fresh nothing newer is known to anybody than the snapshot has of it, and to it
    nothing newer; what is expected of the others stays."""
    team, owner = team_of(num_robots, seed), seed % num_robots
    snapshots = snapshots_of(team, seed)
    expected = np.random.default_rng(seed).integers(0, 40, (num_robots, num_robots)) / 2
    told = replace(team, timestamp=expected, now=NOW)
    outcome = plan_of(told, snapshots, owner, np.ones(0, dtype=bool)).outcome()
    heard, is_fresh = snapshots.timestamp[owner], snapshots.is_fresh[owner]
    for i in range(num_robots):
        for k in range(num_robots):
            bounds = [heard[robot] for robot in {i, k} if not is_fresh[robot]]
            assert outcome[i, k] == min([expected[i, k], *bounds])


@pytest.mark.parametrize(
    ("num_robots", "is_certain", "lookahead"),
    [(5, True, (6, 5)), (5, False, (4, 3)), (6, True, (1, 1)), (6, False, (1, 1))],
)
def test_large_teams_look_less_far_ahead(num_robots, is_certain, lookahead):
    """Whose plans would take long otherwise."""
    numbers = PlannerSettings(
        rest_lookahead=(6, 5), moving_lookahead=(4, 3), max_lookahead_robots=5
    )
    links = links_between(RADIO, np.zeros((num_robots, 2)))
    problem = problem_of(links, numbers, is_certain=is_certain)
    assert (problem.width, problem.depth) == lookahead


def test_who_was_not_heard_of_for_three_rounds_is_planned_without():
    """A plan of a snapshot in which a robot was silent for so long has no links to it."""
    team = team_of(6, 1)
    snapshots = true_snapshots(team)
    now = SETTINGS.gone_rounds * SETTINGS.min_round_windows + 2.0
    snapshots.timestamp[:] = now - 1.0
    team = replace(team, now=now)
    whole = plan_of(team, snapshots)
    assert all_transmitters(whole)[:, 2].any()
    snapshots.timestamp[0, 2], snapshots.is_fresh[0, 2] = 1.0, False
    without = plan_of(team, snapshots)
    assert not all_transmitters(without)[:, 2].any()


@pytest.mark.parametrize("is_doubtful", [False, True])
def test_a_plan_made_as_it_is_asked_for_is_the_plan_made_at_once(is_doubtful):
    """Slots may be asked for in any order."""
    team = team_of(8, 2)
    links = links_between(team.radio, team.position_m)
    if is_doubtful:
        links = doubtful(links, decode_curves(), np.full((8, 8), 2.0))
    endless = Plan(links, SETTINGS)
    last = endless.transmits(29).copy()
    made = all_transmitters(endless, 30)
    np.testing.assert_array_equal(made, planned_at_once(links, SETTINGS, 30))
    np.testing.assert_array_equal(made[29], last)
    assert np.all(np.any(made, axis=0))  # everyone has its say


def test_a_plan_may_take_other_links_every_40_slots():
    team, asked = team_of(8, 2), []
    near, apart = (links_between(team.radio, scale * team.position_m) for scale in (1.0, 100.0))

    def links_from(slot):
        asked.append(slot)
        return apart if slot == 40 else near

    made = all_transmitters(Plan(apart, SETTINGS, links_from=links_from), 100)
    np.testing.assert_array_equal(made[:40], all_transmitters(Plan(near, SETTINGS), 40))
    assert asked == [0, 40, 80]
    assert not made[40:80].any()
    assert np.all(np.any(made[80:], axis=0))


# What the arithmetic here is about, whatever suits the planner best.
WEIGHING = PlannerSettings(
    downstream_exponent=0.6,
    hops_exponent=-0.3,
    share_unlinked=0.95,
    share_per_link=-0.3,
    share_per_std=3.0,
    share_isolated=0.1,
    max_share=1.05,
    min_probability=0.05,
    slack_hops=0.25,
)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence
FAR_M = 5000.0


def drawn_links(num_robots, seed, is_certain):
    """Of a connected team, with some robots carried far away, each by itself.

    Positions are true, or believed within 5 to 60 m.
    """
    rng, mission = np.random.default_rng(seed), paper("stationary", range_ratio=0.2)
    team = flooded_team(replace(mission, num_robots=num_robots), seed)
    position_m = team.position_m.copy()
    for n, i in enumerate(np.flatnonzero(rng.random(num_robots) < 0.15)):
        position_m[i] += FAR_M * (n + 1)
    spread_m = None if is_certain else rng.uniform(5.0, 60.0, num_robots)
    return links_between(team.radio, position_m, spread_m)


def graph_of(links):
    """Expected transmissions, how many robots lie behind each, and the graph as networkx has it:
    links that count, each as long as packets must be sent until one decodes."""
    probability = lone_probabilities(links)
    probability[probability < WEIGHING.min_probability] = 0.0
    hops = expected_hops(probability)
    lengths = np.divide(1.0, probability, out=np.zeros_like(probability), where=probability > 0.0)
    return hops, num_downstream(hops, WEIGHING.slack_hops), nx.from_numpy_array(lengths)


def weighed(links, settings=WEIGHING):
    return problem_of(links, settings, is_certain=True)


def test_a_row_of_three_by_hand():
    """Robot 0's news reach robot 2 through robot 1, two hops on; two of three pairs are linked."""
    row_m = np.array([[0.0, 0.0], [200.0, 0.0], [400.0, 0.0]])
    problem = weighed(links_between(RADIO, row_m))
    assert problem.weight[1, 0] == pytest.approx(2.0**0.6)
    assert problem.weight[2, 0] == pytest.approx(2.0**-0.3)
    assert problem.weight[0, 1] == pytest.approx(1.0)
    assert problem.min_share == pytest.approx(0.95 - 0.3 * 2 / 3)


@given(seed=seeds, num_robots=st.integers(2, 6), is_certain=st.booleans())
def test_hops_and_who_is_on_nearly_shortest_ways_are_those_of_networkx(
    seed, num_robots, is_certain
):
    """All ways without a turning back that are less than the slack longer, one by one."""
    hops, downstream, graph = graph_of(drawn_links(num_robots, seed, is_certain))
    expected, shortest = np.eye(num_robots), np.full((num_robots, num_robots), math.inf)
    for k in range(num_robots):
        reached = nx.node_connected_component(graph, k)
        expected[k, k], shortest[k, k] = len(reached), 0.0
        for j in reached - {k}:
            ways = list(nx.all_simple_paths(graph, k, j))
            lengths = [nx.path_weight(graph, way, "weight") for way in ways]
            shortest[k, j] = min(lengths)
            most = min(lengths) + WEIGHING.slack_hops
            near = [way for way, n in zip(ways, lengths, strict=True) if n < most]
            for i in {i for way in near for i in way} - {k}:
                expected[i, k] += 1.0
    np.testing.assert_allclose(hops, shortest)
    assert downstream.tolist() == expected.tolist()


def test_links_that_decode_rarely_are_no_way():
    """A chance of 0.05 needs 1.73 deviations beyond the range: 285 m are 1.75, 284 m are 1.7."""
    for distance_m, is_link in ((285.0, False), (284.0, True)):
        position_m = np.array([[0.0, 0.0], [distance_m, 0.0]])
        links = links_between(RADIO, position_m, np.array([20.0, 0.0]))
        assert lone_probabilities(links)[0, 1] > 0.0
        assert (graph_of(links)[0][0, 1] < math.inf) == is_link


def test_the_share_of_a_team_by_hand():
    """A triangle, and a robot too far away: three of six pairs are linked, of three without it.

    Robots are believed within 3 and 4 m or so, and 50 m apart: a tenth of it, as a mean. The share
    per deviation is small here, so that the sum is below its maximum.
    """
    position_m = np.array([[0.0, 0.0], [30.0, 40.0], [50.0, 0.0], [FAR_M, 0.0]])
    links = links_between(RADIO, position_m, np.array([3.0, 4.0, 4.0, 4.0]))
    apart = math.dist([30.0, 40.0], [50.0, 0.0])
    relative_std = (0.1 + 0.1 + math.sqrt(32.0) / apart) / 3
    share = 0.95 - 0.3 * 1.0 + 1.5 * relative_std + 0.1
    small = replace(WEIGHING, share_per_std=1.5)
    assert weighed(links, small).min_share == pytest.approx(share)
    # However doubtful the links are, the share stays below its maximum.
    assert weighed(links, replace(small, max_share=share - 0.1)).min_share == share - 0.1
    assert weighed(links, replace(small, share_per_std=50.0)).min_share == WEIGHING.max_share


@pytest.mark.parametrize("num_robots", [1, 3])
def test_teams_without_links_have_finite_weights(num_robots):
    position_m = FAR_M * np.arange(2.0 * num_robots).reshape(num_robots, 2)
    links = links_between(RADIO, position_m, np.full(num_robots, 5.0))
    assert graph_of(links)[1].tolist() == np.eye(num_robots).tolist()
    problem = weighed(links)
    assert np.all(np.isfinite(problem.weight))
    assert problem.min_share == 1.05
