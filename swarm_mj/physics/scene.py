"""The scene: the arena and N robots, composed from the MJCF files in `assets/`."""

import copy
import math
from collections.abc import Sequence
from typing import Protocol, runtime_checkable
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtDisableBit
from mujoco._specs import MjsGeom, MjSpec
from mujoco._structs import MjModel

from swarm_mj.mission import MISSION_DISTANCE_M, Mission
from swarm_mj.mission.geometry import PLANE
from swarm_mj.physics.arenas import arena_of
from swarm_mj.physics.obstacles import OBSTACLE_GROUP, ROBOTS_BIT, SCENE_BIT
from swarm_mj.physics.pilots import GRAVITY_MPS2
from swarm_mj.physics.robot_model import PLANAR_PLACE, VELOCITY
from swarm_mj.physics.robots import RobotKind, add_robots, kinds_of, pose_of
from swarm_mj.physics.scene_guard import check_kept, hull_of, kept_parts
from swarm_mj.physics.state import ROBOT_HEIGHT_M, ROBOT_RADIUS_M, RobotStates
from swarm_mj.system.arguments import name_of
from swarm_mj.system.packages import asset


@runtime_checkable
class Scene(Protocol):
    """A change of the arena before it is compiled: any function of these two arguments.

    Example:
        >>> import mujoco
        >>> def pillar(spec, mission):
        ...     shape = mujoco.mjtGeom.mjGEOM_CYLINDER
        ...     spec.worldbody.add_geom(type=shape, size=[2.0, 5.0, 0.0], pos=[0.0, 0.0, 5.0])
    """

    def __call__(self, spec: MjSpec, mission: Mission, /) -> object:
        """Add bodies, geoms and sites; the robots, how they move and how MuJoCo steps must stay.

        Args:
            spec: MuJoCo's editable model of the arena, with the robots in it. Static geoms of
                group 1 are obstacles, which also attenuate packets.
            mission: Whose area and team it is.

        Returns:
            Anything; it is not used.
        """
        ...


CONTACT_STEP_S = 0.01  # longest step of the `contact` physics: ten per window of 100 ms
ROBOT_MASS_KG = 1.0  # assets/robot.xml
WALL_HALF_THICKNESS_M = 2.0  # assets/arena.xml
WALL_HALF_HEIGHT_M = 5.0  # assets/arena.xml
NAMES = {"name", "joint"}  # attributes that hold a robot's own names, assets/robot.xml
SQUARES_PER_M = 5.0 / 1000.0  # repeats of the floor's texture, assets/arena.xml
BEACON_RADIUS_M = 8.0  # assets/robot.xml, for an area of 1 km; larger areas have larger beacons
AIR_DENSITY = 1.204  # around bodies, at 20 °C and sea level [kg/m³]
AIR_VISCOSITY = 1.82e-5  # likewise [Pa s]
ROUNDING = 1e-9  # of a number of steps: where a step divides a window, none is added
# An overdamped limit that turns v into -v within one Euler step: a = -2 v / h (MuJoCo, solref in
# the direct form). Tight impedance, or part of the speed is lost.
ELASTIC_SOLIMP = [0.9999, 0.9999, 0.001, 0.5, 2.0]
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
    return _steps_of(mission, longest_s)


def num_body_steps(mission: Mission, kinds: Sequence[RobotKind]) -> int:
    """MuJoCo steps per window of robots with bodies: no step is longer than any model asks for."""
    return _steps_of(mission, longest_s=min(kind.step_s for kind in kinds))


def _steps_of(mission: Mission, longest_s: float) -> int:
    """Return the steps into which a window is divided, none longer than this."""
    return math.ceil(mission.window_s / longest_s - ROUNDING)


def compiled_scene(spec: MjSpec, scene: Scene | None) -> MjModel:
    """Return a composed scene as MuJoCo flies it; raise ValueError, in a line, if it cannot."""
    try:
        return spec.compile()
    except ValueError as error:  # MuJoCo's, in several lines
        if scene is None:
            raise
        said = " ".join(str(error).split())
        raise ValueError(f"the scene does not compile: {said}") from error


