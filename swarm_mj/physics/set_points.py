"""Set points of robots with bodies: what the paper's equation moves, and pilots fly after.

The acceleration, clipped to A_max, moves a set point, clipped to V_max per axis. At the edge of the
area it is mirrored. While it is 0 in the plane, its body flies back to its place there.
"""

import numpy as np
from jaxtyping import Float

from swarm_mj.mission.bodies import LEAST_HEIGHT_M
from swarm_mj.mission.geometry import HEIGHT, PLANE
from swarm_mj.physics.worlds import next_velocity
from swarm_mj.system.compiled import compiled

RESTS_MPS = 1e-6  # a set point slower than this is 0: sums of accelerations end a rounding away
RETURN_PER_S = 0.6  # speed towards a place over the way to it: a pilot's velocities settle faster


@compiled(makes_arrays=False)
def move_set_points(
    acceleration: Float[np.ndarray, "B N 3"],
    position: Float[np.ndarray, "B N 3"],
    dt_s: float,
    limit_mps2: float,
    limit_mps: float,
    wall_m: float,
    course_mps: Float[np.ndarray, "B N 3"],
    height_m: Float[np.ndarray, "B N"],
) -> None:
    """Accelerate, clip, and turn round at the edge; heights follow what climbs."""
    for b in range(acceleration.shape[0]):
        for i in range(acceleration.shape[1]):
            for axis in range(3):
                v = next_velocity(
                    course_mps[b, i, axis], acceleration[b, i, axis], dt_s, limit_mps2, limit_mps
                )
                p = position[b, i, axis]
                if axis < PLANE and abs(p) > wall_m and p * v > 0.0:
                    v = -v
                course_mps[b, i, axis] = v
            height_m[b, i] += course_mps[b, i, HEIGHT] * dt_s
            if height_m[b, i] < LEAST_HEIGHT_M:  # it may not sink further
                height_m[b, i] = LEAST_HEIGHT_M
                course_mps[b, i, HEIGHT] = max(course_mps[b, i, HEIGHT], 0.0)


@compiled(makes_arrays=False)
def hold_places(
    position: Float[np.ndarray, "B N 3"],
    course_mps: Float[np.ndarray, "B N 3"],
    dt_s: float,
    limit_mps: float,
    place_m: Float[np.ndarray, "B N 2"],
    wanted_mps: Float[np.ndarray, "B N 3"],
) -> None:
    """Let pilots follow the set points, and fly back to where bodies were when these came to rest.

    The place of a body that moves is where it will be in a window, when its set point may rest.
    """
    for b in range(position.shape[0]):
        for i in range(position.shape[1]):
            rests = abs(course_mps[b, i, 0]) < RESTS_MPS and abs(course_mps[b, i, 1]) < RESTS_MPS
            for axis in range(PLANE):
                v = course_mps[b, i, axis]
                p = position[b, i, axis]
                if rests:
                    back = RETURN_PER_S * (place_m[b, i, axis] - p)
                    v = min(max(back, -limit_mps), limit_mps)
                else:
                    place_m[b, i, axis] = p + v * dt_s
                wanted_mps[b, i, axis] = v
            wanted_mps[b, i, HEIGHT] = course_mps[b, i, HEIGHT]
