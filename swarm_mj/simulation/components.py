"""A mission's channel, controller, scene and pilot: its own, a user's objects, or their names."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, TypedDict

from swarm_mj.control.motion import Controller
from swarm_mj.mission import Mission
from swarm_mj.physics.robots import CALLED_AS_PILOT, OwnPilot
from swarm_mj.physics.scene import Scene
from swarm_mj.radio.effects import beyond_free_space
from swarm_mj.radio.free_space import OwnChannel, VaryingChannel
from swarm_mj.radio.gain_table import GainTable
from swarm_mj.system.arguments import check_component, name_of
from swarm_mj.system.fields import setting
from swarm_mj.system.user_code import call, file_of, files_named, make

OWN_PARTS = "your own parts, each by module:Name"
SHOWN_AS = "MODULE:NAME"
OWN = {"group": OWN_PARTS, "metavar": SHOWN_AS, "convert": str}
CALLED_WITH = {  # the kinds of components, and the arguments of each
    "channel": ("position_m", "recipient"),
    "controller": ("buffers", "states"),
    "scene": ("spec", "mission"),
    "pilot": CALLED_AS_PILOT,
}
TABLE = "table:"  # begins the name of a channel that is a table of gains


class GivenParts(TypedDict, total=False):
    """Keywords of `Swarm`: objects or names, of those kinds alone that are not the mission's."""

    channel: OwnChannel
    controller: Controller | str
    scene: Scene | str
    pilot: OwnPilot


def _files(component: object) -> list[Path]:
    """Return the files that a component's name leads to; an object has none."""
    if not isinstance(component, str):
        return []
    if component.startswith(TABLE):
        return [Path(component.removeprefix(TABLE))]
    return files_named(component)


@dataclass(frozen=True, kw_only=True)
class Components:
    """A mission's channel, controller, scene and pilot: objects or names; None is its own.

    Raises TypeError for what is neither a name nor called as its kind is.
    """

    # Any, since the reader of files makes no types that are protocols: files and command lines hold
    # names only. Objects are checked for how they are called.
    channel: Any = setting(
        None, "who decodes whom; or table:FILE", shown="free space", reads=_files, **OWN
    )
    controller: Any = setting(
        None, "what drives the robots", shown="the task's", reads=_files, **OWN
    )
    scene: Any = setting(
        None,
        "a function that edits the MuJoCo model; an MJCF file is an --arena",
        shown="none",
        reads=_files,
        **OWN,
    )
    pilot: Any = setting(
        None,
        "what makes the controls of robots with bodies",
        shown="the robot's",
        reads=_files,
        **OWN,
    )

    def __post_init__(self) -> None:
        for kind, component in self.given.items():
            # A channel that varies from slot to slot is asked for each slot's, not called.
            is_varying = kind == "channel" and isinstance(component, VaryingChannel)
            is_class = kind == "pilot" and isinstance(component, type)  # made for its robots
            if not isinstance(component, str) and not is_varying and not is_class:
                check_component(kind, component, CALLED_WITH[kind])

    @property
    def given(self) -> GivenParts:
        """Those that are not the mission's own, by their kind."""
        given: GivenParts = {}
        if self.channel is not None:
            given["channel"] = self.channel
        if self.controller is not None:
            given["controller"] = self.controller
        if self.scene is not None:
            given["scene"] = self.scene
        if self.pilot is not None:
            given["pilot"] = self.pilot
        return given

    @property
    def names(self) -> dict[str, str]:
        """The names of those given; of an object, its function's or its class's."""
        names: dict[str, str] = {}
        for kind, component in self.given.items():
            names[kind] = component if isinstance(component, str) else name_of(component)
        return names

    @property
    def title(self) -> str:
        """The end of a flight's title."""
        return "".join(f", {kind} {name}" for kind, name in self.names.items())

    def made(self, mission: Mission) -> "Components":
        """Return objects in place of names, but for a pilot's, which is made for its robots.

        Args:
            mission: What they are made for.

        Returns:
            The components; what was an object is the same object.

        Raises:
            ValueError: One cannot be loaded or made, is not called as its kind is, is a channel's
                name that takes the place of effects that the mission asks for, or a pilot of
                points. A channel that is an object may take their place: it may hold them itself.
        """
        made = self
        for kind, name in self.given.items():
            if kind == "pilot" and not mission.has_bodies:
                raise ValueError(
                    "a pilot steers robots with bodies, and a point needs none; choose a robot"
                )
            if not isinstance(name, str) or kind == "pilot":
                continue
            if kind == "channel" and beyond_free_space(mission):
                raise ValueError(
                    f"channel {name} takes the place of the mission's own, so "
                    f"{beyond_free_space(mission)} would change nothing; leave out one of them"
                )
            try:
                part = _made(kind, name, mission)
                if part is None or isinstance(part, str):  # which else stand for what is not made
                    check_component(kind, part, CALLED_WITH[kind])
                made = replace(made, **{kind: part})
            except TypeError as error:
                raise ValueError(f"{kind} {name}: {error}") from error
        return made


def components_in(config: Mapping[str, Any]) -> Components:
    """Return the components that a flight's configuration or a result names."""
    return Components(**{kind: config[kind] for kind in CALLED_WITH if config.get(kind)})


def digest(name: str) -> str:
    """Return a hash of the table, or of the file of loaded code; empty if there is none."""
    file = Path(name.removeprefix(TABLE)) if name.startswith(TABLE) else file_of(name)
    return hashlib.sha256(file.read_bytes()).hexdigest()[:12] if file else ""


def _made(kind: str, name: str, mission: Mission) -> object:
    if kind == "channel" and name.startswith(TABLE):
        table = partial(GainTable, path=Path(name.removeprefix(TABLE)))
        return call(kind, name, table, mission)
    try:
        return make(kind, name, mission)
    except ValueError as error:
        if kind == "scene" and Path(name).suffix == ".xml":
            raise ValueError(f"{error}; to use an MJCF file: --arena {name}") from error
        raise
