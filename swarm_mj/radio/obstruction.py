"""Obstacles between antennas, and those that robots touch, for compiled loops.

Every obstacle that the straight line between two antennas crosses costs dB, which add up: the
multi-wall model of COST 231 (1999, section 4.7). Lines are tested against boxes, cylinders,
spheres, capsules and ellipsoids in compiled loops, and agree with MuJoCo's own rays, which a test
holds them against.
"""

import math

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission.geometry import HEIGHT, PLANE
from swarm_mj.physics.state import BOX, CYLINDER, ELLIPSOID, SPHERE, Obstacles
from swarm_mj.system.compiled import compiled

Vector = tuple[float, float, float]
Stretch = tuple[float, float]  # of the share of a line's way; empty if it ends before it begins

EMPTY: Stretch = (1.0, 0.0)


@compiled()
def obstruct(
    i: int,
    position_m: Float[np.ndarray, "N D"],
    height_m: float,
    obstacles: Obstacles | None,
    power: Float[np.ndarray, "N"],
) -> None:
    """Multiply i's power at all others by what obstacles leave.

    In the plane all antennas are at this height [m]; in space each is where its robot is.
    """
    if obstacles is None:  # code for obstacles is then not even compiled
        return
    x = position_m[i, 0]
    y = position_m[i, 1]
    has_heights = position_m.shape[1] > PLANE
    z = position_m[i, HEIGHT] if has_heights else height_m
    for j in range(position_m.shape[0]):
        if j != i:
            climb_m = position_m[j, HEIGHT] - z if has_heights else 0.0
            along_m = (position_m[j, 0] - x, position_m[j, 1] - y, climb_m)
            power[j] *= power_through((x, y, z), along_m, obstacles)


@compiled()
def blocked(
    position_m: Float[np.ndarray, "N D"],
    height_m: Float[np.ndarray, "N"],
    radius_m: Float[np.ndarray, "N"],
    obstacles: Obstacles,
) -> Bool[np.ndarray, "N"]:
    """Return which robots, at their heights [m], touch an obstacle, by four lines across each."""
    touches = np.zeros(position_m.shape[0], dtype=np.bool_)
    for i in range(position_m.shape[0]):
        for turn in range(4):
            x = math.cos(0.25 * math.pi * turn)
            y = math.sin(0.25 * math.pi * turn)
            r = radius_m[i]
            start_m = (position_m[i, 0] - r * x, position_m[i, 1] - r * y, height_m[i])
            along_m = (2.0 * r * x, 2.0 * r * y, 0.0)
            touches[i] |= _next_crossed(start_m, along_m, 0, obstacles) < obstacles.kind.shape[0]
    return touches


@compiled()
def power_through(start_m: Vector, along_m: Vector, obstacles: Obstacles) -> float:
    """Return the share of the power that reaches the end of a line, linear [1]."""
    left = 1.0
    o = _next_crossed(start_m, along_m, 0, obstacles)
    while o < obstacles.kind.shape[0]:
        left *= obstacles.power_left[o]
        o = _next_crossed(start_m, along_m, o + 1, obstacles)
    return left


@compiled()
def _next_crossed(start_m: Vector, along_m: Vector, first: int, obstacles: Obstacles) -> int:
    """Return the next obstacle that a line crosses, from this one on; their number if none."""
    # Most obstacles are too far off, which few numbers show.
    start_x, start_y, start_z = start_m
    along_x, along_y, along_z = along_m
    length_m2 = along_x * along_x + along_y * along_y + along_z * along_z
    per_m2 = 1.0 / length_m2 if length_m2 > 0.0 else 0.0
    num_obstacles = obstacles.kind.shape[0]
    for o in range(first, num_obstacles):
        x = obstacles.centre_m[o, 0] - start_x
        y = obstacles.centre_m[o, 1] - start_y
        z = obstacles.centre_m[o, HEIGHT] - start_z
        share = min(max((x * along_x + y * along_y + z * along_z) * per_m2, 0.0), 1.0)
        x -= share * along_x
        y -= share * along_y
        z -= share * along_z
        is_near = x * x + y * y + z * z <= obstacles.reach_m[o] ** 2
        if is_near and _crosses(start_m, along_m, o, obstacles):
            return o
    return num_obstacles


