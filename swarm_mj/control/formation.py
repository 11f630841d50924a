"""Formation by displacement consensus on stale positions: a task of ours, not the paper's.

The law is displacement-based formation control of double integrators (Oh, Park and Ahn, A survey of
multi-agent formation control, Automatica 53, 2015), with damping:

    u_i = k (mean over j of (p_j + d_i - d_j) - p_i) - c v_i

There is one difference: p_j is M^{i,j}, where robot i last heard that robot j was, and the mean is
over the teammates that it has heard of. As c² >= 2k, no delay makes the robots swing ever wider;
old news makes them aim at where teammates were.
"""

import math

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.control.controller import steer
from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import NEVER, Buffers
from swarm_mj.system.compiled import compiled

BLOCK_SHARE = 0.5  # of the area's side: so wide is the formation


class Formation:
    """Robots line up in the rows of a square block, in the order of their identities."""

    cost_name = "formation error"
    cost_unit = "m"

    def __init__(self, mission: Mission) -> None:
        """Take the mission whose team and area size the formation."""
        self._place_m = block(mission.num_robots, BLOCK_SHARE * mission.side_m)

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N 2"]:
        """Towards the mean of where each robot should be, by what it knows of teammates [m/s²]."""
        target_m = np.empty_like(states.position_m)
        _mean_places(
            buffers.timestamp, buffers.position_m, states.position_m, self._place_m, target_m
        )
        return steer(target_m, states)

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """How far the active robots are from their places, as in `formation_error` [m]."""
        return formation_error(states.position_m, self._place_m, states.is_active)


def block(num_robots: int, width_m: float) -> Float[np.ndarray, "N 2"]:
    """Places in the rows of a square block, about their mean [m]; the last row may be shorter."""
    num_columns = math.ceil(math.sqrt(num_robots))
    row, column = np.divmod(np.arange(num_robots), num_columns)
    place_m = np.stack([column, -row], axis=1) * (width_m / (num_columns - 1))
    return place_m - np.mean(place_m, axis=0)


def formation_error(
    position_m: Float[np.ndarray, "B N 2"],
    place_m: Float[np.ndarray, "N 2"],
    is_active: Bool[np.ndarray, "B N"] | None = None,
) -> Float[np.ndarray, "B"]:
    """Root mean square distance to the places of the formation that fits best [m].

    A formation may stand anywhere, but not turned; it fits best where the mean of the differences
    is 0.

    Args:
        position_m: Where the robots are [m].
        place_m: Their places in the formation [m].
        is_active: Whose errors count, as many in every mission; None is everyone's.

    Returns:
        The error, per mission.
    """
    off_m = position_m - place_m
    if is_active is not None:
        off_m = off_m[is_active].reshape(len(off_m), -1, 2)
    off_m = off_m - np.mean(off_m, axis=1, keepdims=True)
    return np.sqrt(np.mean(np.sum(off_m**2, axis=2), axis=1))


@compiled()
def _mean_places(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N 2"],
    position_m: Float[np.ndarray, "B N 2"],
    place_m: Float[np.ndarray, "N 2"],
    target_m: Float[np.ndarray, "B N 2"],
) -> None:
    """Fill `target_m`; who knows nobody stays where it is."""
    num_missions, num_robots = timestamp.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            for axis in range(2):
                total = 0.0
                num_known = 0
                for j in range(num_robots):
                    if j != i and timestamp[b, i, j] > NEVER:
                        total += believed_m[b, i, j, axis] + place_m[i, axis] - place_m[j, axis]
                        num_known += 1
                target_m[b, i, axis] = total / num_known if num_known else position_m[b, i, axis]
