"""Three controllers that act on stale positions: formation, coverage and Reynolds' flocks.

    swarm-mj fly --controller training.examples.added_tasks:Coverage --task random-walk

`--task` says how they begin: with velocities in `random-walk`, at rest in `stationary`. But there
`planner` takes them for robots that stay where they are, so moving teams are random walks.

Formation is displacement consensus of double integrators (Oh, Park and Ahn, Automatica 53, 2015):
u_i = k (mean over j of (p_j + d_i - d_j) - p_i) - c v_i. As c² >= 2k, no delay makes the robots
oscillate ever wider. Coverage is Lloyd's algorithm (Cortés, Martínez, Karatas and Bullo, IEEE
Transactions on Robotics and Automation 20(2), 2004): u_i = k (C_i - p_i) - c v_i, where C_i is the
centroid of a Voronoi cell. Flocks align, keep together and keep apart by Reynolds' three rules
(SIGGRAPH 1987). There is one difference in all: robot i takes p_j from its buffer, and no teammate
that it has not heard of.
"""

import math

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.control.motion import flocking
from swarm_mj.mission import Mission
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.system.compiled import compiled

STIFFNESS_PER_S2 = 0.25  # k: a robot begins to brake V_max c / k before its target, 12 m by default
DAMPING_PER_S = 1.0  # c: critical, 2 sqrt(k)
BLOCK_SHARE = 0.5  # width of the formation over the side of the area


# Chosen by hand: a flock draws together in about 20 s, and keeps apart at a few robots' widths.
COHESION_PER_S2 = 0.05
APART_M = 20.0  # robots nearer than this push each other away
SEPARATION_MPS2 = 3.0  # the push of one that is all but touched


def steer(target_m: Float[np.ndarray, "B N D"], states: RobotStates) -> Float[np.ndarray, "B N D"]:
    """Accelerate towards targets [m], critically damped: k (target - p) - c v [m/s²]."""
    apart_m = target_m - states.position_m
    return STIFFNESS_PER_S2 * apart_m - DAMPING_PER_S * states.velocity_mps


