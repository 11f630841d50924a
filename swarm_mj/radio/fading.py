"""Randomness from slot to slot: fast fading of every link, and bursts in which packets are lost.

All of it follows from a mission's key, the slot, the sender and the receiver (`counters`). A fade
holds for a whole slot and is the same in both directions (block fading, reciprocal).
"""

import math

import numpy as np

from swarm_mj.radio.counters import keyed_normals, keyed_uniform, mixed
from swarm_mj.system.compiled import compiled

NO_LINE_OF_SIGHT = 0.0  # K of Rayleigh fading, linear
NO_FADING = math.inf  # K without scattered waves, linear


@compiled()
def fade(key: np.uint64, rician_k: float) -> float:
    """Return the power of a fade over its mean, linear [1].

    Args:
        key: Of the link in its slot.
        rician_k: Power of the line of sight over that of all scattered waves, linear (Rice 1948);
            0 is Rayleigh fading.
    """
    if rician_k == NO_LINE_OF_SIGHT:
        return -math.log(keyed_uniform(key))
    in_phase, quadrature = keyed_normals(key)
    spread = math.sqrt(0.5 / (rician_k + 1.0))
    real = math.sqrt(rician_k / (rician_k + 1.0)) + spread * in_phase
    imaginary = spread * quadrature
    return real * real + imaginary * imaginary


@compiled()
def is_in_burst(key: np.uint64, slot: int, begin: float, end: float) -> bool:
    """Return whether a receiver is in a burst (Gilbert 1960, Elliott 1963): it decodes nothing.

    A uniform number u decides each slot: below `begin` it is bad and above `1 - end` good, whatever
    it was before; between them it stays what it was. So one looks back until a number decides. A
    mission begins in the stationary distribution.

    Args:
        key: Of the receiver.
        slot: Counted from 0, the first of the mission.
        begin: Probability that a burst begins in a slot; above 1 - end it has no meaning.
        end: Probability that it ends.
    """
    for s in range(slot, 0, -1):
        u = keyed_uniform(mixed(key, np.uint64(s)))
        if u < begin:
            return True
        if u >= 1.0 - end:
            return False
    return keyed_uniform(mixed(key, np.uint64(0))) < begin / (begin + end)
