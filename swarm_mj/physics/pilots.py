"""Pilots: what makes a robot's controls of its state and of the velocity that it is to have.

A pilot steers all robots of one kind at once, in every step of MuJoCo's. It is chosen with the
robot's model (`physics.robots`), and one of a user's own is any class of this form:

    class Pilot:
        def __init__(self, airframe):
            self.airframe = airframe

        def __call__(self, sensed, wanted, control):
            control[:] = 0.25 * 9.81 * self.airframe.mass_kg

Index order: `[b, i]` is robot `i` of its kind, in mission `b`. Vectors are the world's, unless a
name says otherwise; quaternions are MuJoCo's, the real part first.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from swarm_mj.mission.geometry import HEIGHT
from swarm_mj.system.compiled import compiled

GRAVITY_MPS2 = 9.81


@dataclass(frozen=True, kw_only=True)
class Airframe:
    """A robot's model, as a pilot is made for it."""

    mass_kg: float  # of the whole robot
    inertia_kgm2: Float[np.ndarray, "3"]  # of the whole, about its base's axes; inf: none
    actuators: tuple[str, ...]  # the U controls' names
    least: Float[np.ndarray, "U"]  # of each control; -inf without a limit
    most: Float[np.ndarray, "U"]  # of each control; inf without a limit
    thrust: Float[np.ndarray, "U 6"]  # force and torque on the base of a control of 1; 0: no motor
    sensors: dict[str, slice]  # the columns of each of the model's sensors, by its name
    step_s: float  # MuJoCo's step


class Sensed(NamedTuple):
    """The states of all robots of a kind, in B missions, as they are."""

    position_m: Float[np.ndarray, "B n 3"]
    attitude: Float[np.ndarray, "B n 4"]  # from the robot's frame to the world's
    velocity_mps: Float[np.ndarray, "B n 3"]
    turn_rate_rps: Float[np.ndarray, "B n 3"]  # about the axes of the robot's own frame [rad/s]
    sensors: Float[np.ndarray, "B n S"]  # the numbers of the model's sensors, a step ago


class SetPoint(NamedTuple):
    """The motion that all robots of a kind are to have, in B missions."""

    velocity_mps: Float[np.ndarray, "B n 3"]
    height_m: Float[np.ndarray, "B n"]  # of robots that fly


@runtime_checkable
class Pilot(Protocol):
    """Steers all robots of a kind."""

    def __call__(
        self, sensed: Sensed, wanted: SetPoint, control: Float[np.ndarray, "B n U"], /
    ) -> None:
        """Write the controls of the next step, in the model's order and units; MuJoCo clips them.

        Args:
            sensed: Where robots are, and how fast.
            wanted: The velocities and heights that they are to have.
            control: Their controls, [B, n, U]; written.
        """
        ...


class QuadrotorPilot:
    """Tracks a velocity and a height by tilting: Lee, Leok and McClamroch 2010, for velocities.

    The force that is wanted is proportional to the errors of velocity and height; the body's third
    axis follows its direction, and the four rotors share force and torque. A pole of about 10
    rad/s turns the body, one of 2 to 3 rad/s the velocity: slower than the rotors' lag, and faster
    than news.

    It flies any model with four rotors whose lifts and torques are independent, whatever their
    places: what a rotor does to the base is the model's own.
    """

    MOST_TILT = math.tan(math.radians(40.0))  # of the horizontal over the vertical force
    LEAST_LIFT = 0.3  # of gravity: a body that falls freely has no force to turn

    def __init__(self, airframe: Airframe) -> None:
        """Prepare for this airframe; raise ValueError for one without four rotors that steer it."""
        num_rotors = len(airframe.actuators)
        effects = airframe.thrust[:, 2:].T  # lift, and torque about the body's axes
        if num_rotors != 4 or np.linalg.matrix_rank(effects) < 4:
            raise ValueError(
                f"its pilot needs four rotors that lift, roll, pitch and turn it, not {num_rotors} "
                "actuators that do less"
            )
        self._shares = np.linalg.inv(effects)  # of each rotor in a lift and the three torques
        self._mass_kg = airframe.mass_kg
        self._inertia_kgm2 = airframe.inertia_kgm2
        self._least = airframe.least
        self._most = airframe.most

    def __call__(
        self, sensed: Sensed, wanted: SetPoint, control: Float[np.ndarray, "B n U"], /
    ) -> None:
        """Write the rotors' lifts [N]."""
        _steer_quadrotors(
            position_m=sensed.position_m,
            attitude=sensed.attitude,
            velocity_mps=sensed.velocity_mps,
            turn_rate_rps=sensed.turn_rate_rps,
            wanted_mps=wanted.velocity_mps,
            height_m=wanted.height_m,
            mass_kg=self._mass_kg,
            inertia_kgm2=self._inertia_kgm2,
            shares=self._shares,
            most_tilt=self.MOST_TILT,
            least_lift=self.LEAST_LIFT,
            least=self._least,
            most=self._most,
            control=control,
        )


