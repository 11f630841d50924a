"""Randomness from slot to slot: fast fading of every link, erasures, and bursts of losses.

Numbers are drawn by counter: each is a function of a mission's key, the slot, the sender and the
receiver, not of the order of asking. So a fade does not depend on the missions in the same batch,
and a slot that is played again meets the same fades. The hash is SplitMix64's finaliser (Steele,
Lea, Flood 2014), applied once per number taken in. A fade holds for a whole slot and is the same in
both directions (block fading, reciprocal).
"""

import math

import numpy as np

from swarm_mj.system.compiled import compiled

NO_LINE_OF_SIGHT = 0.0  # K of Rayleigh fading, linear
NO_FADING = math.inf  # K without scattered waves, linear

_WEYL = np.uint64(0x9E3779B97F4A7C15)  # SplitMix64's increment: 2^64 over the golden ratio
_MIX_1, _MIX_2 = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_S27, _S30, _S31, _S11 = np.uint64(27), np.uint64(30), np.uint64(31), np.uint64(11)
_UNIT = 2.0**-53


@compiled()
def mixed(key: np.uint64, number: np.uint64) -> np.uint64:
    """Return a key that also depends on a number."""
    z = (key ^ number) + _WEYL
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@compiled()
def keyed_uniform(key: np.uint64) -> float:
    """Return a uniform number in (0, 1), the same for the same key."""
    return (float(key >> _S11) + 0.5) * _UNIT


@compiled()
def link_key(key: np.uint64, i: int, j: int) -> np.uint64:
    """Return a key of the link between two robots, the same in both directions."""
    low, high = (i, j) if i < j else (j, i)
    return mixed(mixed(key, np.uint64(low)), np.uint64(high))


@compiled()
def keyed_normals(key: np.uint64) -> tuple[float, float]:
    """Two independent standard normal numbers (Box and Muller 1958)."""
    radius = math.sqrt(-2.0 * math.log(keyed_uniform(key)))
    angle = 2.0 * math.pi * keyed_uniform(mixed(key, np.uint64(1)))
    return radius * math.cos(angle), radius * math.sin(angle)


@compiled()
def fade(key: np.uint64, rician_k: float) -> float:
    """Return the power of a fade over its mean, linear [1], by the key of a link in its slot.

    K is the power of the line of sight over that of all scattered waves, linear (Rice 1948); 0 is
    Rayleigh fading.
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
    mission begins, in slot 0, in the stationary distribution.
    """
    for s in range(slot, 0, -1):
        u = keyed_uniform(mixed(key, np.uint64(s)))
        if u < begin:
            return True
        if u >= 1.0 - end:
            return False
    return keyed_uniform(mixed(key, np.uint64(0))) < begin / (begin + end)
