"""Random channels: fast fading, bursts of losses, and log-normal shadowing.

Fades and bursts are drawn by counter: each number is a function of a mission's key, the slot, the
sender and the receiver, not of the order of asking. So a fade does not depend on the missions in
the same batch, and a slot that is played again meets the same fades. The hash is SplitMix64's
finaliser (Steele, Lea, Flood 2014), applied once per number taken in. A fade holds for a whole slot
and is the same in both directions (block fading, reciprocal).

Shadowing of links whose two ends both move is correlated in space: Wang, Tameh, Nix: Joint
shadowing process in urban peer-to-peer radio channels, IEEE Transactions on Vehicular Technology 57
(2008). It is a sum of sinusoids of the four coordinates of a link's ends. When one end moves by d,
its correlation falls as exp(-d / d_corr) (Gudmundson 1991), and independently so for the other end.
Both orders of the ends are added, which makes links the same in both directions.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32

from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import DB_PER_NEPER

NO_LINE_OF_SIGHT = 0.0  # K of Rayleigh fading, linear
NO_FADING = math.inf  # K without scattered waves, linear

# All unsigned: of a signed and an unsigned integer numba makes a float.
_WEYL = np.uint64(0x9E3779B97F4A7C15)  # SplitMix64's increment: 2^64 over the golden ratio
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_SHIFT_27 = np.uint64(27)
_SHIFT_30 = np.uint64(30)
_SHIFT_31 = np.uint64(31)
_SPARE_BITS = np.uint64(11)  # of 64, beyond those of a float's mantissa
_UNIT = 2.0**-53  # the last of these
NUM_WAVES = 64
STEPS_PER_CORRELATION = 10.0  # places within that share of d_corr count as one

# A robot's cosine and sine in a wave, as the first end of a link and as the other.
FIRST_COS, FIRST_SIN, OTHER_COS, OTHER_SIN = range(4)
NUM_ENDS = 4


@compiled()
def mixed(key: np.uint64, number: np.uint64) -> np.uint64:
    """Return a key that also depends on a number."""
    z = (key ^ number) + _WEYL
    z = (z ^ (z >> _SHIFT_30)) * _MIX_1
    z = (z ^ (z >> _SHIFT_27)) * _MIX_2
    return z ^ (z >> _SHIFT_31)


@compiled()
def keyed_uniform(key: np.uint64) -> float:
    """Return a uniform number in (0, 1), the same for the same key."""
    return (float(key >> _SPARE_BITS) + 0.5) * _UNIT


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


class Waves(NamedTuple):
    """The sinusoids of every mission, and their values where its robots are."""

    first_end: Float[np.ndarray, "B W 2"]  # angular wave numbers [rad/m]
    other_end: Float[np.ndarray, "B W 2"]  # [rad/m]
    phase: Float[np.ndarray, "B W"]  # counted to the other end [rad]
    place: Float[np.ndarray, "B N 2"]  # of each robot on the map, in steps; nan before it has one
    ends: Float32[np.ndarray, "B N E W"]  # of what each robot is to a wave: `FIRST_COS` and so on
    step_m: float  # places are rounded to multiples of this
    std_db: float


def draw_waves(
    std_db: float, correlation_m: float, num_robots: int, rngs: Sequence[np.random.Generator]
) -> Waves:
    """Draw every mission's own shadowing, from one generator each.

    Losses have a standard deviation of `std_db`, and `correlation_m` is d_corr. The spectrum of
    exp(-d / d_corr) in the plane has wave numbers k with the distribution
    1 - 1 / sqrt(1 + (k d_corr)^2), in all directions alike.
    """

    def wave_numbers(rng: np.random.Generator) -> Float[np.ndarray, "W 2"]:
        uniform = rng.random(NUM_WAVES)
        angle = rng.uniform(0.0, 2.0 * np.pi, NUM_WAVES)
        number = np.sqrt(1.0 / (1.0 - uniform) ** 2 - 1.0) / correlation_m
        return number[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    first_end: list[np.ndarray] = []
    other_end: list[np.ndarray] = []
    phase: list[np.ndarray] = []
    for rng in rngs:
        first_end.append(wave_numbers(rng))
        other_end.append(wave_numbers(rng))
        phase.append(rng.uniform(0.0, 2.0 * np.pi, NUM_WAVES))
    return Waves(
        first_end=np.stack(first_end),
        other_end=np.stack(other_end),
        phase=np.stack(phase),
        place=np.full((len(rngs), num_robots, 2), np.nan),
        ends=np.empty((len(rngs), num_robots, NUM_ENDS, NUM_WAVES), dtype=np.float32),
        step_m=correlation_m / STEPS_PER_CORRELATION,
        std_db=std_db,
    )


@compiled()
def follow_robots(waves: Waves, b: int, position_m: Float[np.ndarray, "N D"]) -> None:
    """Bring mission b's waves to where its robots are; cosines, which cost most, once a place."""
    first_end = waves.first_end[b]
    other_end = waves.other_end[b]
    phase = waves.phase[b]
    for i in range(position_m.shape[0]):
        x = np.floor(position_m[i, 0] / waves.step_m + 0.5)
        y = np.floor(position_m[i, 1] / waves.step_m + 0.5)
        if x != waves.place[b, i, 0] or y != waves.place[b, i, 1]:
            waves.place[b, i, 0] = x
            waves.place[b, i, 1] = y
            x_m = x * waves.step_m
            y_m = y * waves.step_m
            ends = waves.ends[b, i]
            for w in range(phase.shape[0]):
                first = first_end[w, 0] * x_m + first_end[w, 1] * y_m
                other = other_end[w, 0] * x_m + other_end[w, 1] * y_m + phase[w]
                ends[FIRST_COS, w] = math.cos(first)
                ends[FIRST_SIN, w] = math.sin(first)
                ends[OTHER_COS, w] = math.cos(other)
                ends[OTHER_SIN, w] = math.sin(other)


@compiled()
def shadow(waves: Waves, b: int, i: int, power: Float[np.ndarray, "N"]) -> None:
    """Multiply the power of i's packets at every robot of mission b by what shadowing leaves."""
    for j in range(power.shape[0]):
        power[j] *= np.exp(_neper(waves.ends[b, i], waves.ends[b, j], waves.std_db))


# Adding in any order lets the compiler use its vectors; shadowing is random in the last digit, too.
@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _neper(a: Float32[np.ndarray, "E W"], b: Float32[np.ndarray, "E W"], std_db: float) -> float:
    """Return the loss between two ends as an exponent of e of the power [1]; its sign is either."""
    total = np.float32(0.0)
    for w in range(a.shape[1]):
        # cos(first of a + other of b) + cos(first of b + other of a), by their addition theorem
        total += (
            a[FIRST_COS, w] * b[OTHER_COS, w]
            - a[FIRST_SIN, w] * b[OTHER_SIN, w]
            + b[FIRST_COS, w] * a[OTHER_COS, w]
            - b[FIRST_SIN, w] * a[OTHER_SIN, w]
        )
    return float(total) * std_db / math.sqrt(a.shape[1]) / DB_PER_NEPER
