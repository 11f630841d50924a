"""Arenas: obstacles in the area, at a size that grows with the team.

Obstacles attenuate packets and, in `contact` physics, reflect robots. They are the static geoms of
group `OBSTACLE_GROUP`. The penetration loss of one is its first `user` number [dB]; without one, or
with 0, that of its material's name (`MATERIALS`), or `DEFAULT_LOSS_DB`.

To add an arena, write its function beside what it is made of, and name it in `ARENAS`.
"""

import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from mujoco._enums import mjtGeom
from mujoco._functions import mj_kinematics
from mujoco._specs import MjSpec
from mujoco._structs import MjData, MjModel

from swarm_mj.mission import Mission
from swarm_mj.mission.specification import OPEN, SQUARE_METRES_PER_KM2
from swarm_mj.physics.state import BOX, KINDS, ROBOT_HEIGHT_M, ROBOT_RADIUS_M, Obstacles
from swarm_mj.system.decibels import from_db
from swarm_mj.system.fields import did_you_mean

Arena = Callable[[MjSpec, Mission], None]  # adds the obstacles

OBSTACLE_GROUP = 1
MESH = 7  # as MuJoCo numbers it
BOX_SHAPE = mjtGeom.mjGEOM_BOX
CYLINDER_SHAPE = mjtGeom.mjGEOM_CYLINDER
HALF_HEIGHT_M = 5.0  # of obstacles: well above the robots
NOT_FINITE = ("nan", "inf", "infinity")
FOLDERS = ("meshdir", "texturedir", "assetdir")  # of files that a compiler element names
MAX_COPIES = 10_000  # by all <replicate>s of a file; more would be compiled for minutes
SIZES = ("memory", "njmax", "nconmax", "nuserdata")  # of what MuJoCo keeps
NAMING = ("name", "class", "childclass", "material", "mesh", "file")  # attributes that are text
DEFAULT_LOSS_DB = 10.0  # of obstacles in a file that neither say their loss nor name a material

MATERIALS: dict[str, "Material"] = {}  # by name; making one enters it here


@dataclass(frozen=True, kw_only=True)
class Material:
    """A material of obstacles; geoms, those of a file too, name it."""

    name: str
    loss_db: float  # per obstacle crossed [dB]
    rgba: tuple[float, float, float, float]  # red, green, blue and opacity, from 0 to 1
    source: str  # of the loss

    def __post_init__(self) -> None:
        MATERIALS[self.name] = self


def arena_of(mission: Mission) -> Arena | None:
    """Return the arena of a mission, or raise ValueError; None is the paper's, which is empty."""
    name = mission.arena
    if name in ARENAS:
        return ARENAS[name]
    if os.path.isfile(name):
        return _from_file
    if os.path.isdir(name):
        raise ValueError(f"arena {name} is a directory; name an MJCF file in it")
    if Path(name).suffix or os.sep in name:
        raise ValueError(f"arena {name}: there is no such file")
    known = f"one of {', '.join(ARENAS)}, or an MJCF file"
    raise ValueError(f"arena must be {known}, not {name!r}{did_you_mean(name, ARENAS)}")


def notes_on(mission: Mission) -> list[str]:
    """Return a note on each obstacle in a file that neither robots nor packets can meet."""
    if arena_of(mission) is not _from_file:
        return []
    idle = idle_obstacles(_read(mission.arena).compile(), mission)
    return [
        f"arena {mission.arena}: {name} does nothing, as it stands {where}"
        for name, where in idle.items()
    ]


BLOCK_PITCH_M = 200.0  # from street to street
BLOCK_M = 110.0  # side of a city block; the rest of the pitch is street
BUILDING = Material(
    name="building",
    loss_db=25.0,
    rgba=(0.36, 0.40, 0.47, 1.0),
    source="two outer walls of 7 dB (COST 231 1999, section 4.7) and the rooms between them",
)


def blocks(spec: MjSpec, mission: Mission) -> None:
    """Add a city: square blocks with streets between them and around them."""
    num = max(1, round(mission.side_m / BLOCK_PITCH_M))
    pitch_m = mission.side_m / num
    middles_m = [(n - (num - 1) / 2.0) * pitch_m for n in range(num)]
    for x, y in product(middles_m, middles_m):
        _add(spec, BUILDING, BOX_SHAPE, (x, y), (BLOCK_M / 2.0, BLOCK_M / 2.0))


