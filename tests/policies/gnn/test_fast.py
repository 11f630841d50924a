"""The fast network against the plain one, whose weights it has: numbers and gradients."""

import itertools

import numpy as np
import pytest
import torch

import swarm_mj.policies.gnn.fast
from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.gnn.network import AggregationGnn
from swarm_mj.policies.policy_config import GnnShape

DIRECTIONS = ["paper", "reference", "both"]
SHAPES = list(itertools.product(DIRECTIONS, [2, 3], [0, 1, 3]))


def plain_and_fast(dtype=torch.double, **its):
    """Two networks of the same random weights, biases included."""
    shape = GnnShape(**({"num_features": 3, "num_outputs": 2, "latent": 6} | its))
    with torch.random.fork_rng():
        torch.manual_seed(0)
        plain, fast = AggregationGnn(shape).to(dtype), FastAggregationGnn(shape).to(dtype)
    fast.load_state_dict(plain.state_dict())
    return plain, fast


def some_graphs(seed, num_graphs, num_nodes):
    """Features, and random forests in which some nodes are alone, such as padding is."""
    rng = np.random.default_rng(seed)
    parent = rng.integers(-1, np.arange(num_nodes), size=(num_graphs, num_nodes))
    parent[rng.random(parent.shape) < 0.3] = -1
    node = rng.standard_normal((num_graphs, num_nodes, 3))
    return torch.from_numpy(node), torch.from_numpy(parent)


def some_wanted(seed, num_graphs, num_nodes):
    """Two nodes in three, of the first graph none and of the second all."""
    is_wanted = torch.from_numpy(np.random.default_rng(seed).random((num_graphs, num_nodes)) < 0.67)
    is_wanted[0], is_wanted[1] = False, True
    return is_wanted


def outputs_and_gradients(network, node, parent, is_wanted=None):
    node = node.clone().requires_grad_()
    output = network(node, parent, is_wanted)
    output.square().sum().backward()
    return {"output": output.detach(), "node": node.grad} | {
        name: torch.zeros_like(x) if x.grad is None else x.grad
        for name, x in network.named_parameters()
    }


@pytest.mark.parametrize("asks", [False, True])
@pytest.mark.parametrize(
    ("edges", "depth", "receptive_field", "is_linear"),
    [*((*shape, False) for shape in SHAPES), ("both", 1, 2, False), ("both", 2, 2, True)],
)
def test_the_fast_network_is_the_plain_one(edges, depth, receptive_field, is_linear, asks):
    """Also if only some nodes are wanted: they are as they were, and the rest is 0."""
    its = {"depth": depth, "receptive_field": receptive_field, "is_linear": is_linear}
    plain, fast = plain_and_fast(edges=edges, **its)
    graphs, is_wanted = some_graphs(depth, 5, 7), some_wanted(depth, 5, 7) if asks else None
    expected, found = (outputs_and_gradients(each, *graphs, is_wanted) for each in (plain, fast))
    if is_wanted is not None:
        assert torch.equal(expected["output"][is_wanted], plain(*graphs)[is_wanted])
        assert not torch.any(expected["output"][~is_wanted])
    assert expected.keys() == found.keys()
    for name in expected:
        torch.testing.assert_close(found[name], expected[name], rtol=1e-9, atol=1e-11, msg=name)


@pytest.mark.parametrize(
    ("edges", "needed"), [("paper", [1, 2, 3]), ("reference", [0, 1]), ("both", [0, 1, 2, 3])]
)
def test_nodes_that_the_wanted_ones_do_not_hear_of_take_no_part(edges, needed):
    """A chain 5 - 4 - 3 - 2 - 1 - 0, whose children are left: node 1 hears nodes up to two away."""
    _, fast = plain_and_fast(edges=edges, depth=3, receptive_field=2)
    node, parent = torch.full((1, 6, 3), torch.nan).double(), torch.arange(-1, 5)[None]
    node[0, needed] = torch.arange(1.0, 3.0 * len(needed) + 1.0).double().reshape(-1, 3)
    is_wanted = torch.arange(6)[None] == 1
    found = outputs_and_gradients(fast, node, parent, is_wanted)
    assert found["output"][0, 1].isfinite().all()
    for name, gradient in found.items():
        assert gradient.isfinite().all(), name
    assert torch.any(found["node"][0, needed[-1]] != 0.0)
    assert torch.any(found["node"][0, needed[0]] != 0.0)


@pytest.mark.parametrize("edges", DIRECTIONS)
def test_float32_rounds_little(edges):
    plain, fast = plain_and_fast(torch.float, edges=edges, latent=32, receptive_field=5)
    node, parent = some_graphs(4, 100, 8)
    expected = plain.double()(node, parent)
    for dtype in (torch.int, torch.long):
        with torch.inference_mode():
            found = fast(node.float(), parent.to(dtype))
        torch.testing.assert_close(found.double(), expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("is_linear", [False, True])
def test_a_batch_in_parts_equals_the_whole(is_linear, monkeypatch):
    _, fast = plain_and_fast(is_linear=is_linear)
    graphs = some_graphs(6, 7, 5)
    whole = fast(*graphs)
    is_wanted = some_wanted(6, 7, 5)
    monkeypatch.setattr(swarm_mj.policies.gnn.fast, "NODES_AT_ONCE", 11)
    torch.testing.assert_close(fast(*graphs), whole)
    torch.testing.assert_close(fast(*graphs, is_wanted), whole * is_wanted[:, :, None])


def test_later_weights_count():
    plain, fast = plain_and_fast()
    graphs = some_graphs(7, 3, 5)
    before = fast(*graphs)
    for network in (plain, fast):
        for parameter in network.parameters():
            parameter.data *= 1.5
    assert not torch.allclose(fast(*graphs), before)
    torch.testing.assert_close(fast(*graphs), plain(*graphs))


@pytest.mark.parametrize("shape", [(0, 5), (3, 0)])
def test_nothing_in_nothing_out(shape):
    _, fast = plain_and_fast()
    nothing = fast(torch.zeros(*shape, 3).double(), torch.zeros(shape, dtype=torch.int))
    assert nothing.shape == (*shape, 2)
