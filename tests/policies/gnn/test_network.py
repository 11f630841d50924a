"""The Aggregation GNN against the same network written node by node, and against its laws."""

import itertools

import numpy as np
import pytest
import torch

from swarm_mj.policies.gnn.network import AggregationGnn, edges_of, mean_aggregation
from swarm_mj.policies.policy_config import GnnShape

DIRECTIONS = ["paper", "reference", "both"]
VARIANTS = list(itertools.product(DIRECTIONS, [False, True]))


def some_network(seed=0, **its):
    """A float64 network with random weights, biases included."""
    shape = {"num_features": 3, "num_outputs": 2, "latent": 6, "receptive_field": 2} | its
    network = AggregationGnn(GnnShape(**shape)).double()
    generator = torch.Generator().manual_seed(seed)
    for parameter in network.parameters():
        size = parameter.shape[-1] ** -0.5
        parameter.data = torch.randn(parameter.shape, generator=generator).double() * size
    return network


def some_graphs(rng, num_graphs, num_nodes, num_features=3):
    """Features, and random forests: some nodes are unknown, some known ones have no children."""
    parent = np.full((num_graphs, num_nodes), -1)
    for row in parent:
        known = rng.permutation(num_nodes)[: rng.integers(0, num_nodes + 1)]
        for position, child in enumerate(known[1:], start=1):
            row[child] = known[rng.integers(0, position)]
    node = rng.standard_normal((num_graphs, num_nodes, num_features))
    return torch.from_numpy(node), torch.from_numpy(parent)


def edges_in(parent, edges):
    """(receiver, sender, input feature) of every edge of one graph."""
    found = []
    for child, above in enumerate(parent):
        if above >= 0 and edges != "reference":
            found.append((above, child, 0.0))
        if above >= 0 and edges != "paper":
            found.append((child, above, 1.0 if edges == "both" else 0.0))
    return found


def naive(network, node, parent):
    """The network on one graph, node by node and edge by edge, as Eqs. 11 to 14 say it."""
    shape = network.shape
    numbers = {name: value.detach().numpy() for name, value in network.named_parameters()}
    edges = edges_in(parent, shape.edges)

    def perceptron(name, x):
        for layer in range(shape.depth):
            x = numbers[f"{name}.{layer}.weight"] @ x + numbers[f"{name}.{layer}.bias"]
            if layer < shape.depth - 1:
                x = np.maximum(x, 0)
        return x

    def mean_heard(values, listener):
        mine = [value for (r, _, _), value in zip(edges, values, strict=True) if r == listener]
        return sum(mine) / len(mine) if mine else np.zeros(shape.latent)

    v = [perceptron("encoder.node", x) for x in node]
    if shape.has_core:
        e = [perceptron("encoder.edge", np.array([feature])) for _, _, feature in edges]
    stages = [[perceptron("decoder.node", x) for x in v]]
    for _ in range(shape.receptive_field):
        if shape.is_linear:
            v = [mean_heard([v[s] for _, s, _ in edges], k) for k in range(len(v))]
        else:
            ends = [np.concatenate([x, v[r], v[s]]) for x, (r, s, _) in zip(e, edges, strict=True)]
            e = [perceptron("core.edge", x) for x in ends]
            entered = [np.concatenate([mean_heard(e, k), x]) for k, x in enumerate(v)]
            v = [perceptron("core.node", x) for x in entered]
        stages.append([perceptron("decoder.node", x) for x in v])
    joined = [np.concatenate(of_node) for of_node in zip(*stages, strict=True)]
    return np.array([numbers["output.weight"] @ x + numbers["output.bias"] for x in joined])


@pytest.mark.parametrize(("edges", "is_linear"), VARIANTS)
@pytest.mark.parametrize("depth", [1, 2, 3])
@pytest.mark.parametrize("receptive_field", [0, 1, 2, 3])
def test_eq14_equals_the_network_written_node_by_node(edges, is_linear, depth, receptive_field):
    network = some_network(
        edges=edges, is_linear=is_linear, depth=depth, receptive_field=receptive_field
    )
    node, parent = some_graphs(np.random.default_rng(depth), 4, 6)
    expected = [naive(network, x, p) for x, p in zip(node.numpy(), parent.tolist(), strict=True)]
    np.testing.assert_allclose(network(node, parent).detach(), expected, rtol=1e-10, atol=1e-12)


