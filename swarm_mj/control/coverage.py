"""Coverage by Lloyd's algorithm on stale positions: not a task of the paper.

Every robot moves to the centroid of its Voronoi cell, with damping: u_i = k (C_i - p_i) - c v_i
(Cortés, Martínez, Karatas and Bullo, IEEE Transactions on Robotics and Automation 20(2), 2004;
uniform density). There is one difference: robot i computes its cell from its buffer, so cells of
different robots may overlap, or leave ground uncovered.
"""

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.control.controller import steer
from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.system.compiled import compiled


class Coverage:
    """Robots spread out, so that no point of the area is far from all of them."""

    cost_name, cost_unit = "distance to the nearest robot", "m"

    def __init__(self, mission: Mission) -> None:
        self._half_side_m = mission.half_side_m

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N 2"]:
        """Steer each robot to the centroid of the cell that it believes to be its own [m/s²]."""
        target_m = np.empty_like(states.position_m)
        _centroids(
            buffers.is_known, buffers.position_m, states.position_m, self._half_side_m, target_m
        )
        return steer(target_m, states)

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the root mean square distance of the area to its nearest active robot [m]."""
        position_m, is_active = states.position_m, states.is_active
        counts = np.ones(position_m.shape[:2], dtype=np.bool_) if is_active is None else is_active
        return np.sqrt(locational_cost(position_m, self._half_side_m, counts))


@compiled()
def locational_cost(
    position_m: Float[np.ndarray, "B N 2"], half_side_m: float, counts: Bool[np.ndarray, "B N"]
) -> Float[np.ndarray, "B"]:
    """Return the mean squared distance of the area to its nearest robot that counts [m²].

    It is the sum of the second moments of their Voronoi cells, over the area (Cortés et al.).
    """
    cost = np.zeros(len(position_m))
    for b in range(len(position_m)):
        for i in range(counts.shape[1]):
            if counts[b, i]:
                polygon = cell(position_m[b], counts[b], i, half_side_m)
                cost[b] += moments(polygon, position_m[b, i])[3]
    return cost / (2.0 * half_side_m) ** 2


@compiled()
def _centroids(
    is_known: Bool[np.ndarray, "B N N"],
    known_m: Float[np.ndarray, "B N N 2"],
    position_m: Float[np.ndarray, "B N 2"],
    half_side_m: float,
    target_m: Float[np.ndarray, "B N 2"],
) -> None:
    """Fill `target_m`; a robot whose cell is empty goes to the nearest point of the area."""
    for b in range(is_known.shape[0]):
        for i in range(is_known.shape[1]):
            team_m = known_m[b, i].copy()
            team_m[i] = position_m[b, i]
            own = moments(cell(team_m, is_known[b, i], i, half_side_m), team_m[i])
            for axis in range(2):
                target = team_m[i, axis] + (own[1 + axis] / own[0] if own[0] > 0.0 else 0.0)
                target_m[b, i, axis] = min(max(target, -half_side_m), half_side_m)


@compiled()
def cell(
    position_m: Float[np.ndarray, "N 2"], counts: Bool[np.ndarray, "N"], i: int, half_side_m: float
) -> Float[np.ndarray, "corners 2"]:
    """Return the corners of robot i's Voronoi cell in the area, anticlockwise [m].

    The other robots that count each cut a part off the area. Of robots at one point, the first has
    the whole cell and the others an empty one.
    """
    h = half_side_m
    polygon = np.array([[-h, -h], [h, -h], [h, h], [-h, h]])
    for j in range(len(counts)):
        if j != i and counts[j]:
            farthest_m2, offset_m = 0.0, position_m[j] - position_m[i]
            for corner in polygon:
                to_m = corner - position_m[i]
                farthest_m2 = max(farthest_m2, to_m[0] ** 2 + to_m[1] ** 2)
            # A robot twice as far as the cell's farthest corner cuts nothing off.
            if offset_m[0] ** 2 + offset_m[1] ** 2 <= 4.0 * farthest_m2:
                polygon = _nearer(polygon, position_m, i, j)
    return polygon


@compiled()
def _nearer(
    polygon: Float[np.ndarray, "corners 2"], position_m: Float[np.ndarray, "N 2"], i: int, j: int
) -> Float[np.ndarray, "corners 2"]:
    """Clip a polygon along the bisector of i and j (Sutherland and Hodgman 1974)."""
    across_x, across_y = position_m[j, 0] - position_m[i, 0], position_m[j, 1] - position_m[i, 1]
    if across_x == 0.0 and across_y == 0.0 and j < i:
        return polygon[:0]
    middle_x = (position_m[i, 0] + position_m[j, 0]) / 2.0
    middle_y = (position_m[i, 1] + position_m[j, 1]) / 2.0
    kept, num_kept = np.empty((len(polygon) + 1, 2)), 0
    for corner in range(len(polygon)):
        x, y = polygon[corner - 1]
        next_x, next_y = polygon[corner]
        beyond = across_x * (x - middle_x) + across_y * (y - middle_y)
        next_beyond = across_x * (next_x - middle_x) + across_y * (next_y - middle_y)
        if beyond * next_beyond < 0.0:
            share = beyond / (beyond - next_beyond)
            kept[num_kept] = x + share * (next_x - x), y + share * (next_y - y)
            num_kept += 1
        if next_beyond <= 0.0:
            kept[num_kept] = next_x, next_y
            num_kept += 1
    return kept[:num_kept]


@compiled()
def moments(
    polygon: Float[np.ndarray, "corners 2"], about_m: Float[np.ndarray, "2"]
) -> tuple[float, float, float, float]:
    """Return area [m²], first moments in x and y [m³] and polar moment [m⁴] about a point."""
    area, first_x, first_y, second = 0.0, 0.0, 0.0, 0.0
    for corner in range(len(polygon)):
        x, y = polygon[corner - 1, 0] - about_m[0], polygon[corner - 1, 1] - about_m[1]
        next_x, next_y = polygon[corner, 0] - about_m[0], polygon[corner, 1] - about_m[1]
        twice = x * next_y - next_x * y
        area += twice / 2.0
        first_x += twice * (x + next_x) / 6.0
        first_y += twice * (y + next_y) / 6.0
        squares = x * x + x * next_x + next_x * next_x + y * y + y * next_y + next_y * next_y
        second += twice * squares / 12.0
    return area, first_x, first_y, second