class RoverPilot:
    """Drives and turns a robot with two driven sides, which cannot move sideways.

    It turns towards the velocity that is wanted, or away from it and drives backwards if that is
    nearer, and drives as fast as its heading allows.
    """

    # The greatest speed and turn rate of Clearpath's data sheet of the Jackal, as assets/rover.xml.
    MOST_MPS = 2.0
    MOST_RPS = 4.0

    def __init__(self, airframe: Airframe) -> None:
        """Prepare for this airframe, whose first two actuators must be force and torque."""
        if airframe.actuators[:2] != ("drive", "steer"):
            raise ValueError(
                "its pilot needs the actuators drive and steer, not "
                f"{', '.join(airframe.actuators) or 'none'}"
            )
        self._mass_kg = airframe.mass_kg
        self._inertia_kgm2 = float(airframe.inertia_kgm2[2])

    def __call__(
        self, sensed: Sensed, wanted: SetPoint, control: Float[np.ndarray, "B n U"], /
    ) -> None:
        """Write the force along the robot [N] and the torque about its vertical [Nm]."""
        _steer_rovers(
            attitude=sensed.attitude,
            velocity_mps=sensed.velocity_mps,
            turn_rate_rps=sensed.turn_rate_rps,
            wanted_mps=wanted.velocity_mps,
            mass_kg=self._mass_kg,
            inertia_kgm2=self._inertia_kgm2,
            most_mps=self.MOST_MPS,
            most_rps=self.MOST_RPS,
            control=control,
        )


# Of the quadrotor.
_VELOCITY_GAIN = 2.5  # acceleration by an error of the horizontal velocity [1/s]
_HEIGHT_GAIN = 4.0  # vertical acceleration by an error of the height [1/s²]
_CLIMB_GAIN = 4.0  # vertical acceleration by an error of the climb [1/s]
_TILT_GAIN = 80.0  # acceleration of roll and pitch by the sine of the tilt that is missing [1/s²]
_TURN_GAIN = 14.0  # against their rates [1/s]
_YAW_GAIN = 4.0  # acceleration of yaw by its error [1/s²]
_YAW_RATE_GAIN = 4.0  # against its rate [1/s]


@compiled(forceinline=True, makes_arrays=False)
def _front(w: float, a: float, e: float, c: float) -> tuple[float, float, float]:
    """Return the axis that points forwards, in the world's frame, of a robot with this attitude."""
    return 1.0 - 2.0 * (e * e + c * c), 2.0 * (a * e + w * c), 2.0 * (a * c - w * e)