ROOM_M = 170.0  # side of a room
DOOR_M = 25.0  # width of the door in the middle of every wall between two rooms
WALL_M = 1.0  # thickness of these walls
LIGHT_WALL = Material(
    name="light wall",
    loss_db=3.4,
    rgba=(0.45, 0.50, 0.58, 1.0),
    source="COST 231 (1999), section 4.7, at 1.8 GHz",
)
HEAVY_WALL = Material(  # for files: no arena of the package has it
    name="heavy wall",
    loss_db=6.9,
    rgba=(0.40, 0.44, 0.52, 1.0),
    source="COST 231 (1999), section 4.7, at 1.8 GHz",
)


def rooms(spec: MjSpec, mission: Mission) -> None:
    """Add an office floor: square rooms, with a door in the middle of every wall between two."""
    num = max(1, round(mission.side_m / ROOM_M))
    side_m = mission.side_m / num
    half_m = (side_m - DOOR_M) / 4.0  # of the wall on either side of a door
    off_m = side_m / 2.0 - half_m
    for across in range(1, num):
        wall = across * side_m - mission.half_side_m
        for along in range(num):
            middle = (along + 0.5) * side_m - mission.half_side_m
            for side in (-off_m, off_m):
                _add(spec, LIGHT_WALL, BOX_SHAPE, (wall, middle + side), (WALL_M / 2.0, half_m))
                _add(spec, LIGHT_WALL, BOX_SHAPE, (middle + side, wall), (half_m, WALL_M / 2.0))


TREES_PER_KM2 = 100.0
TREE_RADIUS_M = 6.0
TREE = Material(
    name="tree",
    loss_db=6.0,
    rgba=(0.20, 0.38, 0.30, 1.0),
    source="12 m of leaves at about 0.5 dB/m (ITU-R P.833)",
)


def forest(spec: MjSpec, mission: Mission) -> None:
    """Add trees, spread evenly but not in rows: the points of Halton (1960) in bases 2 and 3."""
    num = round(TREES_PER_KM2 * mission.side_m**2 / SQUARE_METRES_PER_KM2)
    for n in range(1, num + 1):
        x = (_halton(n, base=2) - 0.5) * mission.side_m
        y = (_halton(n, base=3) - 0.5) * mission.side_m
        _add(spec, TREE, CYLINDER_SHAPE, (x, y), (TREE_RADIUS_M, HALF_HEIGHT_M))


ARENAS: dict[str, Arena | None] = {OPEN: None, "blocks": blocks, "forest": forest, "rooms": rooms}


def _from_file(spec: MjSpec, mission: Mission) -> None:
    """Add the contents of a user's MJCF file, or raise ValueError."""
    theirs = _read(mission.arena)
    try:
        model = theirs.compile()
        num_obstacles = len(obstacles_of(model).kind)
    except ValueError as error:
        raise _refused(mission.arena, error) from error
    if theirs.joints:
        moves = theirs.joints[0].parent.name or "a body without a name"
        raise ValueError(f"arena {mission.arena}: {moves} has a joint, but obstacles stand still")
    if num_obstacles == 0:
        raise ValueError(
            f"arena {mission.arena} has no obstacle, which is any geom of group {OBSTACLE_GROUP} "
            f'but a plane or a height field; give walls group="{OBSTACLE_GROUP}"'
        )
    idle = idle_obstacles(model, mission)
    if len(idle) == num_obstacles:
        name, where = next(iter(idle.items()))
        said = f"no obstacle can do anything; {name} stands {where}"
        raise ValueError(f"arena {mission.arena}: {said}")
    for settings in ("option", "visual", "stat"):
        _take_over(getattr(spec, settings), getattr(theirs, settings))
    for size in SIZES:
        setattr(theirs, size, getattr(spec, size))
    spec.nuser_geom = max(spec.nuser_geom, theirs.nuser_geom)  # or their losses would be cut off
    spec.attach(theirs, frame=spec.worldbody.add_frame(), prefix="arena/")


def _take_over(ours: object, theirs: object) -> None:
    """Put our settings in place of a file's, which do not count: MuJoCo warns of each, twice."""
    for name in dir(ours):
        value = getattr(ours, name)
        if name.startswith("_") or callable(value):
            continue
        if isinstance(value, np.ndarray):
            getattr(theirs, name)[:] = value
        elif isinstance(value, int | float):
            setattr(theirs, name, value)
        else:
            _take_over(value, getattr(theirs, name))