class Formation:
    """Robots line up in the rows of a square block, in the order of their identities."""

    cost_name = "formation error"
    cost_unit = "m"

    def __init__(self, mission: Mission) -> None:
        self._place_m = block(mission.num_robots, BLOCK_SHARE * mission.side_m)

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N D"]:
        """Steer each robot to the mean of its places relative to known teammates [m/s²]."""
        target_m = states.position_m.copy()  # of robots that know nobody
        _mean_places(buffers.is_known, buffers.position_m, self._place_m, target_m)
        return steer(target_m, states)

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the root mean square distance of the active robots from their places [m].

        The formation may stand anywhere, but not turned: the places are those of the best fit.
        """
        return spread_m(states.position_m[..., :2] - self._place_m, states.is_active)


def block(num_robots: int, width_m: float) -> Float[np.ndarray, "N 2"]:
    """Return places in the rows of a square block around the origin [m]; the last may be short."""
    num_columns = math.ceil(math.sqrt(num_robots))
    row, column = np.divmod(np.arange(num_robots), num_columns)
    place_m = np.stack([column, -row], axis=1) * (width_m / (num_columns - 1))
    return place_m - np.mean(place_m, axis=0)


class Reynolds:
    """Robots fly as a flock: at one velocity, together, and not too near to each other.

    Alignment is the paper's (Eq. 16). Cohesion draws a robot to the mean of where it takes the
    others to be, and separation away from each that is near.
    """

    cost_name = "spread of the flock"
    cost_unit = "m"

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N D"]:
        """Return the sum of the three rules' accelerations [m/s²]."""
        acceleration_mps2 = flocking(buffers, states.velocity_mps, "heard")
        _keep_together(buffers.is_known, buffers.position_m, states.position_m, acceleration_mps2)
        return acceleration_mps2

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the root mean square distance of the active robots from their middle [m]."""
        return spread_m(states.position_m, states.is_active)


def spread_m(
    position_m: Float[np.ndarray, "B N D"], is_active: Bool[np.ndarray, "B N"] | None
) -> Float[np.ndarray, "B"]:
    """Return how far the active robots are from their middle, in root mean square [m]."""
    weight = np.ones(position_m.shape[:2]) if is_active is None else is_active.astype(float)
    weight = (weight / np.sum(weight, axis=1, keepdims=True))[..., None]
    off_m = position_m - np.sum(weight * position_m, axis=1, keepdims=True)
    return np.sqrt(np.sum(weight * off_m**2, axis=(1, 2)))


class Coverage:
    """Robots spread out, so that no point of the area is far from all of them."""

    cost_name = "distance to the nearest robot"
    cost_unit = "m"

    def __init__(self, mission: Mission) -> None:
        self._half_side_m = mission.half_side_m

    def __call__(self, buffers: Buffers, states: RobotStates, /) -> Float[np.ndarray, "B N D"]:
        """Steer each robot to the centroid of the cell that it believes to be its own [m/s²]."""
        target_m = states.position_m.copy()
        _centroids(buffers.is_known, buffers.position_m, self._half_side_m, target_m)
        return steer(target_m, states)

    def cost(self, states: RobotStates, /) -> Float[np.ndarray, "B"]:
        """Return the root mean square distance of the area to its nearest active robot [m]."""
        position_m = states.position_m
        is_active = states.is_active
        counts = np.ones(position_m.shape[:2], dtype=np.bool_) if is_active is None else is_active
        return np.sqrt(_mean_squares(position_m, self._half_side_m, counts))


@compiled(makes_arrays=False)
def _keep_together(
    is_known: Bool[np.ndarray, "B N N"],
    known_m: Float[np.ndarray, "B N N D"],
    position_m: Float[np.ndarray, "B N D"],
    acceleration_mps2: Float[np.ndarray, "B N D"],
) -> None:
    """Add cohesion and separation to accelerations."""
    for b in range(is_known.shape[0]):
        for i in range(is_known.shape[1]):
            num_known = np.sum(is_known[b, i]) - is_known[b, i, i]
            for j in range(is_known.shape[1]):
                if j == i or not is_known[b, i, j]:
                    continue
                far_m2 = 0.0
                for axis in range(position_m.shape[2]):
                    far_m2 += (known_m[b, i, j, axis] - position_m[b, i, axis]) ** 2
                far_m = math.sqrt(far_m2)
                pull = COHESION_PER_S2 / num_known
                if 0.0 < far_m < APART_M:
                    pull -= SEPARATION_MPS2 * (1.0 - far_m / APART_M) / far_m
                for axis in range(position_m.shape[2]):
                    apart_m = known_m[b, i, j, axis] - position_m[b, i, axis]
                    acceleration_mps2[b, i, axis] += pull * apart_m


@compiled()
def _mean_places(
    is_known: Bool[np.ndarray, "B N N"],
    known_m: Float[np.ndarray, "B N N D"],
    place_m: Float[np.ndarray, "N 2"],
    target_m: Float[np.ndarray, "B N D"],
) -> None:
    for b in range(is_known.shape[0]):
        for i in range(is_known.shape[1]):
            for axis in range(2):
                total = 0.0
                num_known = 0
                for j in range(is_known.shape[1]):
                    if j != i and is_known[b, i, j]:
                        total += known_m[b, i, j, axis] + place_m[i, axis] - place_m[j, axis]
                        num_known += 1
                if num_known:
                    target_m[b, i, axis] = total / num_known


@compiled()
def _centroids(
    is_known: Bool[np.ndarray, "B N N"],
    known_m: Float[np.ndarray, "B N N D"],
    half_side_m: float,
    target_m: Float[np.ndarray, "B N D"],
) -> None:
    """Turn positions into targets; without a cell, that is the nearest point of the area."""
    for b in range(is_known.shape[0]):
        for i in range(is_known.shape[1]):
            team_m = known_m[b, i].copy()
            team_m[i] = target_m[b, i]
            own = moments(cell(team_m, is_known[b, i], i, half_side_m), team_m[i])
            for axis in range(2):
                target = team_m[i, axis] + (own[1 + axis] / own[0] if own[0] > 0.0 else 0.0)
                target_m[b, i, axis] = min(max(target, -half_side_m), half_side_m)


@compiled()
def _mean_squares(
    position_m: Float[np.ndarray, "B N D"], half_side_m: float, counts: Bool[np.ndarray, "B N"]
) -> Float[np.ndarray, "B"]:
    """Sum up the second moments of the cells of robots that count, over the area [m²]."""
    cost = np.zeros(len(position_m))
    for b in range(len(position_m)):
        for i in range(counts.shape[1]):
            if counts[b, i]:
                polygon = cell(position_m[b], counts[b], i, half_side_m)
                cost[b] += moments(polygon, position_m[b, i])[3]
    return cost / (2.0 * half_side_m) ** 2


@compiled()
def cell(
    position_m: Float[np.ndarray, "N D"], counts: Bool[np.ndarray, "N"], i: int, half_side_m: float
) -> Float[np.ndarray, "corners 2"]:
    """Return the corners of robot i's Voronoi cell in the area, anticlockwise [m].

    Of robots at one point, the first has the whole cell and the others an empty one.
    """
    h = half_side_m
    polygon = np.array([[-h, -h], [h, -h], [h, h], [-h, h]])
    for j in range(len(counts)):
        if j != i and counts[j]:
            farthest_m2 = 0.0
            x = position_m[i, 0]
            y = position_m[i, 1]
            for c in range(len(polygon)):
                farthest_m2 = max(farthest_m2, (polygon[c, 0] - x) ** 2 + (polygon[c, 1] - y) ** 2)
            # A robot twice as far as the cell's farthest corner cuts nothing off.
            if (position_m[j, 0] - x) ** 2 + (position_m[j, 1] - y) ** 2 <= 4.0 * farthest_m2:
                polygon = _nearer(polygon, position_m, i, j)
    return polygon


@compiled()
def _nearer(
    polygon: Float[np.ndarray, "corners 2"], position_m: Float[np.ndarray, "N D"], i: int, j: int
) -> Float[np.ndarray, "corners 2"]:
    """Clip a polygon along the bisector of i and j (Sutherland and Hodgman 1974)."""
    across_x = position_m[j, 0] - position_m[i, 0]
    across_y = position_m[j, 1] - position_m[i, 1]
    if across_x == 0.0 and across_y == 0.0 and j < i:
        return polygon[:0]
    middle_x = (position_m[i, 0] + position_m[j, 0]) / 2.0
    middle_y = (position_m[i, 1] + position_m[j, 1]) / 2.0
    kept = np.empty((len(polygon) + 1, 2))
    num_kept = 0
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
    area = 0.0
    first_x = 0.0
    first_y = 0.0
    second = 0.0
    for corner in range(len(polygon)):
        x = polygon[corner - 1, 0] - about_m[0]
        y = polygon[corner - 1, 1] - about_m[1]
        next_x = polygon[corner, 0] - about_m[0]
        next_y = polygon[corner, 1] - about_m[1]
        twice = x * next_y - next_x * y
        area += twice / 2.0
        first_x += twice * (x + next_x) / 6.0
        first_y += twice * (y + next_y) / 6.0
        squares = x * x + x * next_x + next_x * next_x + y * y + y * next_y + next_y * next_y
        second += twice * squares / 12.0
    return area, first_x, first_y, second
