"""Voronoi cells of robots in the square area, as convex polygons cut out of it one by one."""

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission.geometry import squared_distance
from swarm_mj.system.compiled import compiled


@compiled()
def cell(
    position_m: Float[np.ndarray, "N 2"],
    counts: Bool[np.ndarray, "N"],
    i: int,
    half_side_m: float,
) -> Float[np.ndarray, "corners 2"]:
    """Return the points of the area that are nearer to robot i than to any other.

    Args:
        position_m: Where the robots are [m].
        counts: Which others share out the area.
        i: Whose cell.
        half_side_m: The area reaches to plus or minus this per axis [m].

    Returns:
        The cell's corners, anticlockwise [m]; none if it is empty. Of robots at one point the first
        takes all.
    """
    polygon, cut = np.empty((len(counts) + 4, 2)), np.empty((len(counts) + 4, 2))
    num_corners = 4
    for corner in range(4):
        polygon[corner, 0] = half_side_m if corner in (1, 2) else -half_side_m
        polygon[corner, 1] = half_side_m if corner in (2, 3) else -half_side_m
    reach_m2 = _reach(polygon[:num_corners], position_m[i])
    for j in range(len(counts)):
        # Who is twice as far as the cell's farthest corner takes nothing of it.
        if j != i and counts[j] and squared_distance(position_m, i, j) <= 4.0 * reach_m2:
            num_corners = _nearer(polygon[:num_corners], position_m, i, j, cut)
            polygon, cut = cut, polygon
            reach_m2 = _reach(polygon[:num_corners], position_m[i])
    return polygon[:num_corners]


@compiled()
def _reach(polygon: Float[np.ndarray, "corners 2"], from_m: Float[np.ndarray, "2"]) -> float:
    """Return the squared distance to a polygon's farthest corner [m²]."""
    farthest = 0.0
    for x, y in polygon:
        farthest = max(farthest, (x - from_m[0]) ** 2 + (y - from_m[1]) ** 2)
    return farthest


@compiled()
def _nearer(
    polygon: Float[np.ndarray, "corners 2"],
    position_m: Float[np.ndarray, "N 2"],
    i: int,
    j: int,
    kept: Float[np.ndarray, "room 2"],
) -> int:
    """Fill `kept` with the part of a polygon that is nearer to i than to j; returns its corners.

    The clipping of Sutherland and Hodgman (1974), along the bisector.
    """
    across_x, across_y = position_m[j, 0] - position_m[i, 0], position_m[j, 1] - position_m[i, 1]
    if across_x == 0.0 and across_y == 0.0 and j < i:
        return 0
    middle_x = (position_m[i, 0] + position_m[j, 0]) / 2.0
    middle_y = (position_m[i, 1] + position_m[j, 1]) / 2.0
    num_kept = 0
    for corner in range(len(polygon)):
        x, y = polygon[corner - 1]
        next_x, next_y = polygon[corner]
        beyond = across_x * (x - middle_x) + across_y * (y - middle_y)
        next_beyond = across_x * (next_x - middle_x) + across_y * (next_y - middle_y)
        if beyond * next_beyond < 0.0:
            share = beyond / (beyond - next_beyond)
            kept[num_kept, 0] = x + share * (next_x - x)
            kept[num_kept, 1] = y + share * (next_y - y)
            num_kept += 1
        if next_beyond <= 0.0:
            kept[num_kept, 0], kept[num_kept, 1] = next_x, next_y
            num_kept += 1
    return num_kept


@compiled()
def moments(
    polygon: Float[np.ndarray, "corners 2"], about_m: Float[np.ndarray, "2"]
) -> tuple[float, float, float, float]:
    """A polygon's area [m²], first moments in x and y [m³] and polar moment [m⁴] about a point."""
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