def _read(file: str) -> MjSpec:
    """Read an MJCF file; raise ValueError in one line that names the file, as MuJoCo does not."""
    path = Path(file).absolute()  # MuJoCo finds what included files include by no other
    try:
        elements = list(_elements(path))
        folders = {path.parent}
        for element in elements:
            if element.tag == "compiler":
                leads = (element.get(key) for key in FOLDERS)
                folders.update(path.parent / lead for lead in leads if lead)
        for element in elements:
            _check_element(element, folders)
        _check_copies(path)
        return MjSpec.from_file(str(path))
    except ValueError as error:
        raise _refused(file, error) from error


def _elements(path: Path, above: tuple[Path, ...] = ()) -> Iterator[ElementTree.Element]:
    """Yield the elements of a file, which those above include, and of those that it includes."""
    files = (*above, path)
    folders = {files[0].parent, path.parent}  # MuJoCo looks in both
    try:
        root = ElementTree.parse(path)
    except ElementTree.ParseError as error:
        line = error.position[0]
        said = str(error).partition(":")[0]
        raise ValueError(f"{path.name}, line {line}: not well-formed XML ({said})") from error
    for element in root.iter():
        yield element
        if element.tag == "include":
            _check_element(element, folders)  # before it is opened
            for included in _included(element, files):
                yield from _elements(included, files)


def _included(element: ElementTree.Element, files: tuple[Path, ...]) -> Iterator[Path]:
    """Yield the files that an element includes, but for those that it stands in: `files`."""
    if element.tag != "include":
        return
    for folder in {files[0].parent, files[-1].parent}:  # MuJoCo looks in both
        included = folder / element.get("file", "")
        if included.is_file() and not any(map(included.samefile, files)):
            yield included


def _check_element(element: ElementTree.Element, folders: set[Path]) -> None:
    """Raise ValueError for numbers that are none, and for pipes and replicas without an end."""
    for key, value in element.attrib.items():
        if key in NAMING:
            continue
        for word in value.lower().split():
            if word.lstrip("+-") in NOT_FINITE:
                named = element.get("name", "without a name")
                raise ValueError(f"{element.tag} {named} has {word} in {key}")
    _check_file(element, folders)


def _check_copies(path: Path) -> None:
    """Raise ValueError if a file's counts, multiplied where they are nested, are too many."""
    num_copies = 0
    for copies in _copies(path, 1):
        num_copies += copies
        if num_copies > MAX_COPIES:
            raise ValueError(
                f"its counts, multiplied where one is within another, make {num_copies} copies or "
                f"more; {MAX_COPIES} are allowed"
            )


def _copies(path: Path, around: int, above: tuple[Path, ...] = ()) -> Iterator[int]:
    """Yield how many copies each count of a file, and of those it includes, adds to one of each."""
    files = (*above, path)
    left = [(ElementTree.parse(path).getroot(), around)]
    while left:  # an element within thousands of others would be too deep for a function's calls
        element, outer = left.pop()
        copies = outer * _count_of(element)
        if copies > outer:
            yield copies - outer
        for included in _included(element, files):
            yield from _copies(included, copies, files)
        left.extend((inner, copies) for inner in element)


def _count_of(element: ElementTree.Element) -> int:
    """Return how often an element stands for what it holds: its counts, multiplied."""
    number = 1.0
    for word in element.get("count", "").split():
        with suppress(ValueError):  # MuJoCo says what it is; here it is no number
            number *= max(1.0, float(word))
    return int(min(number, 2.0 * MAX_COPIES))


def _check_file(element: ElementTree.Element, folders: set[Path]) -> None:
    """Raise ValueError for what a file's name leads to, but is none: MuJoCo would wait for it."""
    name = element.get("file")
    if not name:
        return
    for folder in folders:
        path = folder / name
        if path.exists() and not path.is_file():
            raise ValueError(f"{element.tag} {name} is a folder, a pipe or a device; name a file")


def _refused(file: str, error: ValueError) -> ValueError:
    return ValueError(f"arena {file}: {' '.join(str(error).split())}")


def _add(
    spec: MjSpec,
    material: Material,
    shape: mjtGeom,
    centre_m: tuple[float, float],
    size_m: tuple[float, float],
) -> None:
    """Add an obstacle that stands on the floor: half sides of a box, or radius and half height."""
    if spec.material(material.name) is None:
        spec.add_material(name=material.name, rgba=list(material.rgba))
    spec.worldbody.add_geom(
        type=shape,
        pos=[*centre_m, HALF_HEIGHT_M],
        size=[*size_m, HALF_HEIGHT_M],
        material=material.name,
        group=OBSTACLE_GROUP,
        contype=1,
        conaffinity=0,
    )


