"""Means over edges by hand, and their gradients against differences."""

import pytest
import torch

from swarm_mj.policies.gnn.edge_means import EdgeMeans

UP, DOWN, BOTH = [True], [False], [True, False]


def test_means_by_hand():
    """One graph of four nodes, 0 and 2 below 1, and 3 alone; one number a node, one asked for less.

    Node 1 hears 0 and 2: relu(10 + 1 - 15) = 0 and relu(10 + 7 - 15) = 2, so 1 on average. Node 2
    hears 1; node 0, which does too, was not asked for.
    """
    receiver, sender = (
        torch.tensor([[10.0], [0.5], [3.0]]),
        torch.tensor([[[1.0], [4.0], [7.0], [9.0]]]),
    )
    parent = torch.tensor([[1, -1, 1, -1]])
    is_wanted = torch.tensor([[False, True, True, True]])
    direction = torch.tensor([[-15.0], [0.25]])
    mean, share = EdgeMeans.apply(
        receiver, sender, direction, parent, torch.tensor(BOTH), is_wanted
    )
    assert mean.tolist() == [[1.0], [0.5 + 4.0 + 0.25], [0.0]]
    assert share.tolist() == [0.5, 1.0, 0.0]


@pytest.mark.parametrize("is_upward", [UP, DOWN, BOTH])
def test_gradients_are_those_of_differences(is_upward):
    generator = torch.Generator().manual_seed(1)
    parent = torch.randint(-1, 5, (3, 5), generator=generator)
    is_wanted = torch.rand(3, 5, generator=generator) < 0.6
    shapes = [(int(is_wanted.sum()), 2), (3, 5, 2), (len(is_upward), 2)]
    given = [
        torch.randn(shape, generator=generator, dtype=torch.double, requires_grad=True)
        for shape in shapes
    ]
    rest = (parent, torch.tensor(is_upward), is_wanted)
    assert torch.autograd.gradcheck(lambda *its: EdgeMeans.apply(*its, *rest)[0], given)


def test_float32_stays_float32():
    parent, is_wanted = torch.tensor([[-1, 0]]), torch.ones(1, 2, dtype=torch.bool)
    ends = torch.ones(2, 3), torch.ones(1, 2, 3), torch.zeros(1, 3)
    found = EdgeMeans.apply(*ends, parent, torch.tensor(UP), is_wanted)
    assert [each.dtype for each in found] == [torch.float, torch.float]
