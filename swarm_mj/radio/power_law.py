"""Mean powers from positions alone: path loss, transmit powers and obstacles, for compiled loops.

Index order: `i` sends, `j` receives.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from swarm_mj.mission.geometry import squared_distance
from swarm_mj.physics.state import ROBOT_HEIGHT_M, Obstacles
from swarm_mj.radio.obstruction import obstruct
from swarm_mj.radio.path_loss import FREE_SPACE, PathLoss, power_after
from swarm_mj.system.compiled import compiled

NO_OBSTACLES = Obstacles(
    kind=np.zeros(0, dtype=np.int64),
    centre_m=np.zeros((0, 3)),
    rotation=np.zeros((0, 3, 3)),
    size_m=np.zeros((0, 3)),
    reach_m=np.zeros(0),
    power_left=np.zeros(0),
)


class PowerLaw(NamedTuple):
    """What mean powers follow from, where no shadowing is known."""

    at_1_m: Float[np.ndarray, "N"]  # power of each robot's packets after one metre, in any unit
    breakpoint_m: float  # up to which free space holds
    exponent: float  # beyond it
    obstacles: Obstacles  # that are known of; perhaps none


def power_law(
    at_1_m: Float[np.ndarray, "N"],
    path_loss: PathLoss = FREE_SPACE,
    obstacles: Obstacles | None = None,
) -> PowerLaw:
    """Return the law of these parts; free space unless they are given."""
    known = NO_OBSTACLES if obstacles is None else obstacles
    return PowerLaw(at_1_m, path_loss.breakpoint_m, path_loss.exponent, known)


@compiled()
def write_powers(
    i: int, position_m: Float[np.ndarray, "N 2"], law: PowerLaw, power: Float[np.ndarray, "N"]
) -> None:
    """Fill `power`: the mean power of i's packets at every robot; nobody receives itself."""
    write_path_loss(i, position_m, law, power)
    obstruct(i, position_m, ROBOT_HEIGHT_M, law.obstacles, power)


@compiled()
def write_path_loss(
    i: int, position_m: Float[np.ndarray, "N 2"], law: PowerLaw, power: Float[np.ndarray, "N"]
) -> None:
    """Fill `power` as in an area where nothing stands."""
    for j in range(position_m.shape[0]):
        apart_m2 = squared_distance(position_m, i, j)
        power[j] = power_after(law.at_1_m[i], apart_m2, law.breakpoint_m, law.exponent)
    power[i] = 0.0


@compiled()
def powers_between(position_m: Float[np.ndarray, "N 2"], law: PowerLaw) -> Float[np.ndarray, "N N"]:
    """Return the mean power of every i at every j."""
    num_robots = position_m.shape[0]
    power = np.empty((num_robots, num_robots))
    for i in range(num_robots):
        write_powers(i, position_m, law, power[i])
    return power
