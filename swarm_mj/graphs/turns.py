"""Whose turn it is nearby: a common order of identities and the clock, thinned by distance.

In window t robot `k` has rank `(k - t) mod N`, so every robot leads once in N windows. By rank,
robots join a set in which no two are closer than a radius (a maximal independent set). Robots that
believe the same positions find the same sets, without a word.
"""

from typing import no_type_check

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit


@njit(cache=True)
@no_type_check
def write_turns(
    believed_m: Float[np.ndarray, "N 2"],
    is_known: Bool[np.ndarray, "N"],
    now: int,
    radius_m: Float[np.ndarray, "radii"],
    taken: Int[np.ndarray, "N"],
    has_turn: Float[np.ndarray, "N radii"],
) -> None:
    """Writes which of the robots that one robot knows have a turn, for every radius.

    Args:
        believed_m: Where it believes them to be [m].
        is_known: Whom it knows.
        now: t, whole [windows].
        radius_m: Least distances of robots that have a turn at once [m].
        taken: Room for identities; overwritten.
        has_turn: 1 where robot k has a turn at a radius, else 0; overwritten.
    """
    num_robots = is_known.shape[0]
    has_turn[...] = 0.0
    for n in range(radius_m.shape[0]):
        num_taken = 0
        least_m2 = radius_m[n] * radius_m[n]
        for rank in range(num_robots):
            k = (now + rank) % num_robots
            if is_known[k]:
                is_free = True
                for m in range(num_taken):
                    dx = believed_m[k, 0] - believed_m[taken[m], 0]
                    dy = believed_m[k, 1] - believed_m[taken[m], 1]
                    if dx * dx + dy * dy < least_m2:
                        is_free = False
                        break
                if is_free:
                    taken[num_taken] = k
                    num_taken += 1
                    has_turn[k, n] = 1.0
