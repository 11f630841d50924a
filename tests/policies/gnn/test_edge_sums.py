"""Means over edges by hand, and their gradients against differences."""

import numpy as np
import pytest
import torch

from swarm_mj.policies.gnn.edge_sums import EdgeMeans, edges_to

UP, DOWN, BOTH = ([True], [False], [True, False])


def means(ends, parent, is_upward, is_wanted):
    edges = edges_to(np.array(parent), np.array(is_upward), np.array(is_wanted))
    return EdgeMeans.apply(*ends, edges), edges


def test_means_by_hand():
    """One graph of four nodes, 0 and 2 below 1, and 3 alone; one number a node, one asked for less.

    Node 1 hears 0 and 2: relu(10 + 1 - 15) = 0 and relu(10 + 7 - 15) = 2, whose mean is 1. Node 2
    hears 1; node 0, which does too, was not asked for.
    """
    receiver = torch.tensor([[10.0], [0.5], [3.0]])
    sender = torch.tensor([[1.0], [4.0], [7.0], [9.0]])
    ends = receiver, sender, torch.tensor([[-15.0], [0.25]])
    mean, edges = means(ends, [[1, -1, 1, -1]], BOTH, [[False, True, True, True]])
    assert mean.tolist() == [[1.0], [0.5 + 4.0 + 0.25], [0.0]]
    found = [each.tolist() for each in edges]
    # Ends among 1, 2 and 3, starts among all, directions, and the number of edges of each end.
    assert found == [[0, 0, 1], [0, 2, 1], [0, 0, 1], [2, 1, 0]]


@pytest.mark.parametrize("is_upward", [UP, DOWN, BOTH])
def test_gradients_are_those_of_differences(is_upward):
    rng = np.random.default_rng(1)
    parent, is_wanted = rng.integers(-1, 5, (3, 5)), rng.random((3, 5)) < 0.6
    edges = edges_to(parent, np.array(is_upward), is_wanted)
    shapes = [(int(is_wanted.sum()), 2), (15, 2), (len(is_upward), 2)]
    given = [torch.tensor(rng.standard_normal(shape), requires_grad=True) for shape in shapes]
    assert torch.autograd.gradcheck(lambda *its: EdgeMeans.apply(*its, edges), given)


def test_float32_stays_float32():
    ends = torch.ones(2, 3), torch.ones(2, 3), torch.zeros(1, 3)
    mean, _ = means(ends, [[-1, 0]], UP, [[True, True]])
    assert mean.dtype == torch.float
