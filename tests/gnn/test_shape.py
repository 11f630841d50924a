"""The limits of a network's shape, and of what it is given."""

import pytest
import torch

from swarm_mj.gnn.shape import GnnShape


@pytest.mark.parametrize(
    ("its", "complaint"),
    [
        ({"num_features": 0}, "num_features must be a whole number from 1 to 1024, not 0"),
        ({"num_outputs": 1025}, "num_outputs must be a whole number from 1 to 1024, not 1025"),
        ({"latent": 0}, "latent must be a whole number from 1 to 1024, not 0"),
        ({"depth": 9}, "depth must be a whole number from 1 to 8, not 9"),
        ({"receptive_field": -1}, "receptive_field must be a whole number from 0 to 16, not -1"),
        ({"receptive_field": 17}, "receptive_field must be a whole number from 0 to 16, not 17"),
    ],
)
def test_a_shape_refuses_what_is_out_of_range(its, complaint):
    with pytest.raises(ValueError, match=complaint):
        GnnShape(**({"num_features": 3} | its))


@pytest.mark.parametrize(
    ("receptive_field", "is_linear", "has_core"),
    [(0, False, False), (0, True, False), (2, True, False), (1, False, True)],
)
def test_only_a_block_that_is_applied_and_not_linear_learns(receptive_field, is_linear, has_core):
    shape = GnnShape(num_features=3, receptive_field=receptive_field, is_linear=is_linear)
    assert shape.has_core == has_core


def test_it_checks_what_the_network_is_given():
    shape = GnnShape(num_features=3)
    node, parent = torch.zeros(2, 4, 3), torch.full((2, 4), -1)
    shape.check(node, parent)
    shape.check(node[:0], parent[:0])
    with pytest.raises(ValueError, match="the 3 features that the network was made for, not 2"):
        shape.check(node[..., :2], parent)
    parent[1, 2] = 4
    with pytest.raises(ValueError, match=r"one of its graph's nodes, 0 to 3, .* not 4"):
        shape.check(node, parent)
