"""The network in flight against the one that learns, and against one robot at a time."""

import numpy as np
import pytest
import torch
from residual_networks import WIDTH, some_weights

from swarm_mj.learning.residual.network import ResidualNetwork
from swarm_mj.policies.residual.features import NEIGHBOUR_FEATURES, ROBOT_FEATURES, Seen
from swarm_mj.policies.residual.network import shapes

DEGREES = [[2, 0, 3, 1, 0], [0, 0, 4], [1], [3, 2]]


def seen(degrees, seed=1):
    """Robots with so many neighbours each."""
    rng = np.random.default_rng(seed)
    return Seen(
        robots=rng.standard_normal((len(degrees), len(ROBOT_FEATURES))).astype(np.float32),
        neighbours=rng.standard_normal((sum(degrees), len(NEIGHBOUR_FEATURES))).astype(np.float32),
        owner=np.repeat(np.arange(len(degrees)), degrees),
    )


def layer(arrays, name, values):
    return arrays[f"{name}.weight"].astype(np.float64) @ values + arrays[f"{name}.bias"]


def logit_of(weights, robot, neighbours):
    """Of one robot, its neighbours one after the other."""
    arrays, messages = weights.arrays, [np.zeros(WIDTH)]
    for neighbour in neighbours:
        message = np.concatenate([neighbour, robot])
        for name in ("message.0", "message.2"):
            message = np.maximum(layer(arrays, name, message), 0.0)
        messages.append(message)
    hidden = np.concatenate([0.2 * np.sum(messages, axis=0), np.max(messages, axis=0), robot])
    for name in ("decision.0", "decision.2"):
        hidden = np.maximum(layer(arrays, name, hidden), 0.0)
    return layer(arrays, "logit", hidden)[0] + weights.trust * robot[0]


@pytest.mark.parametrize("degrees", DEGREES)
def test_logits_are_those_of_robots_one_at_a_time(degrees):
    weights, all_seen = some_weights(), seen(degrees)
    expected = [
        logit_of(weights, robot, all_seen.neighbours[all_seen.owner == r])
        for r, robot in enumerate(all_seen.robots)
    ]
    np.testing.assert_allclose(weights.logits(all_seen), expected, rtol=1e-4, atol=1e-5)
    assert weights.logits(all_seen).dtype == np.float32


@pytest.mark.parametrize("degrees", DEGREES)
def test_logits_are_those_of_the_network_that_learns(degrees):
    torch.manual_seed(3)
    network, all_seen = ResidualNetwork(WIDTH, 2.5), seen(degrees)
    torch.nn.init.normal_(network.logit.weight)
    torch.nn.init.normal_(network.logit.bias)
    with torch.no_grad():
        learned = network(*map(torch.as_tensor, all_seen)).numpy()
    weights = network.weights(corrects_turns=True)
    np.testing.assert_allclose(weights.logits(all_seen), learned, rtol=1e-4, atol=1e-5)
    assert (weights.width, weights.trust, weights.corrects_turns) == (WIDTH, 2.5, True)
    assert {name: array.shape for name, array in weights.arrays.items()} == shapes(WIDTH)


def test_the_order_of_neighbours_does_not_matter():
    weights, all_seen = some_weights(), seen([4, 3])
    order = [2, 0, 3, 1, 6, 5, 4]
    mixed = all_seen._replace(neighbours=all_seen.neighbours[order])
    np.testing.assert_allclose(weights.logits(mixed), weights.logits(all_seen), rtol=1e-5)


def test_nobody_decides_where_nobody_is_seen():
    assert some_weights().logits(seen([])).shape == (0,)
    assert some_weights().logits(seen([0, 0])).shape == (2,)
