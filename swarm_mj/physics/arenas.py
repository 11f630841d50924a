"""Arenas: obstacles in the area, at a size that grows with the team.

Obstacles (`physics.solid_geoms`) attenuate packets and, in `contact` physics, reflect robots.
"""

import os
from collections.abc import Callable
from itertools import product
from pathlib import Path
from xml.etree import ElementTree

from mujoco._enums import mjtGeom
from mujoco._specs import MjSpec

from swarm_mj.mission import Mission
from swarm_mj.mission.specification import OPEN
from swarm_mj.physics.solid_geoms import OBSTACLE_GROUP, idle_obstacles, obstacles_of
from swarm_mj.system.fields import did_you_mean

Arena = Callable[[MjSpec, Mission], None]  # adds the obstacles

HALF_HEIGHT_M = 5.0  # of obstacles: well above the robots
BLOCK_PITCH_M = 200.0  # from street to street
BLOCK_M = 110.0  # side of a city block; the rest of the pitch is street
ROOM_M = 170.0  # side of a room
DOOR_M = 25.0  # width of the door in the middle of every wall between two rooms
WALL_M = 1.0  # thickness of these walls
NAMING = ("name", "class", "childclass", "material", "mesh", "file")  # attributes that are text
TREES_PER_KM2 = 100.0
TREE_RADIUS_M = 6.0
COLOURS = {
    "building": [0.36, 0.40, 0.47, 1.0],
    "light wall": [0.45, 0.50, 0.58, 1.0],
    "tree": [0.20, 0.38, 0.30, 1.0],
}


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
    idle = idle_obstacles(_read(mission.arena).compile(), mission).items()
    return [
        f"arena {mission.arena}: {name} does nothing, as it stands {where}" for name, where in idle
    ]


def blocks(spec: MjSpec, mission: Mission) -> None:
    """Add a city: square blocks with streets between them and around them."""
    num = max(1, round(mission.side_m / BLOCK_PITCH_M))
    pitch_m = mission.side_m / num
    middles_m = [(n - (num - 1) / 2.0) * pitch_m for n in range(num)]
    for x, y in product(middles_m, middles_m):
        _add(spec, "building", "box", (x, y), (BLOCK_M / 2.0, BLOCK_M / 2.0))


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
                _add(spec, "light wall", "box", (wall, middle + side), (WALL_M / 2.0, half_m))
                _add(spec, "light wall", "box", (middle + side, wall), (half_m, WALL_M / 2.0))


def forest(spec: MjSpec, mission: Mission) -> None:
    """Add trees, spread evenly but not in rows: the points of Halton (1960) in bases 2 and 3."""
    for n in range(1, round(TREES_PER_KM2 * mission.side_m**2 / 1e6) + 1):
        x, y = ((_halton(n, base) - 0.5) * mission.side_m for base in (2, 3))
        _add(spec, "tree", "cylinder", (x, y), (TREE_RADIUS_M, HALF_HEIGHT_M))


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
        raise ValueError(f"arena {mission.arena} has no obstacle: {_why_none(theirs)}")
    idle = idle_obstacles(model, mission)
    if len(idle) == num_obstacles:
        name, where = next(iter(idle.items()))
        said = f"no obstacle can do anything; {name} stands {where}"
        raise ValueError(f"arena {mission.arena}: {said}")
    spec.nuser_geom = max(spec.nuser_geom, theirs.nuser_geom)  # or their losses would be cut off
    spec.attach(theirs, frame=spec.worldbody.add_frame(), prefix="arena/")


def _read(file: str) -> MjSpec:
    """Read an MJCF file; raise ValueError in one line that names the file, as MuJoCo does not."""
    try:
        for element in ElementTree.parse(file).iter():
            for name, value in element.attrib.items():
                if name not in NAMING and "nan" in value.lower().split():
                    named = element.get("name", "without a name")
                    raise ValueError(f"{element.tag} {named} has a nan in {name}")
        return MjSpec.from_file(file)
    except ElementTree.ParseError as error:
        line, said = error.position[0], str(error).partition(":")[0]
        raise ValueError(f"arena {file}, line {line}: not well-formed XML ({said})") from error
    except ValueError as error:
        raise _refused(file, error) from error


def _refused(file: str, error: ValueError) -> ValueError:
    return ValueError(f"arena {file}: {' '.join(str(error).split())}")


def _why_none(theirs: MjSpec) -> str:
    """Explain why a file holds no obstacle, and what to do."""
    if not theirs.geoms:
        why = "it has no geom; add walls"
    elif any(geom.group == OBSTACLE_GROUP for geom in theirs.geoms):
        why = f"its geoms of group {OBSTACLE_GROUP} are planes or height fields; give it boxes"
    else:
        why = f'none of its geoms is of group {OBSTACLE_GROUP}; give walls group="{OBSTACLE_GROUP}"'
    return f"{why}, or choose arena {OPEN}"


def _add(
    spec: MjSpec, material: str, shape: str, centre_m: tuple[float, ...], size_m: tuple[float, ...]
) -> None:
    if spec.material(material) is None:
        spec.add_material(name=material, rgba=COLOURS[material])
    spec.worldbody.add_geom(
        type=getattr(mjtGeom, f"mjGEOM_{shape.upper()}"),
        pos=[*centre_m, HALF_HEIGHT_M],
        size=[*size_m, HALF_HEIGHT_M],
        material=material,
        group=OBSTACLE_GROUP,
        contype=1,
        conaffinity=0,
    )


def _halton(n: int, base: int) -> float:
    """Return the n-th point of the van der Corput sequence, in (0, 1)."""
    share, point = 1.0 / base, 0.0
    while n > 0:
        n, digit = divmod(n, base)
        point += digit * share
        share /= base
    return point
