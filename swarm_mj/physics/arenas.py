"""Arenas: obstacles in the area, at a size that grows with the team.

Obstacles attenuate packets and, in `contact` physics, reflect robots. To add an arena, write its
function here, of a material of `physics.materials`, and name it in `ARENAS`.
"""

import os
from collections.abc import Callable
from itertools import product
from pathlib import Path

from mujoco._enums import mjtGeom
from mujoco._specs import MjSpec

from swarm_mj.mission import Mission
from swarm_mj.mission.surroundings import OPEN
from swarm_mj.mission.team import SQUARE_METRES_PER_KM2
from swarm_mj.physics.arena_files import add_file, read_arena
from swarm_mj.physics.materials import BUILDING, LIGHT_WALL, TREE, Material
from swarm_mj.physics.obstacles import OBSTACLE_GROUP, SCENE_BIT, idle_obstacles
from swarm_mj.system.arguments import did_you_mean

Arena = Callable[[MjSpec, Mission], None]  # adds the obstacles

BOX_SHAPE = mjtGeom.mjGEOM_BOX
CYLINDER_SHAPE = mjtGeom.mjGEOM_CYLINDER
HALF_HEIGHT_M = 5.0  # of obstacles: they end above points and rovers, and below most that flies


def arena_of(mission: Mission) -> Arena | None:
    """Return the arena of a mission, or raise ValueError; None is the paper's, which is empty."""
    name = mission.arena
    if name in ARENAS:
        return ARENAS[name]
    if os.path.isfile(name):
        return add_file
    if os.path.isdir(name):
        raise ValueError(f"arena {name} is a directory; name an MJCF file in it")
    if Path(name).suffix or os.sep in name:
        raise ValueError(f"arena {name}: there is no such file")
    known = f"one of {', '.join(ARENAS)}, or an MJCF file"
    raise ValueError(f"arena must be {known}, not {name!r}{did_you_mean(name, ARENAS)}")


def notes_on(mission: Mission) -> list[str]:
    """Return a note on each obstacle in a file that neither robots nor packets can meet."""
    if arena_of(mission) is not add_file:
        return []
    idle = idle_obstacles(read_arena(mission.arena).compile(), mission)
    return [
        f"arena {mission.arena}: {name} does nothing, as it stands {where}"
        for name, where in idle.items()
    ]


BLOCK_PITCH_M = 200.0  # from street to street
BLOCK_M = 110.0  # side of a city block; the rest of the pitch is street


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


def forest(spec: MjSpec, mission: Mission) -> None:
    """Add trees, spread evenly but not in rows: the points of Halton (1960) in bases 2 and 3."""
    num = round(TREES_PER_KM2 * mission.side_m**2 / SQUARE_METRES_PER_KM2)
    for n in range(1, num + 1):
        x = (_halton(n, base=2) - 0.5) * mission.side_m
        y = (_halton(n, base=3) - 0.5) * mission.side_m
        _add(spec, TREE, CYLINDER_SHAPE, (x, y), (TREE_RADIUS_M, HALF_HEIGHT_M))


ARENAS: dict[str, Arena | None] = {OPEN: None, "blocks": blocks, "forest": forest, "rooms": rooms}


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
        contype=SCENE_BIT,
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
