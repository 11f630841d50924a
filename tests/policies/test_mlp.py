"""A plain network as a policy, by hand and beside itself."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.gnn.feature_sets import make_extractor, num_features
from swarm_mj.policies.gnn.graphs import Graphs
from swarm_mj.policies.mlp import MlpPolicy, MlpShape
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("random-walk", num_robots=4, range_ratio=0.2, num_windows=30)


def shape_of(hidden=(5,), activation="tanh", obeys_mask=True, features="extended"):
    return MlpShape(
        num_robots=4,
        features=features,
        num_features=18,
        hidden=hidden,
        activation=activation,
        obeys_mask=obeys_mask,
    )


def weights_of(shape, seed=1):
    rng = np.random.default_rng(seed)
    return {
        name: rng.standard_normal(size).astype(np.float32) for name, size in shape.tensors().items()
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


@pytest.mark.parametrize("hidden", [(), (5,), (6, 3)])
@pytest.mark.parametrize("activation", ["tanh", "relu"])
@pytest.mark.parametrize("obeys_mask", [True, False])
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


@pytest.mark.parametrize(
    ("its", "complaint"),
    [
        ({"num_robots": 1}, "num_robots must be a whole number from 2 to 1000, not 1"),
        ({"hidden": (0,)}, "hidden must be a whole number from 1 to 4096, not 0"),
        ({"features": "mine"}, "features must be one of"),
        ({"num_features": 18}, "num_features is 18, but the paper features are 8"),
    ],
)
def test_a_shape_refuses_what_is_out_of_range(its, complaint):
    usual = {"num_robots": 4, "features": "paper", "num_features": 8}
    usual |= {"hidden": (3,), "activation": "tanh"}
    with pytest.raises(ValueError, match=complaint):
        MlpShape(obeys_mask=True, **(usual | its))
