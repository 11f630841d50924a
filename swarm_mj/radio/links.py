"""What a scheduler believes about the radio between any two robots.

Index order: `i` sends, `j` receives.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.radio.free_space import MIN_DISTANCE_M, FreeSpaceRadio


class Links(NamedTuple):
    """The radio between robots whose positions are true, or only believed."""

    received_mw: Float[np.ndarray, "N N"]  # power of i at j; 0 where none is counted on [mW]
    distance_over_std: Float[np.ndarray, "N N"]  # of the belief; inf if the positions are known [1]
    noise_mw: float
    threshold: float  # least SINR that decodes, linear [1]


def links_between(
    radio: FreeSpaceRadio,
    position_m: Float[np.ndarray, "N 2"],
    spread_m: Float[np.ndarray, "N"] | None = None,
    is_known: Bool[np.ndarray, "N"] | None = None,
) -> Links:
    """The links between robots at believed positions.

    Args:
        radio: The mission's.
        position_m: Where the robots are believed to be [m].
        spread_m: Standard deviation of that belief; None: the positions are true [m].
        is_known: Who is believed to be anywhere; None: everyone. The others hear nothing and are
            not heard.

    Returns:
        The links.
    """
    apart_m = position_m[:, None] - position_m[None, :]
    distance_m = np.maximum(np.sqrt(np.sum(apart_m**2, axis=2)), MIN_DISTANCE_M)
    received_mw = radio.received_at_1_m_mw / distance_m**2
    np.fill_diagonal(received_mw, 0.0)
    if is_known is not None:
        received_mw *= is_known[:, None] & is_known[None, :]
    distance_over_std = np.full_like(distance_m, np.inf)
    if spread_m is not None:
        variance_m2 = spread_m[:, None] ** 2 + spread_m[None, :] ** 2
        np.divide(distance_m, np.sqrt(variance_m2), out=distance_over_std, where=variance_m2 > 0.0)
    return Links(received_mw, distance_over_std, radio.noise_mw, radio.threshold)