@compiled()
def _crosses(start_m: Vector, along_m: Vector, o: int, obstacles: Obstacles) -> bool:
    """Return whether a line has a point in common with an obstacle."""
    kind = obstacles.kind[o]
    centre_m = obstacles.centre_m[o]
    size_m = obstacles.size_m[o]
    frame = obstacles.rotation[o]
    dx = start_m[0] - centre_m[0]
    dy = start_m[1] - centre_m[1]
    dz = start_m[2] - centre_m[2]
    x, y, z = _turned((dx, dy, dz), frame)
    u, v, w = _turned(along_m, frame)
    if kind == BOX:
        part = _within(x, u, size_m[0], (0.0, 1.0))
        part = _within(y, v, size_m[1], part)
        part = _within(z, w, size_m[2], part)
        return part[0] <= part[1]
    if kind == ELLIPSOID:  # a ball, once every axis is counted in its own half length
        place = (x / size_m[0], y / size_m[1], z / size_m[2])
        return _meets_ball(place, (u / size_m[0], v / size_m[1], w / size_m[2]), 1.0)
    radius_m = size_m[0]
    half_m = size_m[1]
    if kind == SPHERE:
        return _meets_ball((x, y, z), (u, v, w), radius_m)
    part = _within(z, w, half_m, (0.0, 1.0))
    part = _within_ball((x, y, 0.0), (u, v, 0.0), radius_m, part)
    if kind == CYLINDER or part[0] <= part[1]:
        return part[0] <= part[1]
    is_met = _meets_ball((x, y, z - half_m), (u, v, w), radius_m)  # a capsule's ends
    return is_met or _meets_ball((x, y, z + half_m), (u, v, w), radius_m)


@compiled()
def _turned(vector: Vector, frame: Float[np.ndarray, "3 3"]) -> Vector:
    """Return a vector of the scene in the frame of an obstacle."""
    a, b, c = vector
    return (
        frame[0, 0] * a + frame[1, 0] * b + frame[2, 0] * c,
        frame[0, 1] * a + frame[1, 1] * b + frame[2, 1] * c,
        frame[0, 2] * a + frame[1, 2] * b + frame[2, 2] * c,
    )


@compiled()
def _within(p: float, v: float, half: float, part: Stretch) -> Stretch:
    """Return the part of an interval of s in which p + s v lies within plus or minus half."""
    if v == 0.0:
        return part if abs(p) <= half else EMPTY
    near = (-half - p) / v
    far = (half - p) / v
    if near > far:
        near, far = far, near
    return max(part[0], near), min(part[1], far)


@compiled()
def _meets_ball(place: Vector, along: Vector, radius: float) -> bool:
    """Return whether a line meets a ball around the origin."""
    low, high = _within_ball(place, along, radius, (0.0, 1.0))
    return low <= high


@compiled()
def _within_ball(place: Vector, along: Vector, radius: float, part: Stretch) -> Stretch:
    """Return the part of an interval of s in which place + s along lies in a ball."""
    x, y, z = place
    u, v, w = along
    # The line's points in the ball are those between the roots of a s² + 2 b s + c.
    a = u * u + v * v + w * w
    b = x * u + y * v + z * w
    c = x * x + y * y + z * z - radius * radius
    if a == 0.0:
        return part if c <= 0.0 else EMPTY
    square = b * b - a * c
    if square < 0.0:
        return EMPTY
    root = math.sqrt(square)
    return max(part[0], (-b - root) / a), min(part[1], (-b + root) / a)
