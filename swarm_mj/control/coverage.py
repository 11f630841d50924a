"""Coverage by Lloyd's algorithm on stale positions: a task of ours, not the paper's.

Every robot moves to the centroid of its Voronoi cell of the area (Cortés, Martínez, Karatas and
Bullo, Coverage control for mobile sensing networks, IEEE Transactions on Robotics and Automation
20(2), 2004; uniform density), with damping, as robots here have mass:

    u_i = k (C_i - p_i) - c v_i

There is one difference: the cell is computed from where robot i last heard that its teammates were,
so cells of different robots may overlap, or leave ground to nobody.
"""

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.control.controller import steer
from swarm_mj.control.voronoi import cell, moments
from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import NEVER, Buffers
from swarm_mj.system.compiled import compiled


class Coverage:
    """Robots spread out, so that no point of the area is far from all of them."""

    cost_name = "distance to the nearest robot"
    cost_unit = "m"

    def __init__(self, mission: Mission) -> None:
        """Take the mission whose area is to be covered."""
        self._half_side_m = mission.half_side_m

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N 2"]:
        """Towards the centroid of the cell that each robot believes to be its own [m/s²]."""
        target_m = np.empty_like(states.position_m)
        _centroids(
            buffers.timestamp, buffers.position_m, states.position_m, self._half_side_m, target_m
        )
        return steer(target_m, states)

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """How far the area's points are from the nearest active robot (root mean square) [m]."""
        return np.sqrt(locational_cost(states.position_m, self._half_side_m, states.is_active))


@compiled()
def locational_cost(
    position_m: Float[np.ndarray, "B N 2"],
    half_side_m: float,
    is_active: Bool[np.ndarray, "B N"] | None = None,
) -> Float[np.ndarray, "B"]:
    """Mean over the area's points of the squared distance to the nearest robot [m²].

    The locational cost of Cortés et al. at uniform density, over the area: the sum of the second
    moments of the robots' Voronoi cells.

    Args:
        position_m: Where the robots are [m].
        half_side_m: The area reaches to plus or minus this per axis [m].
        is_active: Who covers; None is everyone.

    Returns:
        The cost, per mission.
    """
    num_missions, num_robots = position_m.shape[:2]
    cost = np.zeros(num_missions)
    counts = np.ones(num_robots, dtype=np.bool_)
    for b in range(num_missions):
        if is_active is not None:
            counts[:] = is_active[b]
        for i in range(num_robots):
            if counts[i]:
                own_m = position_m[b, i]
                cost[b] += moments(cell(position_m[b], counts, i, half_side_m), own_m)[3]
    return cost / (2.0 * half_side_m) ** 2


@compiled()
def _centroids(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N 2"],
    position_m: Float[np.ndarray, "B N 2"],
    half_side_m: float,
    target_m: Float[np.ndarray, "B N 2"],
) -> None:
    """Fill `target_m`; whose cell has no ground goes to the nearest point of the area."""
    num_missions, num_robots = timestamp.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            team_m = believed_m[b, i].copy()
            team_m[i] = position_m[b, i]
            is_known = timestamp[b, i] > NEVER
            own = moments(cell(team_m, is_known, i, half_side_m), team_m[i])
            for axis in range(2):
                target = (
                    team_m[i, axis] + own[1 + axis] / own[0] if own[0] > 0.0 else team_m[i, axis]
                )
                target_m[b, i, axis] = min(max(target, -half_side_m), half_side_m)