def test_eq14_its_parameters_are_those_of_the_plain_network():
    network = AggregationGnn(GnnShape(num_features=7, num_outputs=2))
    inputs = {
        "encoder.node": 7, "encoder.edge": 1, "decoder.node": 64,
        "core.edge": 3 * 64, "core.node": 2 * 64,
    }  # fmt: skip
    expected = {"output.weight": (2, 6 * 64), "output.bias": (2,)}
    for name, width in inputs.items():
        for layer, num_inputs in enumerate([width, 64, 64]):
            expected[f"{name}.{layer}.weight"] = (64, num_inputs)
            expected[f"{name}.{layer}.bias"] = (64,)
    assert {name: tuple(x.shape) for name, x in network.named_parameters()} == expected


@pytest.mark.parametrize(
    ("edges", "found"),
    [  # (receiver, sender, feature): 0 is the parent of 1 and 3; in the next graph, 5 of 4
        ("paper", [(0, 1, 0.0), (0, 3, 0.0), (5, 4, 0.0)]),
        ("reference", [(1, 0, 0.0), (3, 0, 0.0), (4, 5, 0.0)]),
        ("both", [(0, 1, 0.0), (0, 3, 0.0), (5, 4, 0.0), (1, 0, 1.0), (3, 0, 1.0), (4, 5, 1.0)]),
    ],
)
def test_iii_a_edges_lead_from_senders_to_receivers(edges, found):
    parent = torch.tensor([[-1, 0, -1, 0], [1, -1, -1, -1]])
    receiver, sender, feature = edges_of(parent, edges, torch.double)
    listed = zip(receiver.tolist(), sender.tolist(), feature.flatten().tolist(), strict=True)
    assert list(listed) == found


def test_eq12_the_mean_by_hand():
    edge = torch.tensor([[1.0, 10.0], [4.0, 40.0], [7.0, 70.0]])
    mean = mean_aggregation(edge, torch.tensor([2, 2, 0]), 4)
    assert mean.tolist() == [[7.0, 70.0], [0.0, 0.0], [2.5, 25.0], [0.0, 0.0]]


@pytest.mark.parametrize("edges", DIRECTIONS)
def test_eq14_the_linear_variant_is_a_sum_of_adjacency_powers(edges):
    """At depth 1: A^k (X E' + e) D' + d, each mapped by its block of f_out, summed over k."""
    network = some_network(edges=edges, is_linear=True, depth=1, receptive_field=4)
    (node,), (parent,) = some_graphs(np.random.default_rng(5), 1, 9)
    adjacency = np.zeros((9, 9))
    for receiver, sender, _ in edges_in(parent.tolist(), edges):
        adjacency[receiver, sender] += 1
    adjacency /= np.maximum(adjacency.sum(axis=1, keepdims=True), 1)
    assert adjacency.any()
    E, e = (x.detach().numpy() for x in network.encoder.node[0].parameters())
    D, d = (x.detach().numpy() for x in network.decoder.node[0].parameters())
    F, expected = (x.detach().numpy() for x in network.output.parameters())
    for k in range(5):
        stage = np.linalg.matrix_power(adjacency, k) @ (node.numpy() @ E.T + e) @ D.T + d
        expected = expected + stage @ F[:, 6 * k : 6 * k + 6].T
    np.testing.assert_allclose(network(node[None], parent[None])[0].detach(), expected, rtol=1e-10)


@pytest.mark.parametrize(("edges", "is_linear"), VARIANTS)
def test_every_parameter_learns(edges, is_linear):
    network = some_network(edges=edges, is_linear=is_linear)
    node, parent = some_graphs(np.random.default_rng(2), 5, 6)
    network(node, parent).square().sum().backward()
    idle = {name for name, x in network.named_parameters() if not x.grad.any()}
    # The one feature of an edge is 0 where all point one way: nothing to learn from it.
    one_way = edges != "both" and not is_linear
    assert idle == ({"encoder.edge.0.weight"} if one_way else set())


def test_refuses_other_features_and_foreign_parents():
    network = some_network()
    node, parent = some_graphs(np.random.default_rng(7), 2, 4)
    with pytest.raises(ValueError, match=r"the 3 features that the network was made for, not 2"):
        network(node[..., :2], parent)
    parent[1, 2] = 4
    with pytest.raises(ValueError, match=r"one of its graph's nodes, 0 to 3, .* not 4"):
        network(node, parent)
