"""The limits of a network's shape."""

import pytest

from swarm_mj.policies.gnn.shape import GnnShape


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
