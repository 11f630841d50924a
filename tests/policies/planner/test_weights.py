"""The hand-made weights of news, and the graph of links behind them, held against networkx."""

import math
from dataclasses import replace
from typing import NamedTuple

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from standing_teams import flooded_team

from swarm_mj.mission import paper
from swarm_mj.policies.planner.settings import WeightSettings
from swarm_mj.policies.planner.weights import (
    OUT_OF_REACH,
    expected_hops,
    heuristic_weights,
    num_downstream,
)
from swarm_mj.radio.links import links_between, lone_probabilities
from swarm_mj.radio.mission_radio import radio_of

seeds = st.integers(0, 2**32 - 1)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence
FAR_M = 5000.0
SETTINGS = WeightSettings(
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


class Graph(NamedTuple):
    """What the weights follow from."""

    probability: np.ndarray
    hops: np.ndarray
    downstream: np.ndarray


def graph_of(links):
    probability = lone_probabilities(links)
    hops = expected_hops(np.where(probability >= SETTINGS.min_probability, probability, 0.0))
    return Graph(probability, hops, num_downstream(hops, SETTINGS.slack_hops))


def places(num_robots, seed):
    """Of a connected team, with some robots carried far away, each by itself."""
    mission = paper("stationary", num_robots=num_robots, range_ratio=0.2)
    team = flooded_team(mission, seed)
    position_m = team.position_m.copy()
    for n, i in enumerate(np.flatnonzero(np.random.default_rng(seed).random(num_robots) < 0.15)):
        position_m[i] += FAR_M * (n + 1)
    return team.radio, position_m


def believed(num_robots, seed):
    """Links of positions that are believed within 5 to 60 m."""
    radio, position_m = places(num_robots, seed)
    spread_m = np.random.default_rng(seed).uniform(5.0, 60.0, num_robots)
    return links_between(radio, position_m, spread_m)


def as_networkx(graph):
    """The links that count, each as long as packets must be sent until one decodes."""
    plain = nx.Graph()
    plain.add_nodes_from(range(len(graph.probability)))
    for i, j in zip(
        *np.nonzero(np.triu(graph.probability >= SETTINGS.min_probability)), strict=True
    ):
        plain.add_edge(int(i), int(j), hops=1.0 / float(graph.probability[i, j]))
    return plain


def line(*position_m, spread_m=None, is_known=None):
    """Robots in a row."""
    places = np.array([[x, 0.0] for x in position_m])
    spread = None if spread_m is None else np.full(len(places), spread_m)
    return links_between(RADIO, places, spread, is_known)


def weights_of(links):
    return heuristic_weights(links, SETTINGS)


def test_a_row_of_three_by_hand():
    """Robot 0's news reach robot 2 through robot 1, two hops on; two of three pairs are linked."""
    weights = weights_of(line(0.0, 200.0, 400.0))
    assert weights.squared_rise[1, 0] == pytest.approx(2.0**0.6)
    assert weights.squared_rise[2, 0] == pytest.approx(2.0**-0.3)
    assert weights.squared_rise[0, 1] == pytest.approx(1.0)
    assert weights.min_share == pytest.approx(0.95 - 0.3 * 2 / 3)


def test_the_share_falls_with_links_and_rises_with_doubt_up_to_its_most():
    sparse, dense = line(0.0, 200.0, 400.0, 600.0), line(0.0, 80.0, 160.0, 240.0)
    assert weights_of(dense).min_share < weights_of(sparse).min_share
    shares = [
        weights_of(line(0.0, 80.0, 160.0, 240.0, spread_m=s)).min_share
        for s in (0.1, 1.0, 9.0, 99.0)
    ]
    assert weights_of(dense).min_share < shares[0] < shares[1] < shares[2]
    assert shares[3] == 1.05


def test_the_share_rises_where_a_robot_is_missing():
    """Two of three robots are known, and linked: 0.95 less 0.3, and 0.1 more."""
    weights = weights_of(line(0.0, 100.0, 200.0, is_known=np.array([True, True, False])))
    assert weights.min_share == pytest.approx(0.95 - 0.3 + 0.1)


@given(seed=seeds, num_robots=st.integers(2, 9), is_certain=st.booleans())
def test_hops_are_the_shortest_ways_of_networkx(seed, num_robots, is_certain):
    links = links_between(*places(num_robots, seed)) if is_certain else believed(num_robots, seed)
    graph = graph_of(links)
    ways = dict(nx.all_pairs_dijkstra_path_length(as_networkx(graph), weight="hops"))
    for i in range(num_robots):
        expected = [ways[i].get(j, OUT_OF_REACH) for j in range(num_robots)]
        assert graph.hops[i].tolist() == pytest.approx(expected)


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_downstream_counts_whom_shortest_ways_lead_to(seed, num_robots):
    """Of certain links: all shortest ways from k to j, one by one, and who is on them."""
    graph = graph_of(links_between(*places(num_robots, seed)))
    plain = as_networkx(graph)
    expected = np.zeros((num_robots, num_robots))
    for k in range(num_robots):
        for j in nx.node_connected_component(plain, k):
            on_the_way = {i for way in nx.all_shortest_paths(plain, k, j) for i in way}
            expected[sorted(on_the_way), k] += 1.0
    assert graph.downstream.tolist() == expected.tolist()
    for k in range(num_robots):
        assert graph.downstream[k, k] == len(nx.node_connected_component(plain, k))


@given(seed=seeds, num_robots=st.integers(2, 6))
def test_nearly_shortest_ways_count_too(seed, num_robots):
    """Of doubtful links: all ways without a turning back that are less than the slack longer."""
    graph = graph_of(believed(num_robots, seed))
    plain = as_networkx(graph)
    expected = np.eye(num_robots)
    for k in range(num_robots):
        expected[k, k] = len(nx.node_connected_component(plain, k))
        for j in set(nx.node_connected_component(plain, k)) - {k}:
            ways = list(nx.all_simple_paths(plain, k, j))
            lengths = [nx.path_weight(plain, way, "hops") for way in ways]
            near = [
                way
                for way, n in zip(ways, lengths, strict=True)
                if n < min(lengths) + SETTINGS.slack_hops
            ]
            for i in {i for way in near for i in way} - {k}:
                expected[i, k] += 1.0
    assert graph.downstream.tolist() == expected.tolist()


def test_links_that_decode_rarely_are_no_way():
    """A chance of 0.05 needs 1.73 deviations beyond the range: 285 m are 1.75, 284 m are 1.7."""
    for distance_m, is_link in ((285.0, False), (284.0, True)):
        position_m = np.array([[0.0, 0.0], [distance_m, 0.0]])
        links = links_between(RADIO, position_m, np.array([20.0, 0.0]))
        graph = graph_of(links)
        assert graph.probability[0, 1] > 0.0
        assert (graph.hops[0, 1] < OUT_OF_REACH) == is_link


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
    settings = replace(SETTINGS, share_per_std=1.5)
    assert heuristic_weights(links, settings).min_share == pytest.approx(share)


@pytest.mark.parametrize("num_robots", [1, 3])
def test_teams_without_links_have_finite_weights(num_robots):
    position_m = FAR_M * np.arange(2.0 * num_robots).reshape(num_robots, 2)
    links = links_between(RADIO, position_m, np.full(num_robots, 5.0))
    assert graph_of(links).downstream.tolist() == np.eye(num_robots).tolist()
    weights = weights_of(links)
    assert np.all(np.isfinite(weights.squared_rise))
    assert weights.min_share == 1.05
