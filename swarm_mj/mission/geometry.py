"""Teams in space: who is connected to whom, and the shortest tree that connects everyone.

Positions have D axes: two in the plane, or three.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.system.compiled import compiled

ROOT = -1  # the parent of the root
PLANE = 2  # axes of a team whose robots are all at one height
SPACE = 3  # axes of a team whose robots have a height
HEIGHT = 2  # the axis of heights


@compiled()
def squared_distance(position_m: Float[np.ndarray, "N D"], i: int, j: int) -> float:
    """Return the square of the distance of two robots [m²]."""
    dx = position_m[i, 0] - position_m[j, 0]
    dy = position_m[i, 1] - position_m[j, 1]
    squared_m2 = dx * dx + dy * dy
    if position_m.shape[1] > PLANE:
        dz = position_m[i, HEIGHT] - position_m[j, HEIGHT]
        squared_m2 += dz * dz
    return squared_m2


@compiled()
def gather_connected(
    position_m: Float[np.ndarray, "N D"],
    range_m: float,
    first: int,
    is_met: Bool[np.ndarray, "N"],
    members: Int[np.ndarray, "N"],
) -> int:
    """Flood the disk graph from one robot; return how many are reached, the first one included.

    Two robots at most `range_m` apart are neighbours. Those reached fill `members`, and are added
    to `is_met`, whose robots need not be reached.
    """
    members[0] = first
    is_met[first] = True
    num_members = 1
    num_spread = 0  # of the members, those whose neighbours have joined them
    while num_spread < num_members:
        i = members[num_spread]
        num_spread += 1
        for j in range(position_m.shape[0]):
            if not is_met[j] and squared_distance(position_m, i, j) <= range_m * range_m:
                is_met[j] = True
                members[num_members] = j
                num_members += 1
    return num_members


@compiled()
def count_strayed(
    position_m: Float[np.ndarray, "B N D"],
    range_m: float,
    is_active: Bool[np.ndarray, "B N"] | None,
) -> Float[np.ndarray, "B"]:
    """Return how many active robots of each mission have no other active one within `range_m`.

    None for `is_active` is all robots.
    """
    num_missions, num_robots = position_m.shape[:2]
    strayed = np.zeros(num_missions)
    for b in range(num_missions):
        for i in range(num_robots):
            if is_active is not None and not is_active[b, i]:
                continue
            has_neighbour = False
            for j in range(num_robots):
                counts = is_active is None or is_active[b, j]
                if counts and j != i:
                    apart_m2 = squared_distance(position_m[b], i, j)
                    has_neighbour |= apart_m2 <= range_m * range_m
            strayed[b] += not has_neighbour
    return strayed


@compiled()
def spanning_tree(position_m: Float[np.ndarray, "B N D"]) -> Int[np.ndarray, "B N"]:
    """Return each robot's parent in the Euclidean minimum spanning tree, or `ROOT`."""
    num_missions, num_robots = position_m.shape[:2]
    parent = np.empty((num_missions, num_robots), dtype=np.int64)
    for b in range(num_missions):
        is_edge = np.zeros((num_robots, num_robots), dtype=np.bool_)
        _grow(position_m[b], is_edge)
        _peel(is_edge, parent[b])
    return parent


@compiled()
def _grow(position_m: Float[np.ndarray, "N D"], is_edge: Bool[np.ndarray, "N N"]) -> None:
    """Mark the tree's edges: Prim's algorithm from robot 0."""
    num_robots = position_m.shape[0]
    nearest = np.zeros(num_robots, dtype=np.int64)  # in the tree, of each robot outside it
    squared_m2 = np.full(num_robots, np.inf)  # of the distance to that one
    in_tree = np.zeros(num_robots, dtype=np.bool_)
    added = 0
    for _ in range(num_robots - 1):
        in_tree[added] = True
        closest = -1
        for j in range(num_robots):
            if in_tree[j]:
                continue
            apart_m2 = squared_distance(position_m, added, j)
            if apart_m2 < squared_m2[j]:
                squared_m2[j] = apart_m2
                nearest[j] = added
            if closest < 0 or squared_m2[j] < squared_m2[closest]:
                closest = j
        is_edge[closest, nearest[closest]] = is_edge[nearest[closest], closest] = True
        added = closest


@compiled()
def _peel(is_edge: Bool[np.ndarray, "N N"], parent: Int[np.ndarray, "N"]) -> None:
    """Direct the edges: leaves point at their neighbour and go, round by round.

    The robot that is left is a centre of the tree, so no robot is deeper than it must be.
    """
    num_left = parent.shape[0]
    degree = np.empty(num_left, dtype=np.int64)
    for i in range(num_left):
        degree[i] = is_edge[i].sum()
    parent[:] = ROOT
    while num_left > 1:
        for leaf in np.flatnonzero(degree == 1):
            if num_left > 1:  # the last two are each other's leaves
                neighbour = np.flatnonzero(is_edge[leaf])[0]
                parent[leaf] = neighbour
                is_edge[leaf, neighbour] = is_edge[neighbour, leaf] = False
                degree[leaf] = 0
                degree[neighbour] -= 1
                num_left -= 1