def _halton(n: int, base: int) -> float:
    """Return the n-th point of the van der Corput sequence, in (0, 1)."""
    share = 1.0 / base
    point = 0.0
    while n > 0:
        n, digit = divmod(n, base)
        point += digit * share
        share /= base
    return point


def obstacles_of(model: MjModel) -> Obstacles:
    """Return the obstacles of a compiled scene, or raise ValueError by a loss (`loss_db_of`)."""
    data = MjData(model)
    mj_kinematics(model, data)
    found = np.array(obstacle_geoms(model), dtype=int)
    kind = model.geom_type[found].copy()
    size_m = model.geom_size[found].copy()
    centre_m = data.geom_xpos[found].copy()
    rotation = data.geom_xmat[found].reshape(-1, 3, 3).copy()
    for o in np.flatnonzero(kind == MESH):
        middle_m, half_m = np.split(model.geom_aabb[found[o]], 2)
        centre_m[o] += rotation[o] @ middle_m
        kind[o] = BOX
        size_m[o] = half_m
    is_finite = np.isfinite(np.column_stack([centre_m, size_m])).all(axis=1)
    if not np.all(is_finite):
        g = int(found[np.argmin(is_finite)])
        named = model.geom(g).name or f"number {g}"
        raise ValueError(f"geom {named} is of infinite size, or infinitely far; give it numbers")
    return Obstacles(
        kind=kind.astype(np.int64),
        centre_m=centre_m,
        rotation=rotation,
        size_m=size_m,
        reach_m=np.maximum(model.geom_rbound[found], 0.0),
        power_left=from_db(-np.array([loss_db_of(model, int(g)) for g in found])),
    )


def obstacle_geoms(model: MjModel) -> list[int]:
    """Return the geoms that are obstacles."""
    stands_still = model.body_weldid[model.geom_bodyid] == 0
    is_solid = np.isin(model.geom_type, (*KINDS, MESH))
    is_obstacle = stands_still & is_solid & (model.geom_group == OBSTACLE_GROUP)
    return np.flatnonzero(is_obstacle).tolist()


def idle_obstacles(model: MjModel, mission: Mission) -> dict[str, str]:
    """Return the obstacles that neither robots nor packets can meet, and where they stand."""
    reach_m = mission.half_side_m if mission.has_walls else np.inf  # from the centre, per axis
    found = obstacles_of(model)
    idle: dict[str, str] = {}
    for o, g in enumerate(obstacle_geoms(model)):
        # Of the box around it that MuJoCo keeps, in the obstacle's frame; a ball may be narrower.
        half_m = np.abs(found.rotation[o]) @ model.geom_aabb[g, 3:]
        half_m = np.minimum(half_m, found.reach_m[o])
        name = f"geom {model.geom(g).name or f'number {g}'}"
        off_m = np.abs(found.centre_m[o] - [0.0, 0.0, ROBOT_HEIGHT_M]) - half_m
        if np.any(off_m[:2] > reach_m):
            idle[name] = f"outside the area of {2 * reach_m:.0f} m by {2 * reach_m:.0f} m"
        elif off_m[2] > ROBOT_RADIUS_M:
            side = "above" if found.centre_m[o, 2] > ROBOT_HEIGHT_M else "below"
            idle[name] = f"{side} the robots, which are {ROBOT_HEIGHT_M:g} m above the floor"
    return idle


def loss_db_of(model: MjModel, g: int) -> float:
    """Return an obstacle's penetration loss [dB]; raise ValueError if negative or not finite."""
    material = int(model.geom_matid[g])
    named = model.mat(material).name if material >= 0 else ""
    known = MATERIALS.get(named)
    loss_db = DEFAULT_LOSS_DB if known is None else known.loss_db
    if model.nuser_geom > 0 and model.geom_user[g, 0] != 0.0:  # 0 where a geom has none
        loss_db = float(model.geom_user[g, 0])
    if not (np.isfinite(loss_db) and loss_db >= 0.0):
        geom = f"geom {model.geom(g).name or f'number {g}'}"
        raise ValueError(f"the penetration loss of {geom} must be 0 dB or more, not {loss_db:g}")
    return loss_db
