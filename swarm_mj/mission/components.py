"""Components of a mission from users: objects, or code named `module:Name`.

To load code is to run it. So only what a user named is loaded, here and now: a name that stands in
a file, such as a stored policy's or a run's, never is, unless its user gives it again.
"""

import hashlib
import importlib
import inspect
import os
import re
import sys
import sysconfig
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from swarm_mj.mission import Mission
from swarm_mj.mission.presets import beyond_free_space
from swarm_mj.system.fields import check_callable, did_you_mean, name_of, setting, unwrapped

FORM = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
GROUP, SHOWN_AS = "your own parts, each by module:Name", "MODULE:NAME"
OWN = {"group": GROUP, "metavar": SHOWN_AS, "convert": str}
CALLED_WITH = {  # the kinds of components, and the arguments of each
    "channel": ("position_m", "recipient"),
    "controller": ("buffers", "states"),
    "scene": ("spec", "mission"),
}
TABLE, TABLE_CHANNEL = "table:", "swarm_mj.radio.gain_table:GainTable"
PACKAGE = __name__.partition(".")[0]
_loaded: dict[str, str] = {}  # modules of users' code, and what a message calls it


@dataclass(frozen=True, kw_only=True)
class Components:
    """A mission's channel, controller and scene: objects or names; None is the mission's own.

    Raises TypeError for what is neither a name nor called as its kind is.
    """

    # Any admits objects; files and command lines hold names only.
    channel: Any = setting(None, "who decodes whom; or table:FILE", shown="free space", **OWN)
    controller: Any = setting(None, "what drives the robots", shown="the task's", **OWN)
    scene: Any = setting(None, "a function that adds obstacles", shown="none", **OWN)

    def __post_init__(self) -> None:
        for kind, component in self.given.items():
            # A channel that varies from slot to slot is asked for each slot's, not called.
            if not isinstance(component, str) and not hasattr(component, "at"):
                check_callable(kind, component, CALLED_WITH[kind])

    @property
    def given(self) -> dict[str, Any]:
        """Those that are not the mission's own, by their kind."""
        return {kind: each for kind in CALLED_WITH if (each := getattr(self, kind)) is not None}

    @property
    def names(self) -> dict[str, str]:
        """The names of those given; of an object, its function's or its class's."""
        given = self.given.items()
        return {kind: each if isinstance(each, str) else name_of(each) for kind, each in given}

    @property
    def title(self) -> str:
        """The end of a flight's title."""
        return "".join(f", {kind} {name}" for kind, name in self.names.items())

    def made(self, mission: Mission) -> "Components":
        """Return objects; raise as `make`, or for a channel that replaces what is asked for."""
        named = {kind: each for kind, each in self.given.items() if isinstance(each, str)}
        if "channel" in named and beyond_free_space(mission):
            raise ValueError(
                f"channel {self.channel} takes the place of the mission's own, so "
                f"{beyond_free_space(mission)} would change nothing; leave out one of them"
            )
        made = self
        for kind, name in named.items():
            try:
                made = replace(made, **{kind: make(kind, name, mission)})
            except TypeError as error:
                raise ValueError(f"{kind} {name}: {error}") from error
        return made


def components_in(config: Mapping[str, Any]) -> Components:
    """Return the components that a flight's configuration or a result names."""
    return Components(**{kind: config[kind] for kind in CALLED_WITH if config.get(kind)})


def is_own(name: str) -> bool:
    """Return whether a name is meant as that of a user's own code."""
    return ":" in name


def is_ours(component: object) -> bool:
    """Return whether it is this package's, and so may be handed live arrays: it writes none."""
    home = getattr(component, "__module__", None) or type(component).__module__
    return home.partition(".")[0] == PACKAGE


def load(kind: str, name: str) -> object:
    """Return what a user's `module:Name` names; the current folder is searched first.

    `kind` says for messages what it is to be, such as "channel". Raises ValueError if the name has
    another form, leads nowhere, or the module cannot be imported.
    """
    if not FORM.fullmatch(name):
        raise ValueError(f"{kind} must be named module:Name, such as my_parts:Mine, not {name!r}")
    module_name, _, attribute = name.partition(":")
    module = _import(kind, name, module_name)
    if not hasattr(module, attribute):
        file = getattr(module, "__file__", None)
        place = os.path.relpath(file) if file else module_name
        hint = did_you_mean(attribute, vars(module))
        raise ValueError(f"{kind} {name}: {place} has no {attribute}{hint}")
    found = getattr(module, attribute)
    # Errors are blamed on the module named, and on that which it took the code from.
    home = getattr(unwrapped(found), "__module__", None) or module_name
    for each in (module_name, *([home] if is_users(home) else [])):
        if each.partition(".")[0] != PACKAGE:
            _loaded[each] = f"{kind} {name}"
    return found


