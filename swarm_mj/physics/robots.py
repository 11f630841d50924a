"""Robots with bodies: their MJCF models and pilots, and how they come into a scene.

A model is one robot in a file: a body that is free, or that slides along x and y and turns about z,
with its actuators and sensors. What else is in the file, such as a floor to try it on, stays out of
the scene; its `timestep` is kept.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtSensor
from mujoco._functions import mj_fullM, mju_sparse2dense
from mujoco._specs import MjSpec
from mujoco._structs import MjModel

from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import PLANE
from swarm_mj.physics.arena_files import read_mjcf, refused, take_over_settings
from swarm_mj.physics.declarations import Declarations, declared_by
from swarm_mj.physics.pilots import Airframe, Pilot, QuadrotorPilot, RoverPilot
from swarm_mj.physics.robot_checks import check_robot
from swarm_mj.physics.robot_model import (
    ABOUT_Z,
    ATTITUDE,
    FREE_QVEL,
    HEADING,
    PLACE,
    PLANAR_PLACE,
    REAL,
    TURN_RATE,
    VELOCITY,
    antenna_offset_m,
    attached,
    collides,
    is_free_base,
    is_motor,
    rest_pose,
)
from swarm_mj.physics.state import Antennas
from swarm_mj.system.arguments import check_component, did_you_mean
from swarm_mj.system.decibels import from_db
from swarm_mj.system.packages import asset
from swarm_mj.system.user_code import make

PLANAR_AXES = [0, 1, 5]  # of the six, which one on a plane has: along x and y, about z

OwnPilot = Pilot | type | str  # an object, a class that is made for an airframe, or its name
CALLED_AS_PILOT = ("sensed", "wanted", "control")
NEVER_CUT = [int(mjtSensor.mjSENS_GEOMFROMTO), int(mjtSensor.mjSENS_CONTACT)]  # by a cutoff


class Shipped(NamedTuple):
    """A robot of the package."""

    file: str  # in `assets`
    pilot: Callable[[Airframe], Pilot]


SHIPPED = {
    "quadrotor": Shipped("quadrotor.xml", QuadrotorPilot),
    "rover": Shipped("rover.xml", RoverPilot),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class RobotKind:
    """The robots of a team that are of one model."""

    name: str
    first: int  # the number of the first of them
    num_robots: int
    model: MjModel  # of one robot
    spec: MjSpec
    declared: Declarations

    @property
    def is_free(self) -> bool:
        """True if its base can move and turn in all directions: it flies."""
        return is_free_base(self.model)

    @property
    def step_s(self) -> float:
        """MuJoCo's step that the model asks for."""
        return float(self.model.opt.timestep)

    @property
    def base_m(self) -> float:
        """Height of the base over the floor, in the model's own pose."""
        return float(self.model.body_pos[1, 2])

    @property
    def antenna_m(self) -> float:
        """Height of the antenna over the base, while the robot is level; 0 without its site."""
        return float(antenna_offset_m(self.model)[2])

    @cached_property
    def reach_m(self) -> float:
        """Radius of the smallest sphere around the base that holds all that collides."""
        data = rest_pose(self.model)
        off_m = np.linalg.norm(data.geom_xpos - data.xpos[1], axis=1) + self.model.geom_rbound
        return float(np.max(off_m[collides(self.model)]))

    @cached_property
    def sensors(self) -> dict[str, slice]:
        """The columns of each sensor's numbers, by its name; those without a name are left out."""
        found: dict[str, slice] = {}
        for s in range(self.model.nsensor):
            sensor = self.model.sensor(s)
            first = int(sensor.adr[0])
            if sensor.name:
                found[sensor.name] = slice(first, first + int(sensor.dim[0]))
        return found

    @property
    def sensor_limits(self) -> Float[np.ndarray, "S"]:
        """How large each of its sensors' numbers can be, by their cutoffs; inf without one."""
        model = self.model
        is_cut = (model.sensor_cutoff > 0.0) & ~np.isin(model.sensor_type, NEVER_CUT)
        limit = np.where(is_cut, model.sensor_cutoff, np.inf)
        return np.repeat(limit, model.sensor_dim)

    @property
    def thrust_axes(self) -> Float[np.ndarray, "U 3"]:
        """Each motor's thrust on the base, in its axes, by its force before gears [1]."""
        return self._effects()[:, VELOCITY]

    @property
    def mass_kg(self) -> float:
        """The whole robot's mass."""
        return float(self.model.body_subtreemass[1])

    def _effects(self) -> Float[np.ndarray, "U 6"]:
        """Return the force and torque on the base, in its axes, by each motor's own force."""
        model = self.model
        data = rest_pose(model)
        moment = np.zeros((model.nu, model.nv))
        mju_sparse2dense(
            moment, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
        )
        axes = list(range(FREE_QVEL)) if self.is_free else PLANAR_AXES
        effect = np.zeros((model.nu, FREE_QVEL))
        effect[:, axes] = moment[:, : len(axes)]
        effect[~is_motor(model)] = 0.0
        return effect

    def _inertia_kgm2(self) -> Float[np.ndarray, "3"]:
        """Return the inertia of the whole robot about the axes of its base, joints at rest."""
        model = self.model
        full = np.zeros((model.nv, model.nv))
        mj_fullM(model, rest_pose(model), full)
        diagonal = np.diag(full)
        if self.is_free:
            return diagonal[TURN_RATE].copy()
        return np.array([np.inf, np.inf, diagonal[HEADING]])  # it turns about the vertical alone

    def airframe(self, step_s: float) -> Airframe:
        """Return the model as a pilot is made for it, at this step of MuJoCo's."""
        model = self.model
        is_limited = model.actuator_ctrllimited.astype(bool)
        least, most = model.actuator_ctrlrange.T
        return Airframe(
            mass_kg=self.mass_kg,
            inertia_kgm2=self._inertia_kgm2(),
            actuators=tuple(model.actuator(u).name for u in range(model.nu)),
            least=np.where(is_limited, least, -np.inf),
            most=np.where(is_limited, most, np.inf),
            thrust=self._effects() * model.actuator_gainprm[:, :1],
            sensors=self.sensors,
            step_s=step_s,
        )


