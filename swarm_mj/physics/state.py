"""The true state of the world as plain arrays, for code without MuJoCo: robots and obstacles."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

ROBOT_RADIUS_M = 0.5  # assets/robot.xml
ROBOT_HEIGHT_M = 1.0  # of its centre, and of its antenna, above the floor
# Kinds of obstacles, as MuJoCo numbers them.
SPHERE = 2
CAPSULE = 3
ELLIPSOID = 4
CYLINDER = 5
BOX = 6
KINDS = (SPHERE, CAPSULE, ELLIPSOID, CYLINDER, BOX)


@dataclass(frozen=True, kw_only=True)
class RobotStates:
    """Where the robots truly are and who is active, in all B missions at once.

    Positions and velocities have D axes: the two of the plane, or, of bodies, three.
    """

    position_m: Float[np.ndarray, "B N D"]  # p [m]
    velocity_mps: Float[np.ndarray, "B N D"]  # v [m/s]
    is_active: Bool[np.ndarray, "B N"] | None = None  # who observes and transmits; None: all robots
    attitude: Float[np.ndarray, "B N 4"] | None = None  # quaternions of bodies; None: points
    has_crashed: Bool[np.ndarray, "B N"] | None = None  # bodies that touched anything in flight
    observed_m: Float[np.ndarray, "B N D"] | None = None  # own position, with its error [m]
    # Of the models' sensors, in MuJoCo's units; `physics.robots.sensor_columns` has their names.
    sensors: Float[np.ndarray, "B N S"] | None = None  # None: no robot has any
    # Of all its motors on a body, by its weight and in its own axes [1]; None: points.
    thrust: Float[np.ndarray, "B N 3"] | None = None
    wind_mps: Float[np.ndarray, "B 2"] | None = None  # on bodies, in the last window; None: calm
    # What bodies have used so far, nan where their models do not say [J]; None: points.
    energy_j: Float[np.ndarray, "B N"] | None = None

    @property
    def own_m(self) -> Float[np.ndarray, "B N D"]:
        """Where each robot observes itself to be: exactly at p unless it errs [m]."""
        return self.position_m if self.observed_m is None else self.observed_m

    @property
    def num_crashed(self) -> Float[np.ndarray, "B"]:
        """How many robots have crashed; nan where they are points."""
        if self.has_crashed is None:
            return np.full(len(self.position_m), np.nan)
        return np.sum(self.has_crashed, axis=1).astype(float)

    @property
    def mean_energy_j(self) -> Float[np.ndarray, "B"]:
        """The energy that robots have used on average [J]; nan where that is not known."""
        if self.energy_j is None:
            return np.full(len(self.position_m), np.nan)
        return np.mean(self.energy_j, axis=1)

    @property
    def most_energy_j(self) -> Float[np.ndarray, "B"]:
        """The energy of the robot that has used most [J]; nan where that is not known."""
        if self.energy_j is None:
            return np.full(len(self.position_m), np.nan)
        return np.max(self.energy_j, axis=1)


class Antennas(NamedTuple):
    """The antennas of robots with bodies, in the order of their numbers; gains are linear."""

    height_m: Float[np.ndarray, "N"]  # above the robot's base
    gain: Float[np.ndarray, "N"]  # of what a robot sends and of what it receives [1]
    power: Float[np.ndarray, "N"]  # that a robot sends, over the mission's [1]

    @property
    def are_alike(self) -> bool:
        """True if all are equally high and none has a gain: in free space they change nothing."""
        has_gain = np.any(self.gain != 1.0) or np.any(self.power != 1.0)
        return not has_gain and not np.any(self.height_m != self.height_m[0])


class Obstacles(NamedTuple):
    """The obstacles of a scene; the same in all missions."""

    kind: Int[np.ndarray, "O"]  # SPHERE, CAPSULE, ...; a mesh is the box around it
    centre_m: Float[np.ndarray, "O 3"]
    rotation: Float[np.ndarray, "O 3 3"]  # from the obstacle's frame to the scene's
    size_m: Float[np.ndarray, "O 3"]  # as MuJoCo's: radius and half length, or half sides
    reach_m: Float[np.ndarray, "O"]  # radius of the sphere around the centre that holds it
    power_left: Float[np.ndarray, "O"]  # fraction of the power that passes through, linear [1]
