"""Draws from logits against their probabilities, and perceptrons by hand."""

import math

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.gnn.feature_sets import make_extractor, num_features
from swarm_mj.policies.gnn.graphs import Graphs
from swarm_mj.policies.learned import IMPOSSIBLE, MlpPolicy, sample
from swarm_mj.policies.policy_config import MlpShape
from swarm_mj.simulation.swarm import Swarm


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_grid_of_numbers_draws_each_recipient_as_often_as_it_is_probable(kind):
    """Of 10 000 numbers on a grid, each recipient gets its share but for one at either end."""
    rng = np.random.default_rng(4)
    for scale in (0.1, 1.0, 5.0):
        row = (scale * rng.standard_normal(7)).astype(kind)
        grid = (np.arange(10_000) + 0.5) / 10_000
        drawn = np.bincount(sample(np.tile(row, (10_000, 1)), grid), minlength=7)
        weight = [math.exp(float(logit)) for logit in row]
        expected = [10_000 * w / sum(weight) for w in weight]
        assert np.all(np.abs(drawn - expected) <= 1.01)


def test_the_cumulated_probabilities_decide():
    """Of shares 1/2, 1/4, 0, 1/4, in this order; the largest number below 1 takes the last."""
    shares = np.log([[2.0, 1.0, 1.0, 1.0]])
    shares[0, 2] = IMPOSSIBLE
    uniform = np.array([0.0, 0.499, 0.501, 0.749, 0.751, np.nextafter(1.0, 0.0)])
    drawn = sample(np.tile(shares, (6, 1)), uniform)
    assert drawn.tolist() == [0, 0, 1, 1, 3, 3]
    of_four_alike = sample(np.zeros((4, 4)), np.array([0.0, 0.25, 0.5, 0.75]))
    assert of_four_alike.tolist() == [0, 1, 2, 3]


def test_masked_recipients_are_never_drawn():
    """However likely the others of a row of 9, and whatever the number, 0 included."""
    rng = np.random.default_rng(2)
    logits = 30.0 * rng.standard_normal((5000, 9)).astype(np.float32)
    is_masked = rng.random((5000, 9)) < 0.6
    is_masked[np.arange(5000), rng.integers(0, 9, 5000)] = False
    logits[is_masked] = IMPOSSIBLE
    for uniform in (rng.random(5000), np.zeros(5000), np.full(5000, np.nextafter(1.0, 0.0))):
        assert not np.any(is_masked[np.arange(5000), sample(logits, uniform)])


# Perceptrons.

MISSION = paper("random-walk", num_robots=4, range_ratio=0.2, num_windows=30)


def shape_of(hidden=(5,), activation="tanh", obeys_mask=True):
    its = {"num_robots": 4, "features": "extended", "num_features": 18, "hidden": hidden}
    return MlpShape(**its, activation=activation, obeys_mask=obeys_mask)


def weights_of(shape, seed=1):
    rng = np.random.default_rng(seed)
    return {
        name: rng.standard_normal(size).astype(np.float32) for name, size in shape.tensors.items()
    }


def policy_of(shape, seed=1, **options):
    extractor = make_extractor(shape.features, MISSION)
    return MlpPolicy(shape, weights_of(shape, seed), extractor, **options)


def graphs_of(may_address, node):
    """Return graphs that only an MLP can take: it looks at no parents and no turns."""
    rows = may_address.reshape(-1, 4)
    parent, has_turn = np.full(rows.shape, -1), np.zeros(len(rows), dtype=bool)
    node = node.reshape(*rows.shape, -1)
    return Graphs(node=node, parent=parent, may_address=rows, has_turn=has_turn)


@pytest.mark.parametrize(
    ("hidden", "activation", "obeys_mask"),
    [((), "tanh", True), ((5,), "tanh", False), ((6, 3), "tanh", True), ((6, 3), "relu", False)],
)
def test_logits_are_those_of_the_network_written_out(hidden, activation, obeys_mask):
    shape = shape_of(hidden, activation, obeys_mask)
    weights, rng = weights_of(shape), np.random.default_rng(3)
    node = rng.standard_normal((2, 4, 4, num_features("extended"))).astype(np.float32)
    may_address = rng.random((2, 4, 4)) < 0.6
    found = policy_of(shape).logits(graphs_of(may_address, node)).reshape(2, 4, 4)
    for b, i in np.ndindex(2, 4):
        values = [*map(float, may_address[b, i]), *map(float, node[b, i].ravel())]
        for n in range(len(hidden) + 1):
            matrix, bias = weights[f"{n}.weight"], weights[f"{n}.bias"]
            values = [sum(w * x for w, x in zip(row, values, strict=True)) for row in matrix] + bias
            if n < len(hidden):
                values = [np.tanh(x) if activation == "tanh" else max(x, 0.0) for x in values]
        forbidden = obeys_mask & ~may_address[b, i]
        np.testing.assert_allclose(
            found[b, i], np.where(forbidden, -1e9, values), rtol=1e-4, atol=1e-4
        )


def recipients(policy, seeds, num_windows=20):
    swarm, chosen = Swarm(MISSION, seeds), []
    swarm.start(policy)
    for _ in range(num_windows):
        chosen.append(swarm.decide())
        swarm.step_with_recipients(chosen[-1])
    return np.stack(chosen, axis=1)


def test_missions_beside_it_change_nothing():
    alone = [recipients(policy_of(shape_of()), [seed])[0] for seed in (3, 4, 5)]
    np.testing.assert_array_equal(recipients(policy_of(shape_of()), [3, 4, 5]), alone)


def test_masks_are_obeyed_and_draws_follow_the_logits():
    policy, swarm = policy_of(shape_of()), Swarm(MISSION, range(200))
    swarm.start(policy)
    chosen = swarm.decide()
    graphs = make_extractor("extended", MISSION)
    graphs.start(200, 4)
    seen = graphs.graphs(swarm.views)
    logits = policy.logits(seen).reshape(200, 4, 4)
    odds = np.exp(logits - logits.max(axis=2, keepdims=True))
    expected = (odds / odds.sum(axis=2, keepdims=True)).mean(axis=0)
    found = np.stack([(chosen == k).mean(axis=0) for k in range(4)], axis=1)
    np.testing.assert_allclose(found, expected, atol=0.12)  # 3 standard errors of a half
    swarm.start(policy_of(shape_of(), is_deterministic=True))
    np.testing.assert_array_equal(swarm.decide(), logits.argmax(axis=2))


def test_a_digest_tells_networks_apart():
    digests = {
        policy_of(shape, seed).parameters["digest"]
        for shape in (shape_of(), shape_of(obeys_mask=False), shape_of(activation="relu"))
        for seed in (1, 2)
    }
    assert len(digests) == 6
    assert policy_of(shape_of()).parameters["digest"] in digests
