"""Log-normal shadowing of links whose two ends both move, correlated in space.

Source: Wang, Tameh, Nix: Joint shadowing process in urban peer-to-peer radio channels, IEEE
Transactions on Vehicular Technology 57 (2008). The shadowing is a sum of sinusoids of the four
coordinates of a link's ends. When one end moves by d, its correlation falls as exp(-d / d_corr)
(Gudmundson 1991), and independently so for the other end. Both orders of the ends are added, which
makes links the same in both directions.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32

from swarm_mj.system.compiled import compiled

NUM_WAVES = 64
STEPS_PER_CORRELATION = 10.0  # places within that share of d_corr count as one
DB_PER_NEPER = 10.0 / math.log(10.0)


@dataclass(frozen=True, kw_only=True)
class Shadowing:
    """How much and how quickly the loss of a link varies with where its ends are."""

    std_db: float
    correlation_m: float  # d_corr [m]


class Waves(NamedTuple):
    """The sinusoids of every mission; `cos` and `sin` at the ends [b, i], of both ends' waves."""

    first_end: Float[np.ndarray, "B W 2"]  # angular wave numbers [rad/m]
    other_end: Float[np.ndarray, "B W 2"]  # [rad/m]
    phase: Float[np.ndarray, "B W"]  # [rad]


def draw_waves(shadowing: Shadowing, rngs: Sequence[np.random.Generator]) -> Waves:
    """Every mission's own shadowing.

    The spectrum of exp(-d / d_corr) in the plane has wave numbers k with the distribution
    1 - 1 / sqrt(1 + (k d_corr)^2), in all directions alike.

    Args:
        shadowing: Its correlation distance.
        rngs: One generator per mission.

    Returns:
        The waves.
    """

    def wave_numbers(rng: np.random.Generator) -> Float[np.ndarray, "W 2"]:
        uniform, angle = rng.random(NUM_WAVES), rng.uniform(0.0, 2.0 * np.pi, NUM_WAVES)
        number = np.sqrt(1.0 / (1.0 - uniform) ** 2 - 1.0) / shadowing.correlation_m
        return number[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)

    drawn = [
        (wave_numbers(rng), wave_numbers(rng), rng.uniform(0.0, 2.0 * np.pi, NUM_WAVES))
        for rng in rngs
    ]
    return Waves(*(np.stack(each) for each in zip(*drawn, strict=True)))


@compiled()
def set_ends(
    position_m: Float[np.ndarray, "2"],
    step_m: float,
    first_end: Float[np.ndarray, "W 2"],
    other_end: Float[np.ndarray, "W 2"],
    phase: Float[np.ndarray, "W"],
    ends: Float32[np.ndarray, "4 W"],
) -> None:
    """Fill `ends` with the cosines and sines of the waves where a robot is.

    Args:
        position_m: Where it is [m].
        step_m: Places are rounded to multiples of this [m].
        first_end: Wave numbers of the first end [rad/m].
        other_end: Wave numbers of the other end [rad/m].
        phase: Counted to the other end [rad].
        ends: Cosine and sine at the first end, cosine and sine at the other.
    """
    x = math.floor(position_m[0] / step_m + 0.5) * step_m
    y = math.floor(position_m[1] / step_m + 0.5) * step_m
    for w in range(phase.shape[0]):
        first = first_end[w, 0] * x + first_end[w, 1] * y
        other = other_end[w, 0] * x + other_end[w, 1] * y + phase[w]
        ends[0, w], ends[1, w] = math.cos(first), math.sin(first)
        ends[2, w], ends[3, w] = math.cos(other), math.sin(other)


@compiled(fastmath={"reassoc", "nnan", "nsz"})
def shadowing_neper(
    a: Float32[np.ndarray, "4 W"], b: Float32[np.ndarray, "4 W"], std_db: float
) -> float:
    """Return the loss between two ends as an exponent of e of the power [1]; its sign is either."""
    total = np.float32(0.0)
    for w in range(a.shape[1]):
        total += a[0, w] * b[2, w] - a[1, w] * b[3, w] + b[0, w] * a[2, w] - b[1, w] * a[3, w]
    return float(total) * std_db / math.sqrt(a.shape[1]) / DB_PER_NEPER
