"""Decisions drawn from logits over recipients (III-C)."""

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.system.compiled import compiled

IMPOSSIBLE = -1e9  # the logit of a recipient that may not be addressed; finite, so that 0 p stays 0


@compiled()
def sample(
    logits: Float[np.ndarray, "R N"], uniform: Float[np.ndarray, "R"]
) -> Int[np.ndarray, "R"]:
    """Return a recipient from each row's Boltzmann distribution, by its cumulated probabilities.

    `uniform` is one number in [0, 1) a row; the same number is the same decision.
    """
    num_rows, num_nodes = logits.shape
    chosen, weight = np.zeros(num_rows, dtype=np.int64), np.empty(num_nodes)
    for r in range(num_rows):
        highest = logits[r].max()
        total = 0.0
        for k in range(num_nodes):
            weight[k] = np.exp(logits[r, k] - highest)
            total += weight[k]
        left = uniform[r] * total
        for k in range(num_nodes):
            if weight[k] > 0.0:
                chosen[r] = k  # the last possible one, should rounding leave a rest
                left -= weight[k]
                if left < 0.0:
                    break
    return chosen
