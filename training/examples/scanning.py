"""A pilot of one's own that keeps off what its rangefinders see, for the robot of `scanner.xml`.

    robot="training/examples/scanner.xml", pilot="training.examples.scanning:Scanning"

The nearer a thing, the slower the robot may approach it: at `KEEP_M` not at all, and from there it
backs off. It keeps its speed across, so it slides along walls and round trees. It uses its own
sensors, attitude and velocity, and no map.
"""

import math

import numpy as np
from jaxtyping import Float

from swarm_mj.physics.pilots import Airframe, QuadrotorPilot, Sensed, SetPoint

NUM_RAYS = 8  # scanner.xml: ray0 looks forwards, and each next one further to the left
KEEP_M = 2.0  # from what it sees; its hull has 0.27 m
APPROACH_PER_S = 1.0  # of the distance beyond that: slower than the pilot follows, 2.5 per second
STEEP = 1e-9  # of a ray's length on the map: one that looks straight up has no direction there


class Scanning:
    """Flies as `QuadrotorPilot`, at set points that lead into nothing that a ray has hit."""

    def __init__(self, airframe: Airframe) -> None:
        """Prepare for this airframe; raise ValueError for one without the eight rangefinders."""
        self._pilot = QuadrotorPilot(airframe)
        self._columns: list[int] = []
        for k in range(NUM_RAYS):
            if f"ray{k}" not in airframe.sensors:
                raise ValueError(f"its pilot needs a rangefinder ray{k}; see scanner.xml")
            self._columns.append(airframe.sensors[f"ray{k}"].start)

    def __call__(
        self, sensed: Sensed, wanted: SetPoint, control: Float[np.ndarray, "B n U"], /
    ) -> None:
        """Write the rotors' lifts [N]."""
        direction = directions(sensed.attitude)
        velocity_mps = wanted.velocity_mps.copy()
        for k, column in enumerate(self._columns):
            range_m = sensed.sensors[..., column]
            velocity_mps[..., :2] = slowed(velocity_mps[..., :2], range_m, direction[:, :, k])
        self._pilot(sensed, SetPoint(velocity_mps, wanted.height_m), control)


def directions(attitude: Float[np.ndarray, "B n 4"]) -> Float[np.ndarray, "B n K 2"]:
    """Return the rays' directions on the map; a ray that tilts is shorter there than 1."""
    w, a, e, c = np.moveaxis(attitude, 2, 0)
    front = np.stack([1.0 - 2.0 * (e * e + c * c), 2.0 * (a * e + w * c)], axis=2)
    left = np.stack([2.0 * (a * e - w * c), 1.0 - 2.0 * (a * a + c * c)], axis=2)
    rays = []
    for k in range(NUM_RAYS):
        angle = 2.0 * math.pi * k / NUM_RAYS
        rays.append(math.cos(angle) * front + math.sin(angle) * left)
    return np.stack(rays, axis=2)


def slowed(
    velocity_mps: Float[np.ndarray, "B n 2"],
    range_m: Float[np.ndarray, "B n"],
    direction: Float[np.ndarray, "B n 2"],
) -> Float[np.ndarray, "B n 2"]:
    """Return velocities that approach what a ray has hit no faster than its distance allows.

    Args:
        velocity_mps: On the map, as are directions.
        range_m: What MuJoCo's rangefinder says; -1 is nothing.
        direction: Of the ray.
    """
    length = np.maximum(np.linalg.norm(direction, axis=2), STEEP)
    distance_m = range_m * length
    most_mps = np.where(range_m >= 0.0, APPROACH_PER_S * (distance_m - KEEP_M), np.inf)
    ahead = direction / length[..., None]
    towards_mps = np.sum(velocity_mps * ahead, axis=2)
    too_fast_mps = np.maximum(towards_mps - most_mps, 0.0)
    return velocity_mps - too_fast_mps[..., None] * ahead