def compose(
    mission: Mission, start: RobotStates | None = None, *, scene: Scene | None = None
) -> MjSpec:
    """Return the editable model of the arena at the mission's size with its N robots.

    Args:
        mission: Whose arena it is.
        start: Where viewers see the robots, those of the first mission; also the keyframe `start`.
            Without it, all robots stand at the origin until `Worlds.place` moves them.
        scene: What changes the arena with the robots in it. Its geoms stop robots in `contact`
            physics only, as `exact` has no collisions.

    Returns:
        The model, which is to be compiled.

    Raises:
        ValueError: The arena is unknown, or the scene changed how robots move: it added, took away
            or renamed joints or actuators, or changed one of their numbers or the solver's.
    """
    if mission.has_bodies:
        spec = _arena_with_bodies(mission)
    else:
        spec = _arena_with_robots(mission.num_robots)
        spec.option.timestep = timestep_s(mission)
        _fit_robots(spec, mission)
        if mission.collide:
            spec.option.disableflags &= ~int(mjtDisableBit.mjDSBL_CONTACT)
    spec.modelname = f"swarm of {mission.num_robots}"
    _scale_arena(spec, mission)
    arena = arena_of(mission)
    if arena is not None:
        _change(spec, mission, arena)
    if scene is not None:
        _change(spec, mission, scene)
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
            for element in added:
                _rename(element, i)
            whole.extend(added)
    return MjSpec.from_string(ElementTree.tostring(arena, encoding="unicode"))


def _arena_with_bodies(mission: Mission) -> MjSpec:
    """Return the arena with gravity, air and a floor that carries, and the robots' models in it."""
    spec = MjSpec.from_file(str(asset("arena.xml")))
    kinds = kinds_of(mission)
    spec.option.timestep = mission.window_s / num_body_steps(mission, kinds)
    spec.option.gravity = [0.0, 0.0, -GRAVITY_MPS2]
    spec.option.density = AIR_DENSITY
    spec.option.viscosity = AIR_VISCOSITY
    for bit in (mjtDisableBit.mjDSBL_CONTACT, mjtDisableBit.mjDSBL_GRAVITY):
        spec.option.disableflags &= ~int(bit)
    spec.geom("floor").contype = SCENE_BIT
    meets = SCENE_BIT | (ROBOTS_BIT if mission.collide else 0)
    add_robots(spec, kinds, contype=ROBOTS_BIT, conaffinity=meets)
    return spec


def _rename(element: ElementTree.Element, i: int) -> None:
    """Make names in an element, and in those within it, names of robot i's own."""
    for each in element.iter():
        for key in NAMES.intersection(each.keys()):
            each.attrib[key] = f"r{i}/{each.attrib[key]}"


def _change(spec: MjSpec, mission: Mission, scene: Scene) -> None:
    """Let a scene change the arena, but neither the robots' joints nor how MuJoCo steps."""
    num_hulls = 0 if mission.has_bodies else mission.num_robots
    before = kept_parts(spec, num_hulls)
    step_s = spec.option.timestep
    flags = spec.option.disableflags
    scene(spec, mission)
    check_kept(name_of(scene), before, kept_parts(spec, num_hulls))
    spec.option.timestep = step_s
    spec.option.disableflags = flags
    if mission.has_bodies:
        return
    if mission.physics == "exact":
        spec.option.disableflags |= int(mjtDisableBit.mjDSBL_CONTACT)
        return
    spec.option.disableflags &= ~int(mjtDisableBit.mjDSBL_CONTACT)
    for i in range(mission.num_robots):
        hull_of(spec, i).conaffinity |= SCENE_BIT  # meets the scene's geoms, no robot
    for geom in spec.geoms:
        if geom.group == OBSTACLE_GROUP:
            _bounce(geom, mission, priority=1)  # its own contact parameters count


def _bounce(geom: MjsGeom, mission: Mission, priority: int = 0) -> None:
    """Make contacts elastic, as at the boundary: no friction, the normal velocity reversed."""
    geom.condim = 1
    geom.solref = [0.0, -2.0 / timestep_s(mission)]
    geom.solimp = ELASTIC_SOLIMP
    geom.priority = priority


