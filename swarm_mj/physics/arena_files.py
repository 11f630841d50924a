"""MJCF files of a user's, checked before MuJoCo reads them, and arenas made of them."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
from mujoco._specs import MjSpec

from swarm_mj.mission import Mission
from swarm_mj.physics.obstacles import OBSTACLE_GROUP, idle_obstacles, obstacles_of

NOT_FINITE = ("nan", "inf", "infinity")
FOLDERS = ("meshdir", "texturedir", "assetdir")  # of files that a compiler element names
MAX_COPIES = 10_000  # by all <replicate>s of a file; more would be compiled for minutes
SIZES = ("memory", "njmax", "nconmax", "nuserdata")  # of what MuJoCo keeps
NAMING = ("name", "class", "childclass", "material", "mesh", "file")  # attributes that are text


def add_file(spec: MjSpec, mission: Mission) -> None:
    """Add the contents of a user's MJCF file, or raise ValueError."""
    theirs = read_arena(mission.arena)
    try:
        model = theirs.compile()
        num_obstacles = len(obstacles_of(model).kind)
    except ValueError as error:
        raise refused("arena", mission.arena, error) from error
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
    take_over_settings(spec, theirs)
    spec.nuser_geom = max(spec.nuser_geom, theirs.nuser_geom)  # or their losses would be cut off
    spec.attach(theirs, frame=spec.worldbody.add_frame(), prefix="arena/")


def take_over_settings(ours: MjSpec, theirs: MjSpec) -> None:
    """Put a scene's settings in place of a file's that is attached: MuJoCo warns of each, twice."""
    for settings in ("option", "visual", "stat"):
        _take_over(getattr(ours, settings), getattr(theirs, settings))
    for size in SIZES:
        setattr(theirs, size, getattr(ours, size))


def _take_over(ours: object, theirs: object) -> None:
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


def read_arena(file: str) -> MjSpec:
    """Read an arena's MJCF file, as `read_mjcf` does."""
    return read_mjcf("arena", file)


def read_mjcf(what: str, file: str) -> MjSpec:
    """Read an MJCF file, which is an arena or a robot.

    Raises ValueError in one line that names the file, as MuJoCo does not.
    """
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
        raise refused(what, file, error) from error


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


def refused(what: str, file: str, error: ValueError) -> ValueError:
    """Return the refusal of a file in one line; MuJoCo says it in several."""
    return ValueError(f"{what} {file}: {' '.join(str(error).split())}")
