"""Robots with bodies: their MJCF models and pilots, and how they come into a scene.

A model is one robot in a file: a body that is free, or that slides along x and y and turns about z,
with its actuators and sensors. What else is in the file, such as a floor to try it on, stays out of
the scene; its `timestep` is kept.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtJoint
from mujoco._specs import MjsBody, MjSpec
from mujoco._structs import MjModel

from swarm_mj.mission import Mission
from swarm_mj.physics.arena_files import read_mjcf, take_over_settings
from swarm_mj.physics.pilots import Airframe, Pilot, QuadrotorPilot, RoverPilot
from swarm_mj.system.arguments import check_callable, did_you_mean
from swarm_mj.system.packages import asset
from swarm_mj.system.user_code import make

LEAST_STEP_S = 0.0005
MOST_STEP_S = 0.01
FREE_QPOS = 7  # of a free base: a place and a quaternion
PLANAR_QPOS = 3  # of one that slides along x and y, and turns about z

CALLED_WITH = ("sensed", "wanted", "control")  # a pilot


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

    @property
    def is_free(self) -> bool:
        """True if its base can move and turn in all directions: it flies."""
        return int(self.model.jnt_type[0]) == int(mjtJoint.mjJNT_FREE)

    @property
    def step_s(self) -> float:
        """MuJoCo's step that the model asks for."""
        return float(self.model.opt.timestep)

    @property
    def base_m(self) -> float:
        """Height of the base over the floor, in the model's own pose."""
        return float(self.model.body_pos[1, 2])

    @property
    def reach_m(self) -> float:
        """Radius of the smallest sphere around the base that holds all that collides."""
        reach_m = 0.0
        for g in range(self.model.ngeom):
            body = int(self.model.geom_bodyid[g])
            collides = self.model.geom_contype[g] or self.model.geom_conaffinity[g]
            if body > 0 and collides:
                off_m = float(np.linalg.norm(self.model.geom_pos[g]))
                reach_m = max(reach_m, off_m + float(self.model.geom_rbound[g]))
        return reach_m

    def airframe(self, step_s: float) -> Airframe:
        """Return the model as a pilot is made for it, at this step of MuJoCo's."""
        model = self.model
        is_limited = model.actuator_ctrllimited.astype(bool)
        least, most = model.actuator_ctrlrange.T
        return Airframe(
            mass_kg=float(model.body_subtreemass[1]),
            inertia_kgm2=model.body_inertia[1].copy(),
            actuators=tuple(model.actuator(u).name for u in range(model.nu)),
            least=np.where(is_limited, least, -np.inf),
            most=np.where(is_limited, most, np.inf),
            sensors=tuple(model.sensor(s).name for s in range(model.nsensor)),
            step_s=step_s,
        )


def kinds_of(mission: Mission) -> list[RobotKind]:
    """Return the kinds of a mission's robots, in order; raise ValueError for a model refused."""
    found = []
    first = 0
    for group in mission.groups:
        spec = _read(group.kind)
        model = _compiled(group.kind, spec)
        _check(group.kind, spec, model)
        num_robots = group.num_robots
        kind = RobotKind(
            name=group.kind, first=first, num_robots=num_robots, model=model, spec=spec
        )
        found.append(kind)
        first += num_robots
    return found


def make_pilots(
    kinds: Sequence[RobotKind], step_s: float, own: Pilot | str | None = None
) -> list[Pilot]:
    """Return the pilot of each kind.

    Args:
        kinds: Of a team.
        step_s: MuJoCo's step [s].
        own: A user's, or its name, `module:Name`. It steers the robots whose model is a file;
            without such, those of the one kind that there is.

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


def _own_pilot(own: Pilot | str, airframe: Airframe) -> Pilot:
    """Return a user's pilot; a class is made for the airframe."""
    made: Any = make("pilot", own, airframe) if isinstance(own, str) else own
    check_callable("pilot", made, CALLED_WITH)
    return made


def add_robots(spec: MjSpec, kinds: Sequence[RobotKind], contype: int, conaffinity: int) -> None:
    """Add the robots to a scene, each as `r0/`, `r1/` and so on; what collides gets these masks."""
    for kind in kinds:
        take_over_settings(spec, kind.spec)
        for i in range(kind.first, kind.first + kind.num_robots):
            own = kind.spec.copy()
            added = spec.worldbody.add_frame().attach_body(_base(own), f"r{i}/", "")
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
                qpos[:3] = position_m[i]
                qpos[3:FREE_QPOS] = attitude[i]
            else:
                qpos[:2] = position_m[i, :2]
                qpos[2] = heading_of(attitude[i])
            parts.append(qpos)
    return np.concatenate(parts)


def heading_of(attitude: Float[np.ndarray, "4"]) -> float:
    """Return the turn about the vertical of a robot that stands level [rad]."""
    return 2.0 * math.atan2(attitude[3], attitude[0])


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
    except ValueError as error:  # MuJoCo's, in several lines
        raise ValueError(f"robot {kind}: {' '.join(str(error).split())}") from error


def _base(spec: MjSpec) -> MjsBody:
    """Return the one body that stands in the world."""
    return spec.worldbody.first_body()


def _check(kind: str, spec: MjSpec, model: MjModel) -> None:
    """Raise ValueError for a model that cannot be one robot of a team."""
    said = ""
    step_s = model.opt.timestep
    bases = spec.worldbody.bodies
    if len(bases) != 1:
        said = f"it has {len(bases)} bodies in the world, but a robot has one, and others within it"
    elif not _has_base(model):
        said = (
            f"body {bases[0].name or 'without a name'} is neither free nor on a plane; give it "
            "<freejoint/>, or slides along x and y and then a hinge about z"
        )
    elif model.nu == 0:
        said = "it has no actuator, so nothing could drive it"
    elif not LEAST_STEP_S <= step_s <= MOST_STEP_S:
        limits = f"from {LEAST_STEP_S:g} to {MOST_STEP_S:g} s"
        said = f"its timestep must be {limits}, not {step_s:g}; give <option timestep/>"
    elif model.neq + model.ntendon > 0:
        said = "it has equalities or tendons, which are not supported"
    if said:
        raise ValueError(f"robot {kind}: {said}")


def _has_base(model: MjModel) -> bool:
    """Return whether the first body, and no other, is on a free joint or a planar base."""
    slide, hinge = int(mjtJoint.mjJNT_SLIDE), int(mjtJoint.mjJNT_HINGE)
    of_base = np.flatnonzero(model.jnt_bodyid == 1)
    kinds = model.jnt_type[of_base].tolist()
    if kinds == [int(mjtJoint.mjJNT_FREE)]:
        return True
    is_planar = kinds == [slide, slide, hinge]
    return is_planar and bool(np.array_equal(model.jnt_axis[of_base], np.eye(3)))