def make(kind: str, name: str, mission: Mission) -> object:
    """Return a user's own component for a mission.

    What `name` names is called with the mission, or with nothing if it needs no argument. A
    function of two arguments, or an object like one, is the component itself. Either may be a
    `functools.partial`, by which one file holds a component with several values of its numbers.
    Raises ValueError as `load` does, and if what it names cannot be called so, or raises.
    """
    is_table = kind == "channel" and name.startswith(TABLE)
    found: Any = load(kind, TABLE_CHANNEL if is_table else name)  # its room may not be imported
    if is_table:
        found = partial(found, path=Path(name.removeprefix(TABLE)))
    if not callable(found):
        return found
    try:
        takes = inspect.signature(found).parameters
    except (TypeError, ValueError):  # of what is not Python's own
        takes = {}
    by_place = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    is_needed = [p.kind in by_place and p.default is p.empty for p in takes.values()]
    if sum(is_needed) > 1 and not isinstance(unwrapped(found), type):
        return found
    try:
        if any(is_needed):
            return found(mission)
        return found(mission=mission) if "mission" in takes else found()
    except (Exception, SystemExit) as error:
        said = _in_a_line(error, name.partition(":")[0])
        raise ValueError(f"{kind} {name} raised {said}") from error


def digest(name: str) -> str:
    """Return a hash of the table, or of the file of loaded code; empty if there is none."""
    table = name.removeprefix(TABLE) if name.startswith(TABLE) else ""
    file = table or getattr(sys.modules.get(name.partition(":")[0]), "__file__", None)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:12] if file else ""


@contextmanager
def one_line_each() -> Iterator[None]:
    """Turn what users' code raises within it into a ValueError of one line that names the code."""
    try:
        yield
    except (KeyboardInterrupt, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        # What stops a generator comes out of it as another error, whose cause has the frames.
        causes = [each for each in (error, error.__cause__) if each is not None]
        frames = [each for cause in causes for each in traceback.walk_tb(cause.__traceback__)]
        modules = [frame.f_globals.get("__name__", "") for frame, _ in frames]
        theirs = [module for module in modules if module in _loaded]
        if not theirs:
            raise
        innermost = theirs[-1]  # as it raised
        said = f"{_loaded[innermost]} raised {_in_a_line(causes[-1], innermost)}"
        raise ValueError(said) from error


def _import(kind: str, name: str, module_name: str) -> ModuleType:
    """Import a module; the current folder comes first from now on, as for `python -m`."""
    here = os.getcwd()
    if here not in sys.path:
        sys.path.insert(0, here)
    importlib.invalidate_caches()  # or a file that was just written would not be found
    try:
        return importlib.import_module(module_name)
    except (Exception, SystemExit) as error:
        missing = error.name if isinstance(error, ModuleNotFoundError) else None
        if missing is None or not f"{module_name}.".startswith(f"{missing}."):
            said = _in_a_line(error, module_name)
            raise ValueError(f"{kind} {name}: importing it raised {said}") from error
        near = (path.stem for path in Path(here).glob("*.py"))
        raise ValueError(
            f"{kind} {name}: there is no module {missing} in {here}, nor among those installed"
            f"{did_you_mean(module_name, near)}"
        ) from error


def _in_a_line(error: BaseException, module: str) -> str:
    """Return an exception in one line, with the last place in a module that it came through."""
    text = " ".join(str(error).split())[:300]
    said = f"{type(error).__name__}: {text}" if text else type(error).__name__
    frames = traceback.walk_tb(error.__traceback__)
    theirs = [each for each in frames if each[0].f_globals.get("__name__") == module]
    if isinstance(error, SyntaxError) or not theirs:  # which says where it is itself
        return said
    frame, line = theirs[-1]
    return f"{said} ({os.path.relpath(frame.f_code.co_filename)}, line {line})"


def is_users(home: str) -> bool:
    """Return whether a module is a file that neither Python nor an installed package brought."""
    file = getattr(sys.modules.get(home), "__file__", None)
    places = [sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib")]
    return file is not None and not any(Path(file).is_relative_to(place) for place in places)