def antennas_of(mission: Mission) -> Antennas | None:
    """Return the antennas of a mission's robots.

    Args:
        mission: Whose robots' models are read.

    Returns:
        Heights and gains; None of points, and where no model declares anything.

    Raises:
        ValueError: A model is refused.
    """
    if not mission.has_bodies:
        return None
    height_m: list[float] = []
    gain_db: list[float] = []
    power_db: list[float] = []
    for kind in kinds_of(mission):
        height_m += [kind.antenna_m] * kind.num_robots
        gain_db += [kind.declared.antenna_gain_dbi] * kind.num_robots
        power_db += [kind.declared.power_class_db] * kind.num_robots
    if not any(height_m) and not any(gain_db) and not any(power_db):
        return None
    return Antennas(
        height_m=np.array(height_m),
        gain=from_db(np.array(gain_db)),
        power=from_db(np.array(power_db)),
    )


def kinds_of(mission: Mission) -> list[RobotKind]:
    """Return the kinds of a mission's robots, in order; raise ValueError for a model refused."""
    found = []
    first = 0
    for group in mission.groups:
        spec = _read(group.kind)
        model = _compiled(group.kind, spec)
        check_robot(group.kind, spec, model)
        num_robots = group.num_robots
        kind = RobotKind(
            name=group.kind,
            first=first,
            num_robots=num_robots,
            model=model,
            spec=spec,
            declared=_declared(group.kind, model),
        )
        found.append(kind)
        first += num_robots
    return found


def sensor_columns(mission: Mission) -> list[dict[str, slice]]:
    """Return which columns of `RobotStates.sensors` belong to which sensor.

    Args:
        mission: The mission.

    Returns:
        For each kind of robots, in the order of `mission.groups`: the columns of each sensor that
        has a name. Points have none.

    Raises:
        ValueError: A model is refused.
    """
    return [kind.sensors for kind in kinds_of(mission)] if mission.has_bodies else []


def sensor_limits(kinds: Sequence[RobotKind]) -> Float[np.ndarray, "S"]:
    """Return how large each number of `RobotStates.sensors` can be, of any robot.

    S is the largest number that a kind has; robots that have fewer are padded by zeros.
    """
    most = np.zeros(max((kind.model.nsensordata for kind in kinds), default=0))
    for kind in kinds:
        width = kind.model.nsensordata
        most[:width] = np.maximum(most[:width], kind.sensor_limits)
    return most


