"""Arenas in files: a user's MJCF, which is checked before MuJoCo reads it."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree

from mujoco._specs import MjSpec

from swarm_mj.mission import Mission
from swarm_mj.physics.obstacles import OBSTACLE_GROUP, idle_obstacles, obstacles_of

NOT_FINITE = ("nan", "inf", "infinity")
FOLDERS = ("meshdir", "texturedir", "assetdir")  # of files that a compiler element names
MAX_REPLICAS = 10_000  # of a <replicate>; more would be compiled for minutes
NAMING = ("name", "class", "childclass", "material", "mesh", "file")  # attributes that are text


def add_file(spec: MjSpec, mission: Mission) -> None:
    """Add the contents of a user's MJCF file, or raise ValueError."""
    theirs = read_arena(mission.arena)
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
    spec.nuser_geom = max(spec.nuser_geom, theirs.nuser_geom)  # or their losses would be cut off
    spec.attach(theirs, frame=spec.worldbody.add_frame(), prefix="arena/")


def read_arena(file: str) -> MjSpec:
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
            for folder in folders:
                included = folder / element.get("file", "")
                if included.is_file() and not any(map(included.samefile, files)):
                    yield from _elements(included, files)


def _check_element(element: ElementTree.Element, folders: set[Path]) -> None:
    """Raise ValueError for numbers that are none, and for pipes and replicas without an end."""
    for key, value in element.attrib.items():
        if key in NAMING:
            continue
        for word in value.lower().split():
            if word.lstrip("+-") in NOT_FINITE:
                named = element.get("name", "without a name")
                raise ValueError(f"{element.tag} {named} has {word} in {key}")
    _check_count(element)
    _check_file(element, folders)


def _check_count(element: ElementTree.Element) -> None:
    """Raise ValueError for more replicas than compile in a while."""
    count = element.get("count", "")
    if element.tag == "replicate" and count.isdigit() and int(count) > MAX_REPLICAS:
        raise ValueError(f"replicate has a count of {count}; {MAX_REPLICAS} are allowed")


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