@compiled(makes_arrays=False)
def _steer_quadrotors(
    position_m: Float[np.ndarray, "B n 3"],
    attitude: Float[np.ndarray, "B n 4"],
    velocity_mps: Float[np.ndarray, "B n 3"],
    turn_rate_rps: Float[np.ndarray, "B n 3"],
    wanted_mps: Float[np.ndarray, "B n 3"],
    height_m: Float[np.ndarray, "B n"],
    mass_kg: float,
    inertia_kgm2: Float[np.ndarray, "3"],
    shares: Float[np.ndarray, "4 4"],
    most_tilt: float,
    least_lift: float,
    least: Float[np.ndarray, "4"],
    most: Float[np.ndarray, "4"],
    control: Float[np.ndarray, "B n U"],
) -> None:
    for b in range(control.shape[0]):
        for i in range(control.shape[1]):
            # The acceleration that is wanted, gravity made up for.
            x = _VELOCITY_GAIN * (wanted_mps[b, i, 0] - velocity_mps[b, i, 0])
            y = _VELOCITY_GAIN * (wanted_mps[b, i, 1] - velocity_mps[b, i, 1])
            climb = _HEIGHT_GAIN * (height_m[b, i] - position_m[b, i, HEIGHT])
            climb += _CLIMB_GAIN * (wanted_mps[b, i, HEIGHT] - velocity_mps[b, i, HEIGHT])
            z = max(GRAVITY_MPS2 + climb, least_lift * GRAVITY_MPS2)
            flat = math.sqrt(x * x + y * y)
            if flat > most_tilt * z:
                x *= most_tilt * z / flat
                y *= most_tilt * z / flat
            size = math.sqrt(x * x + y * y + z * z)
            # Its axes in the world's frame are the columns of its rotation.
            w, a, e, c = attitude[b, i]
            up_x = 2.0 * (a * c + w * e)
            up_y = 2.0 * (e * c - w * a)
            up_z = 1.0 - 2.0 * (a * a + e * e)
            front_x, front_y, front_z = _front(w, a, e, c)
            left_x = 2.0 * (a * e - w * c)
            left_y = 1.0 - 2.0 * (a * a + c * c)
            left_z = 2.0 * (e * c + w * a)
            # How far the body's axis is from the force, as a turn, about the body's own axes.
            turn_x = (up_y * z - up_z * y) / size
            turn_y = (up_z * x - up_x * z) / size
            turn_z = (up_x * y - up_y * x) / size
            roll = turn_x * front_x + turn_y * front_y + turn_z * front_z
            pitch = turn_x * left_x + turn_y * left_y + turn_z * left_z
            yaw = math.atan2(front_y, front_x)
            lift_n = mass_kg * max(x * up_x + y * up_y + z * up_z, 0.0)
            rates = turn_rate_rps[b, i]
            roll_nm = inertia_kgm2[0] * (_TILT_GAIN * roll - _TURN_GAIN * rates[0])
            pitch_nm = inertia_kgm2[1] * (_TILT_GAIN * pitch - _TURN_GAIN * rates[1])
            yaw_nm = -inertia_kgm2[2] * (_YAW_GAIN * yaw + _YAW_RATE_GAIN * rates[2])
            for u in range(4):
                share = shares[u]
                wanted = share[0] * lift_n + share[1] * roll_nm
                wanted += share[2] * pitch_nm + share[3] * yaw_nm
                control[b, i, u] = min(max(wanted, least[u]), most[u])


# Of the rover.
_DRIVE_GAIN = 5.0  # acceleration by an error of the speed [1/s]
_HEADING_GAIN = 3.0  # turn rate by an error of the heading [1/s]
_STEER_GAIN = 10.0  # acceleration of the heading by an error of the turn rate [1/s]
_STANDS_MPS = 0.01  # slower than this, no heading is better than another


@compiled(makes_arrays=False)
def _steer_rovers(
    attitude: Float[np.ndarray, "B n 4"],
    velocity_mps: Float[np.ndarray, "B n 3"],
    turn_rate_rps: Float[np.ndarray, "B n 3"],
    wanted_mps: Float[np.ndarray, "B n 3"],
    mass_kg: float,
    inertia_kgm2: float,
    most_mps: float,
    most_rps: float,
    control: Float[np.ndarray, "B n U"],
) -> None:
    for b in range(control.shape[0]):
        for i in range(control.shape[1]):
            w, a, e, c = attitude[b, i]
            front_x, front_y, _ = _front(w, a, e, c)
            along = wanted_mps[b, i, 0] * front_x + wanted_mps[b, i, 1] * front_y
            across = wanted_mps[b, i, 1] * front_x - wanted_mps[b, i, 0] * front_y
            turn_rps = 0.0
            if along * along + across * across > _STANDS_MPS * _STANDS_MPS:
                ahead = 1.0 if along >= 0.0 else -1.0
                turn_rps = _HEADING_GAIN * math.atan2(ahead * across, ahead * along)
            turn_rps = min(max(turn_rps, -most_rps), most_rps)
            speed_mps = min(max(along, -most_mps), most_mps)
            own_mps = velocity_mps[b, i, 0] * front_x + velocity_mps[b, i, 1] * front_y
            control[b, i, 0] = mass_kg * _DRIVE_GAIN * (speed_mps - own_mps)
            turning = turn_rps - turn_rate_rps[b, i, 2]
            control[b, i, 1] = inertia_kgm2 * _STEER_GAIN * turning
