"""The scene: the arena and N robots, composed from the MJCF files in `assets/`."""

import copy
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from mujoco._enums import mjtDisableBit
from mujoco._specs import MjsGeom, MjSpec

from swarm_mj.mission import MISSION_DISTANCE_M, Mission
from swarm_mj.physics.arenas import OBSTACLE_GROUP, arena_of
from swarm_mj.physics.state import ROBOT_HEIGHT_M, ROBOT_RADIUS_M, RobotStates
from swarm_mj.system.packages import asset

Scene = Callable[[MjSpec, Mission], None]  # changes the arena before it is compiled

CONTACT_STEP_S = 0.01  # longest step of the `contact` physics: ten per window of 100 ms
ROBOT_MASS_KG = 1.0  # assets/robot.xml
WALL_HALF_THICKNESS_M = 2.0  # assets/arena.xml
WALL_HALF_HEIGHT_M = 5.0  # assets/arena.xml
NAMES = {"name", "joint"}  # attributes that hold a robot's own names, assets/robot.xml
SQUARES_PER_M = 5.0 / 1000.0  # repeats of the floor's texture, assets/arena.xml
BEACON_RADIUS_M = 8.0  # assets/robot.xml, for an area of 1 km; larger areas have larger beacons
ROBOTS_BIT = 2  # of the masks that say who collides; what scenes add has 1
# An overdamped limit that turns v into -v within one Euler step: a = -2 v / h (MuJoCo, solref in
# the direct form). Tight impedance, or part of the speed is lost.
ELASTIC_SOLIMP = [0.9999, 0.9999, 0.001, 0.5, 2.0]
# What a scene must leave: of joints, of actuators, and of MuJoCo's options.
MOVING = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))["moving"]
CAMERA_HEIGHT_PER_SIDE = 1.3  # sees the whole area at a field of view of 45 degrees


def timestep_s(mission: Mission) -> float:
    """MuJoCo's step [s]: the whole window in `exact` physics, 10 ms at most in `contact`."""
    return mission.window_s / num_substeps(mission)


def num_substeps(mission: Mission) -> int:
    """MuJoCo steps per window.

    In `contact` physics, a step takes at most 10 ms, and a robot leaves the area by at most its
    radius in one step, because a limit acts one step after it was crossed. Robots that collide
    approach each other twice as fast.
    """
    if mission.physics == "exact":
        return 1
    longest_m = ROBOT_RADIUS_M / (2.0 if mission.collide else 1.0)
    longest_s = min(CONTACT_STEP_S, longest_m / mission.max_velocity_mps)
    return math.ceil(mission.window_s / longest_s - 1e-9)


def compose(
    mission: Mission, start: RobotStates | None = None, *, scene: Scene | None = None
) -> MjSpec:
    """Return the editable model of the arena at the mission's size with its N robots.

    A start, of the first mission, is for viewers, and is also the keyframe `start`. Without it, all
    robots stand at the origin until `Physics.place` moves them. A scene changes the arena with the
    robots in it; its geoms stop robots in `contact` physics only, as `exact` has no collisions.
    Raises ValueError if the scene added, took away or renamed joints or actuators.
    """
    spec = _arena_with_robots(mission.num_robots)
    spec.option.timestep = timestep_s(mission)
    spec.modelname = f"swarm of {mission.num_robots}"
    _scale_arena(spec, mission)
    _fit_robots(spec, mission)
    if mission.collide:
        spec.option.disableflags &= ~int(mjtDisableBit.mjDSBL_CONTACT)
    for change in (arena_of(mission), scene):
        if change is not None:
            _change(spec, mission, change)
    if start is not None:
        _place_robots(spec, mission, start)
    return spec


def _arena_with_robots(num_robots: int) -> MjSpec:
    """Read the arena and as many robots as one text: `attach` takes minutes for thousands."""
    arena = ElementTree.parse(asset("arena.xml")).getroot()
    robot = ElementTree.parse(asset("robot.xml")).getroot()
    ElementTree.SubElement(arena, "actuator")
    for part in ("worldbody", "actuator"):
        (whole,) = arena.iter(part)
        for i in range(num_robots):
            added = copy.deepcopy(robot.findall(f"{part}/*"))
            for each in (each for element in added for each in element.iter()):
                for key in NAMES.intersection(each.keys()):
                    each.attrib[key] = f"r{i}/{each.attrib[key]}"
            whole.extend(added)
    return MjSpec.from_string(ElementTree.tostring(arena, encoding="unicode"))


