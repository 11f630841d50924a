"""Formation by displacement consensus on stale positions: not a task of the paper.

The displacement-based control of double integrators (Oh, Park and Ahn, Automatica 53, 2015), with
damping: u_i = k (mean over j of (p_j + d_i - d_j) - p_i) - c v_i. There is one difference: p_j is
M^{i,j}, and the mean is over the teammates that robot i has heard of. As c² >= 2k, no delay makes
the robots oscillate ever wider; stale information makes them aim at where teammates were.
"""

import math

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.control.controller import steer
from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.system.compiled import compiled

BLOCK_SHARE = 0.5  # width of the formation over the side of the area


class Formation:
    """Robots line up in the rows of a square block, in the order of their identities."""

    cost_name, cost_unit = "formation error", "m"

    def __init__(self, mission: Mission) -> None:
        self._place_m = block(mission.num_robots, BLOCK_SHARE * mission.side_m)

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N 2"]:
        """Steer each robot to the mean of its places relative to known teammates [m/s²]."""
        target_m = states.position_m.copy()
        _mean_places(buffers.is_known, buffers.position_m, self._place_m, target_m)
        return steer(target_m, states)

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the root mean square distance of the active robots from their places [m].

        The formation may stand anywhere, but not turned: the places are those of the best fit.
        """
        off_m = states.position_m - self._place_m
        if states.is_active is not None:
            off_m = off_m[states.is_active].reshape(len(off_m), -1, 2)
        off_m = off_m - np.mean(off_m, axis=1, keepdims=True)
        return np.sqrt(np.mean(np.sum(off_m**2, axis=2), axis=1))


def block(num_robots: int, width_m: float) -> Float[np.ndarray, "N 2"]:
    """Return places in the rows of a square block around the origin [m]; the last may be short."""
    num_columns = math.ceil(math.sqrt(num_robots))
    row, column = np.divmod(np.arange(num_robots), num_columns)
    place_m = np.stack([column, -row], axis=1) * (width_m / (num_columns - 1))
    return place_m - np.mean(place_m, axis=0)


@compiled()
def _mean_places(
    is_known: Bool[np.ndarray, "B N N"],
    known_m: Float[np.ndarray, "B N N 2"],
    place_m: Float[np.ndarray, "N 2"],
    target_m: Float[np.ndarray, "B N 2"],
) -> None:
    """Write the targets of robots that know teammates."""
    num_missions, num_robots = is_known.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            for axis in range(2):
                total, num_known = 0.0, 0
                for j in range(num_robots):
                    if j != i and is_known[b, i, j]:
                        total += known_m[b, i, j, axis] + place_m[i, axis] - place_m[j, axis]
                        num_known += 1
                if num_known:
                    target_m[b, i, axis] = total / num_known
