"""Arenas: what stands in the area, at a size that grows with the team.

Their geoms are obstacles (`physics.solid_geoms`): packets lose power in them and, in `contact`
physics, robots turn round at them.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

from mujoco._enums import mjtGeom
from mujoco._specs import MjSpec

from swarm_mj.mission import Mission
from swarm_mj.mission.specification import OPEN
from swarm_mj.physics.solid_geoms import OBSTACLE_GROUP, obstacles_of

Arena = Callable[[MjSpec, Mission], None]  # adds what stands in the area

HALF_HEIGHT_M = 5.0  # of obstacles: well above the robots
BLOCK_PITCH_M = 200.0  # from street to street
BLOCK_M = 110.0  # side of a city block; the rest of the pitch is street
ROOM_M = 170.0  # side of a room
DOOR_M = 25.0  # width of the door in the middle of every wall between two rooms
WALL_M = 1.0  # thickness of these walls
TREES_PER_KM2 = 100.0
TREE_RADIUS_M = 6.0
COLOURS = {
    "building": [0.36, 0.40, 0.47, 1.0],
    "light wall": [0.45, 0.50, 0.58, 1.0],
    "tree": [0.20, 0.38, 0.30, 1.0],
}


def arena_of(mission: Mission) -> Arena | None:
    """What stands in a mission's area; None for the paper's, which is empty.

    Raises:
        ValueError: There is no such arena, and no such file.
    """
    if mission.arena in ARENAS:
        return ARENAS[mission.arena]
    if not Path(mission.arena).is_file():
        raise ValueError(
            f"arena must be one of {', '.join(ARENAS)}, or an MJCF file, not {mission.arena!r}"
        )
    return _from_file


def blocks(spec: MjSpec, mission: Mission) -> None:
    """A city: square blocks with streets between them and around them."""
    num = max(1, round(mission.side_m / BLOCK_PITCH_M))
    pitch_m = mission.side_m / num
    for x, y in _grid(num, pitch_m):
        _add(spec, "building", "box", (x, y), (BLOCK_M / 2.0, BLOCK_M / 2.0))


def rooms(spec: MjSpec, mission: Mission) -> None:
    """An office floor: square rooms, with a door in the middle of every wall between two."""
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
    """Trees, spread evenly but in no rows: the points of Halton (1960) in bases 2 and 3."""
    for n in range(1, round(TREES_PER_KM2 * mission.side_m**2 / 1e6) + 1):
        x, y = ((_halton(n, base) - 0.5) * mission.side_m for base in (2, 3))
        _add(spec, "tree", "cylinder", (x, y), (TREE_RADIUS_M, HALF_HEIGHT_M))


ARENAS: dict[str, Arena | None] = {
    OPEN: None,
    "blocks": blocks,
    "forest": forest,
    "rooms": rooms,
}


def _from_file(spec: MjSpec, mission: Mission) -> None:
    """What an MJCF file of the user's holds.

    Raises:
        ValueError: MuJoCo does not take it, something moves in it, or it has no obstacle.
    """
    try:
        theirs = MjSpec.from_file(mission.arena)
        obstacles = obstacles_of(theirs.compile())
    except ValueError as error:
        said = " ".join(str(error).split())
        raise ValueError(f"arena {mission.arena}: {said}") from error
    if theirs.joints:
        moves = theirs.joints[0].parent.name or "a body without a name"
        raise ValueError(f"arena {mission.arena}: {moves} has a joint, but obstacles stand still")
    if len(obstacles.kind) == 0:
        raise ValueError(
            f"arena {mission.arena} has no obstacle, as none of its geoms is of group "
            f'{OBSTACLE_GROUP}; give walls group="{OBSTACLE_GROUP}", or choose arena {OPEN}'
        )
    spec.nuser_geom = max(spec.nuser_geom, theirs.nuser_geom)  # or their losses would be cut off
    spec.attach(theirs, frame=spec.worldbody.add_frame(), prefix="arena/")


def _grid(num: int, pitch_m: float) -> Iterator[tuple[float, float]]:
    """The middles of num by num squares around the origin [m]."""
    middles = [(n - (num - 1) / 2.0) * pitch_m for n in range(num)]
    yield from ((x, y) for x in middles for y in middles)


def _add(
    spec: MjSpec,
    material: str,
    shape: str,
    centre_m: tuple[float, float],
    size_m: tuple[float, float],
) -> None:
    """Adds an upright obstacle."""
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
    """The n-th point of the van der Corput sequence, in (0, 1)."""
    share, point = 1.0 / base, 0.0
    while n > 0:
        n, digit = divmod(n, base)
        point += digit * share
        share /= base
    return point
