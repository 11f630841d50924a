"""The radio's arithmetic (II-A) for one packet at one receiver, which all other code calls."""

import math

import numpy as np

from swarm_mj.system.compiled import compiled

MIN_DISTANCE_M = 1e-3  # robots closer than this count as this far apart, which keeps gains finite
LOGISTIC = 1.702  # 1 / (1 + exp(-1.702 z)) is within 0.01 of the normal distribution function
CERTAIN = 2.5  # standard deviations beyond which a packet decodes for certain, or never


@compiled()
def received_power(at_1_m: float, squared_distance_m2: float) -> float:
    """Power that free space leaves over a distance, in the unit of that over 1 m (Eqs. 1-2)."""
    return at_1_m / max(squared_distance_m2, MIN_DISTANCE_M * MIN_DISTANCE_M)


@compiled()
def sinr(signal_mw: float, interference_mw: float, noise_mw: float) -> float:
    """Signal over interference plus noise, linear [1] (Eq. 3)."""
    return signal_mw / (noise_mw + interference_mw)


@compiled()
def is_received(signal_to_noise: float, threshold: float) -> bool:
    """Whether a packet decodes; both ratios linear [1] (Eq. 4)."""
    return signal_to_noise >= threshold


@compiled()
def decode_probability(signal_to_noise: float, threshold: float, distance_over_std: float) -> float:
    """How probably a packet decodes whose distance is only believed (Eqs. 3-4).

    A lone packet decodes up to some distance; interference shortens it to d sqrt(SINR /
    threshold), so a packet over a believed d comes through if the true distance is below that.

    Args:
        signal_to_noise: SINR over the believed distance, linear [1].
        threshold: Least SINR that decodes, linear [1].
        distance_over_std: The believed distance over its standard deviation; inf is certain.

    Returns:
        The probability, by a logistic approximation of the normal distribution.
    """
    if distance_over_std == np.inf:
        return 1.0 if is_received(signal_to_noise, threshold) else 0.0
    deviations = (math.sqrt(signal_to_noise / threshold) - 1.0) * distance_over_std
    if abs(deviations) > CERTAIN:
        return 1.0 if deviations > 0.0 else 0.0
    return 1.0 / (1.0 + math.exp(-LOGISTIC * deviations))
