"""Connected parts and shortest trees, held against networkx and scipy."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import cdist

from swarm_mj.mission.geometry import ROOT, count_strayed, gather_connected, spanning_tree

# On a line, 10 m apart but for a gap, as robots 3, 0, 4, 1, 2: the middle one is robot 4.
LINE_M = np.array([[10.0, 0.0], [45.0, 0.0], [55.0, 0.0], [0.0, 0.0], [20.0, 0.0]])
LINE_PARENT = [4, 4, 1, 0, ROOT]


def teams_of(seed, num_robots, num_missions=1):
    return np.random.default_rng(seed).uniform(-500, 500, size=(num_missions, num_robots, 2))


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(1, 30))
def test_connected_parts_are_those_of_networkx(seed, num_robots):
    """One after the other, and none is met twice."""
    (position_m,) = teams_of(seed, num_robots)
    edges = np.argwhere(cdist(position_m, position_m) <= 250.0).tolist()
    is_met, members = np.zeros(num_robots, dtype=bool), np.empty(num_robots, dtype=np.int64)
    for part in nx.connected_components(nx.Graph(edges)):
        first = min(part)
        num_members = gather_connected(position_m, 250.0, first, is_met, members)
        assert members[0] == first
        assert sorted(members[:num_members].tolist()) == sorted(part)
    assert np.all(is_met)


def test_who_is_met_already_passes_nothing_on():
    """Robot 0 lies between robots 3 and 4, 10 m from both."""
    is_met, members = np.arange(5) == 0, np.empty(5, dtype=np.int64)
    assert gather_connected(LINE_M, 10.0, 3, is_met, members) == 1
    assert is_met.tolist() == [True, False, False, True, False]


def graph_of(parent):
    graph = nx.Graph()
    graph.add_nodes_from(range(len(parent)))
    graph.add_edges_from((i, int(j)) for i, j in enumerate(parent) if j != ROOT)
    return graph


def test_iv_c_parents_on_a_line_by_hand():
    np.testing.assert_array_equal(spanning_tree(LINE_M[None])[0], LINE_PARENT)


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 60))
def test_iv_c_tree_has_the_least_length(seed, num_robots):
    """One root, N - 1 edges, connected, and as long as scipy's tree."""
    (position_m,) = teams_of(seed, num_robots)
    (parent,) = spanning_tree(position_m[None])
    distance_m = cdist(position_m, position_m)
    length_m = sum(distance_m[i, j] for i, j in enumerate(parent) if j != ROOT)
    assert length_m == pytest.approx(minimum_spanning_tree(distance_m).sum(), rel=1e-9)
    assert np.sum(parent == ROOT) == 1
    assert nx.is_tree(graph_of(parent))


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 60))
def test_iv_c_root_is_a_centre_of_the_tree(seed, num_robots):
    """Following parents leads to the root, within no more hops than the tree's radius."""
    (parent,) = spanning_tree(teams_of(seed, num_robots))
    radius = nx.radius(graph_of(parent))
    for robot in range(num_robots):
        reached, hops = robot, 0
        while parent[reached] != ROOT:
            reached, hops = parent[reached], hops + 1
            assert hops <= radius


def test_robots_with_nobody_in_range_have_strayed():
    """In a row at 0, 10, 25 and 90 m: with 12 m of range the last two, and with 20 m the last."""
    position_m = np.array([[[0.0, 0.0], [10.0, 0.0], [25.0, 0.0], [90.0, 0.0]]])
    everyone = np.ones((1, 4), dtype=np.bool_)
    assert count_strayed(position_m, 12.0, everyone) == [2.0]
    assert count_strayed(position_m, 15.0, everyone) == [1.0]  # at the range is within it
    assert count_strayed(position_m, 15.0, None) == [1.0]
    without_first = np.array([[False, True, True, True]])
    assert count_strayed(position_m, 12.0, without_first) == [3.0]
    alone = np.array([[False, False, False, True]])
    assert count_strayed(position_m, 1000.0, alone) == [1.0]
