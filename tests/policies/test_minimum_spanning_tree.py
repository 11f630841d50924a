import math

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial.distance import cdist

from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.minimum_spanning_tree import ROOT, MinimumSpanningTree, spanning_tree
from swarm_mj.policies.policy import BroadcastPolicy, CentralisedPolicy
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews

# On a line, 10 m apart but for a gap, as robots 3, 0, 4, 1, 2: the middle one is robot 4.
LINE_M = np.array([[10.0, 0.0], [45.0, 0.0], [55.0, 0.0], [0.0, 0.0], [20.0, 0.0]])
LINE_PARENT = [4, 4, 1, 0, ROOT]


def teams_of(seed, num_robots, num_missions=1):
    return np.random.default_rng(seed).uniform(-500, 500, size=(num_missions, num_robots, 2))


def decided(policy, position_m):
    """Whom everyone addresses."""
    num_missions, num_robots = position_m.shape[:2]
    views = LocalViews(
        buffers=empty_buffers(num_missions, num_robots), now=np.zeros(num_missions), phases=()
    )
    states = RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
    return policy.recipients(views, states)


def started(num_robots, probability=1.0, num_missions=1, **options):
    policy = MinimumSpanningTree(probability, **options)
    policy.start(num_robots, [np.random.default_rng((5, b)) for b in range(num_missions)])
    return policy


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


def test_iv_c_every_mission_has_its_own_tree():
    teams_m = teams_of(0, 12, num_missions=4)
    alone = np.concatenate([spanning_tree(teams_m[b : b + 1]) for b in range(4)])
    np.testing.assert_array_equal(spanning_tree(teams_m), alone)


def test_iv_c_robots_at_one_place_still_form_a_tree():
    (parent,) = spanning_tree(np.zeros((1, 6, 2)))
    assert nx.is_tree(graph_of(parent))


def test_iv_c_root_is_silent_by_default():
    """The paper's root has no parent to talk to; everyone else addresses theirs."""
    np.testing.assert_array_equal(decided(started(5), LINE_M[None]), [[4, 4, 1, 0, 4]])


def test_iv_c_reference_root_addresses_the_last_robot():
    """The authors' missing parent, -1, counts from the end; a root that is the last is silent."""
    swapped = LINE_M[[0, 1, 4, 3, 2]]  # robot 2 is now the middle one
    policy = started(5, root_transmits=True)
    np.testing.assert_array_equal(decided(policy, swapped[None]), [[2, 2, 4, 0, 1]])
    policy = started(5, root_transmits=True)
    np.testing.assert_array_equal(decided(policy, LINE_M[None]), [[4, 4, 1, 0, 4]])


def test_iv_c_tree_is_kept_from_the_start_or_recomputed():
    moved = LINE_M[[4, 1, 2, 3, 0]]  # robots 0 and 4 swap places: robot 0 is the middle one
    kept, anew = started(5), started(5, is_recomputed=True)
    for policy in (kept, anew):
        np.testing.assert_array_equal(decided(policy, LINE_M[None]), [[4, 4, 1, 0, 4]])
    np.testing.assert_array_equal(decided(kept, moved[None]), [[4, 4, 1, 0, 4]])
    np.testing.assert_array_equal(decided(anew, moved[None]), [[0, 0, 1, 4, 0]])
    kept.start(5, [np.random.default_rng(0)])  # a new mission forgets the old tree
    np.testing.assert_array_equal(decided(kept, moved[None]), [[0, 0, 1, 4, 0]])


def test_iv_c_probability_0_is_silence():
    policy = started(5, probability=0.0)
    for _ in range(100):
        np.testing.assert_array_equal(decided(policy, LINE_M[None]), [range(5)])


def test_iv_c_probability_1_always_talks_to_the_parent():
    policy = started(5, num_missions=2)
    for _ in range(100):
        recipient = decided(policy, np.stack([LINE_M, LINE_M]))
        np.testing.assert_array_equal(recipient, [[4, 4, 1, 0, 4]] * 2)


@pytest.mark.parametrize("probability", [0.06, 0.5])
def test_iv_c_frequency_is_the_probability(probability):
    """Each robot but the root: within 5 standard deviations; and robots draw apart."""
    policy = started(5, probability, num_missions=2)
    both_m = np.stack([LINE_M, LINE_M])
    sending = np.stack([decided(policy, both_m) != np.arange(5) for _ in range(3000)])
    assert not np.any(sending[..., 4])
    deviation = math.sqrt(probability * (1 - probability) / 6000)
    off = np.mean(sending[..., :4], axis=(0, 1)) - probability
    assert np.abs(off).max() < 5 * deviation
    correlation = np.corrcoef(sending[..., :4].reshape(3000, -1).T)
    np.testing.assert_allclose(correlation, np.eye(8), atol=5 / math.sqrt(3000))


def test_iv_c_is_centralised():
    assert issubclass(MinimumSpanningTree, CentralisedPolicy)
    assert not issubclass(MinimumSpanningTree, BroadcastPolicy)


@pytest.mark.parametrize("probability", [-0.01, 1.01, math.nan])
def test_bad_probability_is_a_clear_error(probability):
    with pytest.raises(ValueError, match=f"probability must be from 0 to 1, not {probability:g}"):
        MinimumSpanningTree(probability)
