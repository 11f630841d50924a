"""Small networks that correct a plan, with random weights."""

import numpy as np

from swarm_mj.policies.residual.network import Weights, shapes

WIDTH = 4


def some_weights(seed=1, *, scale=0.5, trust=1.0, corrects_turns=False):
    """A network whose weights depend on the seed only."""
    rng = np.random.default_rng(seed)
    arrays = {
        name: (scale * rng.standard_normal(shape)).astype(np.float32)
        for name, shape in shapes(WIDTH).items()
    }
    return Weights(arrays, trust, corrects_turns)


def silent_weights(*, corrects_turns=False):
    """As before training: the network says nothing, so that the rule decides."""
    weights = some_weights(trust=5.0, corrects_turns=corrects_turns)
    for name in ("logit.weight", "logit.bias"):
        weights.arrays[name][...] = 0.0
    return weights
