"""The value of news: what a receiver gains from a packet that it decodes.

Times are in slots, float32, as in `broadcast_scheduler`.
"""

import numpy as np
from jaxtyping import Float32

from swarm_mj.protocol.timestamps import rise
from swarm_mj.system.compiled import compiled


# Adding in any order lets the compiler use its vectors. Whole slots add up exactly; products to
# rounding, so robots that plan alike need machines alike.
@compiled(makes_arrays=False, fastmath={"reassoc", "nnan", "nsz"})
def value_of_news(
    newer: Float32[np.ndarray, "N"],
    older: Float32[np.ndarray, "N"],
    weight: Float32[np.ndarray, "N"],
) -> float:
    """Return what it is worth to raise T from one row to another, summed over subjects.

    A rise of T^{j,k} by r slots is worth r² times the weight of receiver j and subject k: so the
    oldest entries count most, and nobody is forgotten for the sake of many small gains.
    """
    total = np.float32(0.0)
    for k in range(older.shape[0]):
        total += _weighed(rise(newer[k], older[k]), weight[k])
    return float(total)


# Apart from `value_of_news`, whose permission to reorder sums would extend to this product.
@compiled(makes_arrays=False)
def _weighed(r: np.floating, weight: np.floating) -> np.floating:
    """Return a squared rise times its weight, multiplied in this order."""
    return r * (weight * r)