def make_pilots(
    kinds: Sequence[RobotKind], step_s: float, own: OwnPilot | None = None
) -> list[Pilot]:
    """Return the pilot of each kind.

    Args:
        kinds: Of a team.
        step_s: MuJoCo's step [s].
        own: A user's, its class, or its name, `module:Name`. It steers the robots whose model is a
            file; without such, those of the one kind that there is.

    Returns:
        The pilots, in the order of kinds.

    Raises:
        ValueError: A kind has no pilot or is refused by it, or nothing needs the user's own, or
            that cannot be loaded.
        TypeError: It is not called as a pilot is.
    """
    has_files = any(kind.name not in SHIPPED for kind in kinds)
    if own is not None and len(kinds) > 1 and not has_files:
        names = " or ".join(kind.name for kind in kinds)
        raise ValueError(
            f"a pilot could steer each {names} here; give one for a single kind, or for an MJCF "
            "file among several"
        )
    pilots = []
    for kind in kinds:
        is_file = kind.name not in SHIPPED
        airframe = kind.airframe(step_s)
        if own is not None and (is_file or not has_files):
            pilots.append(_own_pilot(own, airframe))
        elif is_file:
            raise ValueError(
                f"robot {kind.name} needs a pilot, which makes its controls; give --pilot "
                "module:Name"
            )
        else:
            pilots.append(SHIPPED[kind.name].pilot(airframe))
    return pilots


def _own_pilot(own: OwnPilot, airframe: Airframe) -> Pilot:
    """Return a user's pilot; a class is made for the airframe."""
    made: Any = own
    if isinstance(own, str):
        made = make("pilot", own, airframe)
    elif isinstance(own, type):
        made = own(airframe)
    check_component("pilot", made, CALLED_AS_PILOT)
    return made


def add_robots(spec: MjSpec, kinds: Sequence[RobotKind], contype: int, conaffinity: int) -> None:
    """Add the robots to a scene, each as `r0/`, `r1/` and so on; what collides gets these masks."""
    for kind in kinds:
        take_over_settings(spec, kind.spec)
        for i in range(kind.first, kind.first + kind.num_robots):
            added = attached(spec, kind.spec.copy(), i)
            for geom in added.find_all("geom"):
                if geom.contype or geom.conaffinity:
                    geom.contype = contype
                    geom.conaffinity = conaffinity


def pose_of(
    kinds: Sequence[RobotKind],
    position_m: Float[np.ndarray, "N 3"],
    attitude: Float[np.ndarray, "N 4"],
) -> Float[np.ndarray, "Q"]:
    """Return MuJoCo's coordinates of a team: its bases there, all other joints at rest."""
    parts = []
    for kind in kinds:
        for i in range(kind.first, kind.first + kind.num_robots):
            qpos = kind.model.qpos0.copy()
            if kind.is_free:
                qpos[PLACE] = position_m[i]
                qpos[ATTITUDE] = attitude[i]
            else:
                qpos[PLANAR_PLACE] = position_m[i, :PLANE]
                qpos[HEADING] = heading_of(attitude[i])
            parts.append(qpos)
    return np.concatenate(parts)


def heading_of(attitude: Float[np.ndarray, "4"]) -> float:
    """Return the turn about the vertical of a robot that stands level [rad]."""
    return 2.0 * math.atan2(attitude[ABOUT_Z], attitude[REAL])


def _read(kind: str) -> MjSpec:
    """Return a kind's model, or raise ValueError in one line."""
    if kind in SHIPPED:
        return MjSpec.from_file(str(asset(SHIPPED[kind].file)))
    if not kind.endswith((".xml", ".mjcf")):
        known = f"point, {', '.join(SHIPPED)}, or an MJCF file"
        raise ValueError(f"robot must be {known}, not {kind!r}{did_you_mean(kind, SHIPPED)}")
    if not Path(kind).is_file():
        raise ValueError(f"robot {kind}: there is no such file")
    return read_mjcf("robot", kind)


def _compiled(kind: str, spec: MjSpec) -> MjModel:
    try:
        return spec.compile()
    except ValueError as error:
        raise refused("robot", kind, error) from error


def _declared(kind: str, model: MjModel) -> Declarations:
    numerics: dict[str, np.ndarray] = {}
    for n in range(model.nnumeric):
        numeric = model.numeric(n)
        numerics[numeric.name] = numeric.data
    try:
        return declared_by(numerics)
    except ValueError as error:
        raise refused("robot", kind, error) from error
