"""Graphs of links, held against networkx."""

import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import norm
from standing_teams import flooded_team

from swarm_mj.mission import paper
from swarm_mj.policies.planner import link_graph as module
from swarm_mj.policies.planner.link_graph import OUT_OF_REACH
from swarm_mj.policies.planner.settings import WeightSettings
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of

seeds = st.integers(0, 2**32 - 1)
RADIO = radio_of(paper("stationary"))  # decodes up to 250 m in silence
FAR_M = 5000.0
SETTINGS = WeightSettings(min_probability=0.05, slack_hops=0.25)


def link_graph(links):
    return module.link_graph(links, SETTINGS)


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


@given(seed=seeds, num_robots=st.integers(2, 9))
def test_certain_links_are_those_in_range(seed, num_robots):
    radio, position_m = places(num_robots, seed)
    graph = link_graph(links_between(radio, position_m))
    range_m = 0.2 * 1000.0
    for i in range(num_robots):
        for j in range(num_robots):
            apart_m = math.dist(position_m[i], position_m[j])
            assert graph.probability[i, j] == float(i != j and apart_m <= range_m)
    assert graph.relative_std == 0.0


@pytest.mark.parametrize("spread_m", [[30.0, 40.0], [0.0, 20.0]])
@pytest.mark.parametrize("deviations", [-2.6, -2.0, -0.7, 0.0, 0.4, 1.5, 2.6])
def test_the_chance_is_that_of_being_in_range(spread_m, deviations):
    """By the normal distribution of the distance, with a step where doubt is beyond 2.5 of it."""
    deviation_m = math.hypot(*spread_m)
    position_m = np.array([[0.0, 0.0], [250.0 - deviations * deviation_m, 0.0]])
    graph = link_graph(links_between(RADIO, position_m, np.array(spread_m)))
    expected = {-2.6: 0.0, 2.6: 1.0}.get(deviations, norm.cdf(deviations))
    assert graph.probability[0, 1] == graph.probability[1, 0] == pytest.approx(expected, abs=0.0096)
    assert graph.probability[0, 0] == graph.probability[1, 1] == 0.0


@given(seed=seeds, num_robots=st.integers(2, 9), is_certain=st.booleans())
def test_hops_are_the_shortest_ways_of_networkx(seed, num_robots, is_certain):
    links = links_between(*places(num_robots, seed)) if is_certain else believed(num_robots, seed)
    graph = link_graph(links)
    ways = dict(nx.all_pairs_dijkstra_path_length(as_networkx(graph), weight="hops"))
    for i in range(num_robots):
        expected = [ways[i].get(j, OUT_OF_REACH) for j in range(num_robots)]
        assert graph.hops[i].tolist() == pytest.approx(expected)


@given(seed=seeds, num_robots=st.integers(2, 8))
def test_downstream_counts_whom_shortest_ways_lead_to(seed, num_robots):
    """Of certain links: all shortest ways from k to j, one by one, and who is on them."""
    graph = link_graph(links_between(*places(num_robots, seed)))
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
    graph = link_graph(believed(num_robots, seed))
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
        graph = link_graph(links_between(RADIO, position_m, np.array([20.0, 0.0])))
        assert graph.probability[0, 1] > 0.0
        assert (graph.hops[0, 1] < OUT_OF_REACH) == is_link
        assert graph.has_no_isolated_node == is_link


def test_the_team_in_numbers_by_hand():
    """A triangle, and a robot too far away: three of six pairs are linked, of three without it.

    Robots are believed within 3 and 4 m or so, and 50 m apart: a tenth of it, as a mean.
    """
    position_m = np.array([[0.0, 0.0], [30.0, 40.0], [50.0, 0.0], [FAR_M, 0.0]])
    graph = link_graph(links_between(RADIO, position_m, np.array([3.0, 4.0, 4.0, 4.0])))
    assert not graph.has_no_isolated_node
    assert graph.linked_share == 1.0
    apart = math.dist([30.0, 40.0], [50.0, 0.0])
    assert graph.relative_std == pytest.approx((0.1 + 0.1 + math.sqrt(32.0) / apart) / 3)
    near = link_graph(links_between(RADIO, position_m[:3] * [6.0, 0.0]))
    assert near.has_no_isolated_node  # at 0, 180 and 300 m
    assert near.linked_share == pytest.approx(2 / 3)


@pytest.mark.parametrize("num_robots", [1, 3])
def test_who_has_no_links_at_all(num_robots):
    position_m = FAR_M * np.arange(2.0 * num_robots).reshape(num_robots, 2)
    graph = link_graph(links_between(RADIO, position_m, np.full(num_robots, 5.0)))
    assert not graph.has_no_isolated_node
    assert graph.linked_share == graph.relative_std == 0.0
    assert graph.downstream.tolist() == np.eye(num_robots).tolist()