def _place_robots(spec: MjSpec, mission: Mission, start: RobotStates) -> None:
    """Put the robots at their start: as the model's own pose, and with velocities as a keyframe.

    A viewer opens a model in its own pose and loads a keyframe only on request.
    """
    position_m = start.position_m[0]
    velocity_mps = start.velocity_mps[0]
    if start.attitude is not None:
        _place_bodies(spec, mission, position_m, velocity_mps, start.attitude[0])
        return
    for i, (x, y) in enumerate(position_m.tolist()):
        spec.body(f"r{i}/body").pos = [x, y, ROBOT_HEIGHT_M]
        spec.joint(f"r{i}/x").ref = x
        spec.joint(f"r{i}/y").ref = y
    key = spec.add_key(name="start", qpos=position_m.ravel(), qvel=velocity_mps.ravel())
    if mission.physics == "exact":  # whose servos take velocities
        key.ctrl = velocity_mps.ravel()


def _place_bodies(
    spec: MjSpec,
    mission: Mission,
    position_m: Float[np.ndarray, "N 3"],
    velocity_mps: Float[np.ndarray, "N 3"],
    attitude: Float[np.ndarray, "N 4"],
) -> None:
    """Put robots with bodies at their start: as the model's own pose, and as a keyframe."""
    kinds = kinds_of(mission)
    bases = spec.worldbody.bodies  # robots come first, in their order
    qvel = []
    for kind in kinds:
        for i in range(kind.first, kind.first + kind.num_robots):
            base = bases[i]
            own_mps = np.zeros(kind.model.nv)
            if kind.is_free:
                base.pos = position_m[i]
                base.quat = attitude[i]
                own_mps[VELOCITY] = velocity_mps[i]
            else:
                x, y = position_m[i, :PLANE].tolist()
                base.pos = [x, y, kind.base_m]
                for joint, ref in zip(base.joints[PLANAR_PLACE], (x, y), strict=True):
                    joint.ref = ref  # headings are in the keyframe: turned, it would slide aslant
                own_mps[PLANAR_PLACE] = velocity_mps[i, :PLANE]
            qvel.append(own_mps)
    qpos = pose_of(kinds, position_m, attitude)
    spec.add_key(name="start", qpos=qpos, qvel=np.concatenate(qvel))


def _scale_arena(spec: MjSpec, mission: Mission) -> None:
    """Sizes floor, walls, camera and statistics to the area; an open area has no walls."""
    half = mission.half_side_m
    spec.stat.extent = mission.side_m
    spec.geom("floor").size = [half, half, mission.side_m / 20.0]
    repeats = mission.side_m * SQUARES_PER_M
    spec.material("floor").texrepeat = [repeats, repeats]
    spec.camera("top").pos = [0.0, 0.0, CAMERA_HEIGHT_PER_SIDE * mission.side_m]
    centre = half + WALL_HALF_THICKNESS_M
    across = half + 2 * WALL_HALF_THICKNESS_M
    for name, x, y in (("east", 1, 0), ("west", -1, 0), ("north", 0, 1), ("south", 0, -1)):
        wall = spec.geom(f"wall_{name}")
        if not mission.has_walls:
            spec.delete(wall)
            continue
        wall.pos = [x * centre, y * centre, WALL_HALF_HEIGHT_M]
        width = WALL_HALF_THICKNESS_M if x else across
        depth = WALL_HALF_THICKNESS_M if y else across
        wall.size = [width, depth, WALL_HALF_HEIGHT_M]


def _fit_robots(spec: MjSpec, mission: Mission) -> None:
    """Set robots' beacons, the mission's bounds on them, and in `contact` their elastic walls."""
    step_s = timestep_s(mission)
    beacon_m = BEACON_RADIUS_M * max(1.0, mission.side_m / MISSION_DISTANCE_M)
    for i in range(mission.num_robots):
        spec.geom(f"r{i}/beacon").size[0] = beacon_m
        if mission.collide:
            hull = hull_of(spec, i)
            hull.contype = ROBOTS_BIT
            hull.conaffinity = ROBOTS_BIT
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
