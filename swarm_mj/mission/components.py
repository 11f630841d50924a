"""Users' own parts of a swarm, each by the name `module:Name` of what makes it.

To load a part is to run its code. So only what a user named is loaded, here and now: a name that
stands in a file, such as a stored policy's or a run's, never is, unless its user gives it again.
"""

import hashlib
import importlib
import inspect
import os
import re
import sys
import sysconfig
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from swarm_mj.mission import Mission
from swarm_mj.system.fields import check_callable, did_you_mean, setting

FORM = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
GROUP, SHOWN_AS = "your own parts, each by module:Name", "MODULE:NAME"
OWN = {"group": GROUP, "metavar": SHOWN_AS, "convert": str}
CALLED_WITH = {  # the kinds of components, and the arguments of each
    "channel": ("position_m", "recipient"),
    "controller": ("buffers", "states"),
    "scene": ("spec", "mission"),
}
OF_FUNCTIONS = 2  # a channel, controller or scene that is a plain function takes two arguments
_loaded: dict[str, str] = {}  # modules that hold parts, and how a message calls the part


def is_own(name: str) -> bool:
    """Whether a name is meant as that of a user's own part."""
    return ":" in name


def is_ours(part: object) -> bool:
    """Whether a part is this package's: what it does is known, so it may be handed live arrays."""
    home = getattr(part, "__module__", None) or type(part).__module__
    return home.partition(".")[0] == __package__


def load(kind: str, name: str) -> Any:  # noqa: ANN401 - whatever has that name
    """What a user's `module:Name` names; the module is looked for in the current folder first.

    Args:
        kind: What it is to be, such as "channel", for messages.
        name: As typed.

    Raises:
        ValueError: The name has another form, leads nowhere, or the module cannot be imported.
    """
    _check_form(kind, name)
    module_name, _, attribute = name.partition(":")
    module = _import(kind, name, module_name)
    if not hasattr(module, attribute):
        hint = did_you_mean(attribute, vars(module))
        raise ValueError(f"{kind} {name}: {_place(module)} has no {attribute}{hint}")
    found = getattr(module, attribute)
    for home in (module_name, getattr(_whole(found), "__module__", None) or module_name):
        if home.partition(".")[0] != __package__ and (home == module_name or _is_users(home)):
            _loaded[home] = f"{kind} {name}"
    return found


def make(kind: str, name: str, mission: Mission) -> Any:  # noqa: ANN401 - any kind of part
    """Return a user's own part for a mission.

    What `name` names is called with the mission, or with nothing if it needs no argument. A
    function of two arguments, or an object like one, is the part itself. Either may be a
    `functools.partial`, which is how one file holds a part with several values of its numbers.

    Raises:
        ValueError: As for `load`, or what it names cannot be called so, or raises.
    """
    found = load(kind, name)
    is_class = isinstance(_whole(found), type)
    if not callable(found) or (not is_class and _num_needed(found) >= OF_FUNCTIONS):
        return found
    try:
        return _called(found, mission)
    except Exception as error:
        raise ValueError(
            f"{kind} {name} raised {_said(error, [name.partition(':')[0]])}"
        ) from error


def digest(name: str) -> str:
    """Return a hash of the file that holds a part which was loaded; empty if there is none."""
    file = getattr(sys.modules.get(name.partition(":")[0]), "__file__", None)
    return hashlib.sha256(Path(file).read_bytes()).hexdigest()[:12] if file else ""


@dataclass(frozen=True, kw_only=True)
class Components:
    """A mission's channel, controller and scene: objects or names; None is the mission's own.

    Raises:
        TypeError: One is neither a name nor something that is called as its kind is.
    """

    # Any admits objects; files and command lines hold names only.
    channel: Any = setting(None, "who decodes whose packet", shown="free space", **OWN)
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
        return {kind: _name(each) for kind, each in self.given.items()}

    @property
    def title(self) -> str:
        """The end of a flight's title."""
        return "".join(f", {kind} {name}" for kind, name in self.names.items())

    def made(self, mission: Mission) -> "Components":
        """Return the components as objects.

        Raises:
            ValueError: As for `make`, or a named channel would replace what the mission asks for.
            TypeError: As for the class.
        """
        named = {kind: each for kind, each in self.given.items() if isinstance(each, str)}
        if "channel" in named and mission.beyond_free_space:
            raise ValueError(
                f"channel {self.channel} takes the place of the mission's own, so "
                f"{mission.beyond_free_space} would change nothing; leave out either"
            )
        found = {kind: make(kind, name, mission) for kind, name in named.items()}
        for kind, each in found.items():
            if isinstance(each, type) or not callable(each):
                raise ValueError(
                    f"{kind} {named[kind]} must be a function of two arguments, or make an "
                    f"object like one, not {_shown(each)}"
                )
        return replace(self, **found)


def components_in(config: Mapping[str, Any]) -> Components:
    """Return the components that a flight's configuration or a result names."""
    return Components(**{kind: config[kind] for kind in CALLED_WITH if config.get(kind)})