def _change(spec: MjSpec, mission: Mission, scene: Scene) -> None:
    """Let a scene change the arena, but neither the robots' joints nor how MuJoCo steps."""
    before, flags = _motion(spec), spec.option.disableflags
    scene(spec, mission)
    after = _motion(spec)
    if list(after) != list(before):
        raise ValueError(
            "a scene may add bodies, geoms and sites, but no joints or actuators, and must leave "
            "the robots' own"
        )
    for name, value in after.items():
        if value != before[name]:
            raise ValueError(
                f"a scene must leave how robots move, but changed {name}; add geoms instead"
            )
    spec.option.timestep, spec.option.disableflags = timestep_s(mission), flags
    if mission.physics == "exact":
        spec.option.disableflags |= int(mjtDisableBit.mjDSBL_CONTACT)
        return
    spec.option.disableflags &= ~int(mjtDisableBit.mjDSBL_CONTACT)
    for i in range(mission.num_robots):
        _hull(spec, i).conaffinity |= 1  # meets the scene's geoms, no robot
    for geom in spec.geoms:
        if geom.group == OBSTACLE_GROUP:
            _bounce(geom, mission, priority=1)  # its own contact parameters count


def _hull(spec: MjSpec, i: int) -> MjsGeom:
    hull = spec.geom(f"r{i}/hull")
    if hull is None:
        raise ValueError(f"a scene must leave the robots' hulls, but deleted r{i}/hull")
    return hull


def _bounce(geom: MjsGeom, mission: Mission, priority: int = 0) -> None:
    """Make contacts elastic, as at the boundary: no friction, the normal velocity reversed."""
    geom.condim = 1
    geom.solref = [0.0, -2.0 / timestep_s(mission)]
    geom.solimp = ELASTIC_SOLIMP
    geom.priority = priority


def _motion(spec: MjSpec) -> dict[str, str]:
    """Return the numbers of joints and actuators and of MuJoCo's solver, by what they are of."""
    parts = [(part.name, part) for part in (*spec.joints, *spec.actuators)]
    return {
        f"{name} of {owner}": str(np.asarray(value).tolist())  # in which nan is nan
        for owner, part in [*parts, ("option", spec.option)]
        for name in MOVING
        if (value := getattr(part, name, None)) is not None
    }


def _place_robots(spec: MjSpec, mission: Mission, start: RobotStates) -> None:
    """Put the robots at their start: as the model's own pose, and with velocities as a keyframe.

    A viewer opens a model in its own pose and loads a keyframe only on request.
    """
    position_m, velocity_mps = start.position_m[0], start.velocity_mps[0]
    for i, (x, y) in enumerate(position_m.tolist()):
        spec.body(f"r{i}/body").pos = [x, y, ROBOT_HEIGHT_M]
        spec.joint(f"r{i}/x").ref, spec.joint(f"r{i}/y").ref = x, y
    key = spec.add_key(name="start", qpos=position_m.ravel(), qvel=velocity_mps.ravel())
    if mission.physics == "exact":  # whose servos take velocities
        key.ctrl = velocity_mps.ravel()


def _scale_arena(spec: MjSpec, mission: Mission) -> None:
    """Sizes floor, walls, camera and statistics to the area; an open area has no walls."""
    half = mission.half_side_m
    spec.stat.extent = mission.side_m
    spec.geom("floor").size = [half, half, mission.side_m / 20.0]
    repeats = mission.side_m * SQUARES_PER_M
    spec.material("floor").texrepeat = [repeats, repeats]
    spec.camera("top").pos = [0.0, 0.0, CAMERA_HEIGHT_PER_SIDE * mission.side_m]
    centre, across = half + WALL_HALF_THICKNESS_M, half + 2 * WALL_HALF_THICKNESS_M
    for name, x, y in (("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1)):
        wall = spec.geom(f"wall_{name}")
        if not mission.has_walls:
            spec.delete(wall)
            continue
        wall.pos = [x * centre, y * centre, WALL_HALF_HEIGHT_M]
        width, depth = (WALL_HALF_THICKNESS_M if axis else across for axis in (x, y))
        wall.size = [width, depth, WALL_HALF_HEIGHT_M]


def _fit_robots(spec: MjSpec, mission: Mission) -> None:
    """Set robots' beacons, the mission's bounds on them, and in `contact` their elastic walls."""
    step_s = timestep_s(mission)
    beacon_m = BEACON_RADIUS_M * max(1.0, mission.side_m / MISSION_DISTANCE_M)
    for i in range(mission.num_robots):
        spec.geom(f"r{i}/beacon").size[0] = beacon_m
        if mission.collide:
            hull = _hull(spec, i)
            hull.contype = hull.conaffinity = ROBOTS_BIT
            _bounce(hull, mission)
    force_n = ROBOT_MASS_KG * mission.max_acceleration_mps2
    for actuator in spec.actuators:
        actuator.forcerange = [-force_n, force_n]
        if mission.physics == "exact":
            actuator.set_to_velocity(kv=ROBOT_MASS_KG / step_s)
            actuator.ctrlrange = [-mission.max_velocity_mps, mission.max_velocity_mps]
        else:
            actuator.set_to_motor()
            actuator.ctrlrange = [-force_n, force_n]
    if mission.physics == "contact" and mission.has_walls:
        for joint in spec.joints:
            joint.limited = True
            joint.range = [-mission.half_side_m, mission.half_side_m]
            joint.solref_limit = [0.0, -2.0 / step_s]
            joint.solimp_limit = ELASTIC_SOLIMP
