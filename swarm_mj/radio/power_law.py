"""Mean powers from positions: transmit powers, path loss, shadowing, for compiled loops.

The paper's radio is free space everywhere. The other laws agree with it up to a breakpoint,
so a mission's transmit power means the same under each of them; beyond it, tenfold distance costs
10 n dB. Index order: `i` sends, `j` receives.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission.geometry import HEIGHT, PLANE, squared_distance
from swarm_mj.physics.state import ROBOT_HEIGHT_M, Antennas, Obstacles
from swarm_mj.radio.fading import Waves, follow_robots, shadow
from swarm_mj.radio.obstruction import obstruct
from swarm_mj.radio.reception import received_power
from swarm_mj.system.compiled import compiled

SPEED_OF_LIGHT_MPS = 299_792_458.0
FREE_SPACE_EXPONENT = 2.0
TWO_RAY_EXPONENT = 4.0
LEAST_ANTENNA_M = 0.1  # above the floor, which an antenna counts as at least


class PowerLaw(NamedTuple):
    """The law of mean powers without shadowing; free space by default."""

    # Power of each robot's packets after one metre, in any unit; its own antenna's gain included.
    at_1_m: Float[np.ndarray, "N"]
    breakpoint_m: float = math.inf  # up to which free space holds
    exponent: float = FREE_SPACE_EXPONENT  # n, beyond it
    obstacles: Obstacles | None = None
    antennas: Antennas | None = None  # None: where the robots are, and without gain
    is_by_height: bool = False  # whether both antennas' heights [m] multiply the breakpoint


class MeanPowers(NamedTuple):
    """The powers of every mission, each computed once for where its robots are.

    A team at rest needs each once in a mission, and robots that believe the same share them.
    """

    law: PowerLaw
    position_m: Float[np.ndarray, "B N D"]  # what the powers are for [m]; nan before the first
    is_done: Bool[np.ndarray, "B N"]  # whose powers are computed for that
    power: Float[np.ndarray, "B N N"]  # of i at j, in the law's unit; of others, anything


def no_powers(law: PowerLaw, num_missions: int, num_axes: int = PLANE) -> MeanPowers:
    """Return no powers so far, by this law."""
    shape = num_missions, len(law.at_1_m)
    return MeanPowers(
        law=law,
        position_m=np.full((*shape, num_axes), np.nan),
        is_done=np.zeros(shape, dtype=np.bool_),
        power=np.empty((*shape, shape[1])),
    )


def free_space_law(at_1_m: float, num_robots: int) -> PowerLaw:
    """Return the law of a team whose packets all have this power after one metre."""
    return PowerLaw(np.full(num_robots, at_1_m))


def two_ray_breakpoint_m(height_m: float, frequency_hz: float) -> float:
    """Return the crossover distance of two-ray ground reflection (Rappaport 2002, Eq. 4.52).

    Free space holds up to 4 pi h^2 / lambda, for antennas at height h. From there on the reflection
    from the ground nearly cancels the direct ray, and the loss is d^4 / h^4. For two heights, their
    product is in place of h^2.
    """
    return 4.0 * math.pi * height_m**2 / (SPEED_OF_LIGHT_MPS / frequency_hz)


@compiled()
def power_after(
    at_1_m: float, squared_distance_m2: float, breakpoint_m: float, exponent: float
) -> float:
    """Return the power over a distance, in the unit of that which free space leaves over 1 m."""
    power = received_power(at_1_m, squared_distance_m2)
    squared_breakpoint_m2 = breakpoint_m * breakpoint_m
    if squared_distance_m2 <= squared_breakpoint_m2:
        return power
    beyond = squared_breakpoint_m2 / squared_distance_m2
    return power * beyond ** (0.5 * exponent - 1.0)


@compiled()
def write_powers(
    i: int, position_m: Float[np.ndarray, "N D"], law: PowerLaw, power: Float[np.ndarray, "N"]
) -> None:
    """Fill `power`: the mean power of i's packets at every robot; nobody receives itself."""
    antenna_m = places_of(law.antennas, position_m)
    if law.is_by_height:
        for j in range(antenna_m.shape[0]):
            apart_m2 = squared_distance(antenna_m, i, j)
            breakpoint_m = breakpoint_between(antenna_m, i, j, law)
            power[j] = power_after(law.at_1_m[i], apart_m2, breakpoint_m, law.exponent)
    else:  # by itself, so that it is compiled to vectors
        for j in range(antenna_m.shape[0]):
            apart_m2 = squared_distance(antenna_m, i, j)
            power[j] = power_after(law.at_1_m[i], apart_m2, law.breakpoint_m, law.exponent)
    power[i] = 0.0
    _receive(law.antennas, power)
    obstruct(i, antenna_m, ROBOT_HEIGHT_M, law.obstacles, power)


@compiled()
def places_of(
    antennas: Antennas | None, position_m: Float[np.ndarray, "N D"]
) -> Float[np.ndarray, "N D"]:
    """Return where antennas are, above their robots [m]."""
    if antennas is None:  # then they are not even copied
        return position_m
    placed_m = position_m.copy()
    placed_m[:, HEIGHT] += antennas.height_m
    return placed_m


@compiled()
def breakpoint_between(antenna_m: Float[np.ndarray, "N D"], i: int, j: int, law: PowerLaw) -> float:
    """Return up to where free space holds between two antennas [m]."""
    if not law.is_by_height:
        return law.breakpoint_m
    first_m = max(antenna_m[i, HEIGHT], LEAST_ANTENNA_M)
    other_m = max(antenna_m[j, HEIGHT], LEAST_ANTENNA_M)
    return law.breakpoint_m * first_m * other_m


@compiled()
def _receive(antennas: Antennas | None, power: Float[np.ndarray, "N"]) -> None:
    """Multiply the power at every robot by the gain of its antenna."""
    if antennas is not None:
        power *= antennas.gain


@compiled()
def place_robots(
    powers: MeanPowers, b: int, position_m: Float[np.ndarray, "N D"], waves: Waves | None = None
) -> None:
    """Forget the powers of mission b if its robots are elsewhere now; None is no shadowing."""
    # Any one that moved makes all powers at it change, not only its own.
    if np.any(powers.position_m[b] != position_m):
        powers.position_m[b] = position_m
        powers.is_done[b] = False
        if waves is not None:  # without waves, code for shadowing is not even compiled
            follow_robots(waves, b, position_m)


@compiled()
def compute_powers(powers: MeanPowers, b: int, i: int, waves: Waves | None = None) -> None:
    """Make sure of the powers of i's packets in mission b, whose robots have been placed."""
    if not powers.is_done[b, i]:
        powers.is_done[b, i] = True
        write_powers(i, powers.position_m[b], powers.law, powers.power[b, i])
        if waves is not None:
            shadow(waves, b, i, powers.power[b, i])


@compiled()
def powers_between(position_m: Float[np.ndarray, "N D"], law: PowerLaw) -> Float[np.ndarray, "N N"]:
    """Return the mean power of every i at every j."""
    power = np.empty((position_m.shape[0], position_m.shape[0]))
    for i in range(power.shape[0]):
        write_powers(i, position_m, law, power[i])
    return power