@contextmanager
def one_line_each() -> Iterator[None]:
    """Within it, what a user's part raises is a ValueError of one line that names the part."""
    try:
        yield
    except (KeyboardInterrupt, MemoryError):
        raise
    except Exception as error:
        for module in _modules_within(error):
            said = f"{_loaded[module]} raised {_said(error, [module])}"
            raise ValueError(said) from error
        raise


def _check_form(kind: str, name: str) -> None:
    """Raise ValueError, with what it should be, unless a name has the form of one."""
    module, _, attribute = name.partition(":")
    if module.endswith(".py"):
        dotted = module.removesuffix(".py").removeprefix("./").replace("/", ".")
        raise ValueError(f"{kind} {name}: leave out .py: {dotted}:{attribute}")
    called = FORM.match(name)
    if called and name[called.end() :].startswith("("):
        made = f"{attribute.partition('(')[0]}, {attribute.partition('(')[2]}".replace(", )", ")")
        raise ValueError(
            f"{kind} {name}: a name cannot hold numbers; write `mine = functools.partial({made}` "
            f"into {module}.py and name {module}:mine"
        )
    if not FORM.fullmatch(name):
        raise ValueError(f"{kind} must be named module:Name, such as my_parts:Mine, not {name!r}")


def _import(kind: str, name: str, module_name: str) -> ModuleType:
    """Import a part's module; the current folder comes first from now on, as for `python -m`."""
    here = os.getcwd()
    if here not in sys.path:
        sys.path.insert(0, here)
    importlib.invalidate_caches()
    try:
        return importlib.import_module(module_name)
    except ModuleNotFoundError as error:
        if error.name is None or not f"{module_name}.".startswith(f"{error.name}."):
            raise _broken(kind, name, error, module_name) from error
        near = (path.stem for path in Path(here).glob("*.py"))
        raise ValueError(
            f"{kind} {name}: there is no module {error.name} in {here}, nor among those installed"
            f"{did_you_mean(module_name, near)}"
        ) from error
    except (Exception, SystemExit) as error:
        raise _broken(kind, name, error, module_name) from error


def _broken(kind: str, name: str, error: BaseException, module_name: str) -> ValueError:
    return ValueError(f"{kind} {name}: importing it raised {_said(error, [module_name])}")


def _said(error: BaseException, modules: list[str]) -> str:
    """An exception in one line, with the last place of these modules that it came through."""
    text = " ".join(str(error).split())[:300]
    said = f"{type(error).__name__}: {text}" if text else type(error).__name__
    frames = [
        (frame.f_code.co_filename, line)
        for frame, line in traceback.walk_tb(error.__traceback__)
        if frame.f_globals.get("__name__") in modules
    ]
    if isinstance(error, SyntaxError) or not frames:  # which says where it is itself
        return said
    file, line = frames[-1]
    return f"{said} ({os.path.relpath(file)}, line {line})"


def _modules_within(error: BaseException) -> list[str]:
    """Return the modules of parts that an exception came through, the innermost first."""
    names = [f.f_globals.get("__name__") for f, _ in traceback.walk_tb(error.__traceback__)]
    return [name for name in reversed(names) if name in _loaded]


def _is_users(home: str) -> bool:
    """Whether a module is a file that neither Python nor an installed package brought."""
    file = getattr(sys.modules.get(home), "__file__", None)
    places = [sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib")]
    return file is not None and not any(Path(file).is_relative_to(place) for place in places)


def _place(module: ModuleType) -> str:
    file = getattr(module, "__file__", None)
    return os.path.relpath(file) if file else module.__name__


def _name(component: object) -> str:
    if isinstance(component, str):
        return component
    return getattr(component, "__qualname__", type(component).__qualname__)


def _shown(part: object) -> str:
    return f"the class {part.__name__}" if isinstance(part, type) else f"{part!r:.80}"


def _parameters(found: Callable[..., Any]) -> list[inspect.Parameter]:
    """What can be given; nothing if Python cannot tell."""
    try:
        return list(inspect.signature(found).parameters.values())
    except (TypeError, ValueError):
        return []


def _positional(found: Callable[..., Any]) -> list[inspect.Parameter]:
    """What can be given by place."""
    kinds = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return [each for each in _parameters(found) if each.kind in kinds]


def _num_needed(found: Callable[..., Any]) -> int:
    return sum(each.default is inspect.Parameter.empty for each in _positional(found))


def _whole(found: object) -> object:
    """Return the function or class that a partial one is made of."""
    while isinstance(found, partial):
        found = found.func
    return found


def _called(found: Callable[..., Any], mission: Mission) -> object:
    """What it makes, given the mission if an argument is needed, or may be the mission."""
    by_place = _positional(found)
    if any(each.default is inspect.Parameter.empty for each in by_place):
        return found(mission)
    takes_mission = any(each.name == "mission" for each in _parameters(found))
    return found(mission=mission) if takes_mission else found()
