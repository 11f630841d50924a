"""Obstacles between robots: every one that the straight line between two antennas crosses costs dB.

The multi-wall model of COST 231 (1999, section 4.7): losses of the obstacles crossed add up. Lines
are tested against boxes, cylinders, spheres, capsules and ellipsoids here, in compiled loops, and
agree with MuJoCo's own rays, which a test holds them against.
"""

import math

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.physics.state import BOX, CYLINDER, ELLIPSOID, SPHERE, Obstacles
from swarm_mj.system.compiled import compiled


@compiled()
def obstruct(
    i: int,
    position_m: Float[np.ndarray, "N 2"],
    height_m: float,
    obstacles: Obstacles,
    power: Float[np.ndarray, "N"],
) -> None:
    """Multiplies the power of i's packets, at every other robot, by what obstacles leave of it.

    Args:
        i: The sender.
        position_m: Where the robots are [m].
        height_m: Of their antennas above the floor [m].
        obstacles: Of the scene; perhaps none.
        power: At every robot, changed in place, in any unit.
    """
    if obstacles.kind.shape[0] == 0:
        return
    start, along = np.empty(3), np.empty(3)
    start[2], along[2] = height_m, 0.0
    start[:2] = position_m[i]
    for j in range(position_m.shape[0]):
        if j != i:
            along[0] = position_m[j, 0] - start[0]
            along[1] = position_m[j, 1] - start[1]
            power[j] *= power_through(start, along, obstacles)


@compiled()
def blocked(
    position_m: Float[np.ndarray, "N 2"], height_m: float, radius_m: float, obstacles: Obstacles
) -> Bool[np.ndarray, "N"]:
    """Which robots touch an obstacle, by four lines across each.

    Args:
        position_m: Where they are [m].
        height_m: Of their centres above the floor [m].
        radius_m: Of their bodies [m].
        obstacles: Of the scene.
    """
    touches = np.zeros(position_m.shape[0], dtype=np.bool_)
    start, along = np.empty(3), np.zeros(3)
    start[2] = height_m
    for i in range(position_m.shape[0]):
        for turn in range(4):
            x, y = math.cos(0.25 * math.pi * turn), math.sin(0.25 * math.pi * turn)
            along[0], along[1] = 2.0 * radius_m * x, 2.0 * radius_m * y
            start[0] = position_m[i, 0] - radius_m * x
            start[1] = position_m[i, 1] - radius_m * y
            touches[i] |= num_crossed(start, along, obstacles) > 0
    return touches


@compiled()
def num_crossed(
    start_m: Float[np.ndarray, "3"], along_m: Float[np.ndarray, "3"], obstacles: Obstacles
) -> int:
    """How many obstacles a line crosses."""
    crossed = 0
    o = _next_crossed(start_m, along_m, 0, obstacles)
    while o < obstacles.kind.shape[0]:
        crossed += 1
        o = _next_crossed(start_m, along_m, o + 1, obstacles)
    return crossed


@compiled()
def power_through(
    start_m: Float[np.ndarray, "3"], along_m: Float[np.ndarray, "3"], obstacles: Obstacles
) -> float:
    """Return the share of the power that reaches the end of a line, linear [1]."""
    left = 1.0
    o = _next_crossed(start_m, along_m, 0, obstacles)
    while o < obstacles.kind.shape[0]:
        left *= obstacles.power_left[o]
        o = _next_crossed(start_m, along_m, o + 1, obstacles)
    return left


@compiled()
def _next_crossed(
    start_m: Float[np.ndarray, "3"],
    along_m: Float[np.ndarray, "3"],
    first: int,
    obstacles: Obstacles,
) -> int:
    """Return the next obstacle that a line crosses, from this one on; as many as there are if none.

    Most are too far off, which is seen in plain numbers: a view of an array would cost as much as
    all of the arithmetic.
    """
    start_x, start_y, start_z = start_m[0], start_m[1], start_m[2]
    along_x, along_y, along_z = along_m[0], along_m[1], along_m[2]
    length_m2 = along_x * along_x + along_y * along_y + along_z * along_z
    per_m2 = 1.0 / length_m2 if length_m2 > 0.0 else 0.0
    num_obstacles = obstacles.kind.shape[0]
    for o in range(first, num_obstacles):
        x = obstacles.centre_m[o, 0] - start_x
        y = obstacles.centre_m[o, 1] - start_y
        z = obstacles.centre_m[o, 2] - start_z
        share = min(max((x * along_x + y * along_y + z * along_z) * per_m2, 0.0), 1.0)
        x, y, z = x - share * along_x, y - share * along_y, z - share * along_z
        if x * x + y * y + z * z <= obstacles.reach_m[o] ** 2 and _crosses(
            start_m, along_m, o, obstacles
        ):
            return o
    return num_obstacles


