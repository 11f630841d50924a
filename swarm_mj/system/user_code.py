"""Users' code, named `module:Name`: it is loaded and called, and its errors take one line.

To load code is to run it. So only what a user named is loaded, here and now: a name that stands in
a file, such as a stored policy's or a run's, never is, unless its user gives it again.
"""

import importlib
import inspect
import os
import re
import sys
import sysconfig
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType

from swarm_mj.system.arguments import did_you_mean, unwrapped

FORM = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")
ARGUMENT = "mission"  # the name of the one argument that users' code may ask for
PACKAGE = __name__.partition(".")[0]
WRONG_ARGUMENTS = "incompatible function arguments"  # begins a message of several lines
_loaded: dict[str, str] = {}  # modules of users' code, and what a message calls it


def is_own(name: str) -> bool:
    """Return whether a name is meant as that of a user's own code."""
    return ":" in name


def is_ours(component: object) -> bool:
    """Return whether it is this package's, and so may be handed live arrays: it writes none."""
    home = getattr(component, "__module__", None) or type(component).__module__
    return _is_of_the_package(home)


def load(kind: str, name: str) -> object:
    """Return what a user's `module:Name` names; the current folder is searched first.

    Args:
        kind: What it is to be, such as "channel", for messages.
        name: `module:Name`.

    Returns:
        The class, function or object.

    Raises:
        ValueError: The name has another form or leads nowhere, or the module cannot be imported.
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
    to_blame = [module_name]
    if is_users(home):
        to_blame.append(home)
    for module_to_blame in to_blame:
        if not _is_of_the_package(module_to_blame):
            _loaded[module_to_blame] = f"{kind} {name}"
    return found


def make(kind: str, name: str, argument: object) -> object:
    """Return what a user's own `module:Name` makes.

    Args:
        kind: What it is to be, such as "channel", for messages.
        name: `module:Name`.
        argument: The mission, for what asks for it (see `call`).

    Returns:
        The object, which may be of any type.

    Raises:
        ValueError: It cannot be loaded (see `load`), or raised when it was called.
    """
    return call(kind, name, load(kind, name), argument)


def call(kind: str, name: str, found: object, argument: object) -> object:
    """Return what users' code makes, or the code itself, where that is what they mean.

    A class or a function is called with the argument, or with nothing if it needs none. A function
    that needs two arguments, or an object like one, is returned as it is. Either may be a
    `functools.partial`, by which one file holds a component with several values of its numbers.

    Args:
        kind: What it is to be, for messages.
        name: What the user called it, for messages.
        found: What that name leads to.
        argument: What it is called with: by place, or as `mission` if it has a default for that.

    Returns:
        The object, which may be of any type.

    Raises:
        ValueError: It raised anything; the message names the file and the line.
    """
    if not callable(found):
        return found
    takes = _parameters(found)
    needed = [parameter for parameter in takes.values() if _is_needed(parameter)]
    if len(needed) > 1 and not isinstance(unwrapped(found), type):
        return found
    try:
        if needed:
            return found(argument)
        if ARGUMENT in takes:
            return found(**{ARGUMENT: argument})
        return found()
    except (Exception, SystemExit) as error:
        said = _in_a_line(error, name.partition(":")[0])
        raise ValueError(f"{kind} {name} raised {said}") from error


def file_of(name: str) -> Path | None:
    """Return the file of the loaded code that `module:Name` names; None if there is none."""
    file = getattr(sys.modules.get(name.partition(":")[0]), "__file__", None)
    return Path(file) if file else None


def files_named(name: str) -> list[Path]:
    """Return the files that may hold the code of `module:Name`: to look is not to load it."""
    module, colon, _ = name.partition(":")
    if not colon:
        return []
    here = Path(*module.split("."))
    files = [here.with_suffix(".py"), here / "__init__.py"]
    loaded = file_of(name)
    if loaded is not None:
        files.append(loaded)
    return files


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
        theirs: list[str] = []
        for cause in causes:
            for frame, _ in traceback.walk_tb(cause.__traceback__):
                module = frame.f_globals.get("__name__", "")
                if module in _loaded:
                    theirs.append(module)
        if not theirs:
            raise
        innermost = theirs[-1]  # as it raised
        said = f"{_loaded[innermost]} raised {_in_a_line(causes[-1], innermost)}"
        raise ValueError(said) from error


def _is_of_the_package(module: str) -> bool:
    """Return whether a module is this package's, by its dotted name."""
    return module.partition(".")[0] == PACKAGE


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
    text = " ".join(_without_signatures(str(error)).split())[:300]
    said = f"{type(error).__name__}: {text}" if text else type(error).__name__
    frames = traceback.walk_tb(error.__traceback__)
    theirs = [each for each in frames if each[0].f_globals.get("__name__") == module]
    if isinstance(error, SyntaxError) or not theirs:  # which says where it is itself
        return said
    frame, line = theirs[-1]
    return f"{said} ({os.path.relpath(frame.f_code.co_filename)}, line {line})"


def _without_signatures(text: str) -> str:
    """Return a message of pybind11 without the list of all that it would have taken."""
    lines = text.strip().splitlines()
    if WRONG_ARGUMENTS in text and len(lines) > 1:
        return f"{WRONG_ARGUMENTS}; {lines[-1]}"
    return text


def _parameters(found: Callable[..., object]) -> Mapping[str, inspect.Parameter]:
    """Return the parameters of what is to be called; none if they are not known."""
    try:
        return inspect.signature(found).parameters
    except (TypeError, ValueError):  # of what is not Python's own
        return {}


def _is_needed(parameter: inspect.Parameter) -> bool:
    """Return whether a call must give this parameter, by place."""
    by_place = (inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD)
    return parameter.kind in by_place and parameter.default is parameter.empty


def is_users(home: str) -> bool:
    """Return whether a module is a file that neither Python nor an installed package brought."""
    file = getattr(sys.modules.get(home), "__file__", None)
    places = [sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib")]
    return file is not None and not any(Path(file).is_relative_to(place) for place in places)
