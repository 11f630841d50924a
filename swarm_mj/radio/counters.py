"""Random numbers by counter: a function of a key and of what is asked, not of the order of asking.

So a fade does not depend on the missions beside it, and a slot that is played again meets the same
fades. The hash is SplitMix64's finaliser (Steele, Lea, Flood 2014), applied once per number taken
in.
"""

import math

import numpy as np

from swarm_mj.system.compiled import compiled

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