@compiled()
def _crosses(
    start_m: Float[np.ndarray, "3"],
    along_m: Float[np.ndarray, "3"],
    o: int,
    obstacles: Obstacles,
) -> bool:
    """Whether a line has a point in common with an obstacle."""
    kind, centre_m, size_m = obstacles.kind[o], obstacles.centre_m, obstacles.size_m
    x, y, z = _turned(
        start_m[0] - centre_m[o, 0],
        start_m[1] - centre_m[o, 1],
        start_m[2] - centre_m[o, 2],
        o,
        obstacles,
    )
    u, v, w = _turned(along_m[0], along_m[1], along_m[2], o, obstacles)
    if kind == BOX:
        low, high = _within(x, u, size_m[o, 0], 0.0, 1.0)
        low, high = _within(y, v, size_m[o, 1], low, high)
        low, high = _within(z, w, size_m[o, 2], low, high)
        return low <= high
    if kind == ELLIPSOID:
        x, y, z = x / size_m[o, 0], y / size_m[o, 1], z / size_m[o, 2]
        u, v, w = u / size_m[o, 0], v / size_m[o, 1], w / size_m[o, 2]
        return _meets_ball(x, y, z, u, v, w, 1.0)
    radius_m, half_m = size_m[o, 0], size_m[o, 1]
    if kind == SPHERE:
        return _meets_ball(x, y, z, u, v, w, radius_m)
    low, high = _within(z, w, half_m, 0.0, 1.0)
    low, high = _within_ball(x, y, 0.0, u, v, 0.0, radius_m, low, high)
    if kind == CYLINDER or low <= high:
        return low <= high
    is_met = _meets_ball(x, y, z - half_m, u, v, w, radius_m)  # a capsule's ends
    return is_met or _meets_ball(x, y, z + half_m, u, v, w, radius_m)


@compiled()
def _turned(
    a: float, b: float, c: float, o: int, obstacles: Obstacles
) -> tuple[float, float, float]:
    """Return a vector of the scene as an obstacle sees it."""
    frame = obstacles.rotation
    return (
        frame[o, 0, 0] * a + frame[o, 1, 0] * b + frame[o, 2, 0] * c,
        frame[o, 0, 1] * a + frame[o, 1, 1] * b + frame[o, 2, 1] * c,
        frame[o, 0, 2] * a + frame[o, 1, 2] * b + frame[o, 2, 2] * c,
    )


@compiled()
def _within(p: float, v: float, half: float, low: float, high: float) -> tuple[float, float]:
    """Return the part of [low, high] in which p + s v lies within plus or minus half."""
    if v == 0.0:
        return (low, high) if abs(p) <= half else (1.0, 0.0)
    near, far = (-half - p) / v, (half - p) / v
    if near > far:
        near, far = far, near
    return max(low, near), min(high, far)


@compiled()
def _meets_ball(x: float, y: float, z: float, u: float, v: float, w: float, radius: float) -> bool:
    """Whether a line from (x, y, z) along (u, v, w) meets a ball around the origin."""
    low, high = _within_ball(x, y, z, u, v, w, radius, 0.0, 1.0)
    return low <= high


@compiled()
def _within_ball(
    x: float,
    y: float,
    z: float,
    u: float,
    v: float,
    w: float,
    radius: float,
    low: float,
    high: float,
) -> tuple[float, float]:
    """The part of [low, high] in which the line from (x, y, z) along (u, v, w) is in a ball."""
    a = u * u + v * v + w * w
    b = x * u + y * v + z * w
    c = x * x + y * y + z * z - radius * radius
    if a == 0.0:
        return (low, high) if c <= 0.0 else (1.0, 0.0)
    square = b * b - a * c
    if square < 0.0:
        return 1.0, 0.0
    root = math.sqrt(square)
    return max(low, (-b - root) / a), min(high, (-b + root) / a)
