"""Compiled loops: numba's `njit`, cached on disk until any code they are made of changes.

numba's own cache watches a function's file alone, and would keep what it compiled of a function or
a constant that stands elsewhere. Here the cache watches all files of the package that a function's
file imports, one after the other, so that physics can stand once and loops anywhere may call it.

The cache lies in `NUMBA_CACHE_DIR` if that is set, else in the `__pycache__` beside the file, else,
in an installation that cannot be written, in the user's cache folder. Where none of them can be
written, every process compiles anew. What is out of date is overwritten. Only files of functions
that moved within their file, or are gone, stay behind.
"""

import functools
import hashlib
import inspect
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import config, njit
from numba.core import caching
from numba.core.event import Event, Listener, install_listener

from swarm_mj.system.interrupt import held_interrupts

PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^from (\w+(?:\.\w+)*) import ", re.MULTILINE)

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(*, fastmath: bool | set[str] = False) -> Callable[[Function], Function]:
    """Compile a function when it is first called with arguments of new types.

    numba compiles a function with its first caller's assumptions on floats, `fastmath`, unless they
    are said, so here they always are. Type checkers see the function as it was.
    """
    # Checks for divisions by zero would keep loops that divide from being as fast as they can be.
    options: Any = {"fastmath": fastmath, "error_model": "numpy"}

    def decorate(function: Function) -> Function:
        plain = inspect.unwrap(function)  # of the checks that tests put around all functions
        numba: Any = config
        before, numba.CACHE_LOCATOR_CLASSES = numba.CACHE_LOCATOR_CLASSES, LOCATORS
        try:
            dispatcher: Any = _stamped(njit(cache=True, **options)(plain))
        except RuntimeError:  # no place for a cache
            dispatcher = njit(**options)(plain)
        finally:
            numba.CACHE_LOCATOR_CLASSES = before
        dispatcher.compile = _whole(dispatcher.compile)
        return cast(Function, dispatcher)

    return decorate


def _whole(compile: Function) -> Function:
    """Let a Ctrl-C wait until a function is compiled, or loaded from the cache.

    LLVM calls back into Python meanwhile. There an exception is lost, a function is left half
    made, and the process fails later, or crashes when it ends.
    """
    return cast(Function, lambda *arguments: held_interrupts()(compile)(*arguments))


def _stamped(dispatcher: Any) -> Any:  # noqa: ANN401 - numba's
    """Let numba compare the digest before it unpickles the rest of an index.

    An index of other code may name classes that no longer exist, which would end the program.
    numba compares its own version first, so the digest joins it.
    """
    dispatcher._cache._cache_file._version += digest(Path(dispatcher.py_func.__code__.co_filename))
    return dispatcher


class _Count(Listener):
    """Says how many functions are compiled, as numba says when it begins with one."""

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say, self._number = say, 0

    def on_start(self, event: Event) -> None:  # noqa: ARG002 - numba's
        self._number += 1
        self._say(f"Compiling the simulation, once for all flights: function {self._number} ...")

    def on_end(self, event: Event) -> None:
        """Say nothing more."""


def compiling(say: Callable[[str], object]) -> AbstractContextManager[None]:
    """Say within it, in a line, which function is compiled; nothing if all are in the cache."""
    return install_listener("numba:compile", _Count(say))


def digest(file: Path) -> str:
    """Return a hash of a file and of all files that it imports, directly or through others.

    Those are files of this package, and of the file's own: users compile loops across files, too.
    """
    found, waiting = set(), [file]
    while waiting:
        path = waiting.pop()
        if path not in found:
            found.add(path)
            waiting += _read(path)[1]
    hashes = [_read(path)[0] for path in sorted(found)]
    return hashlib.sha256(b"".join(hashes)).hexdigest()


@functools.cache
def _read(path: Path) -> tuple[bytes, list[Path]]:
    """Return a file's hash, and the files of this package and of its own that it imports."""
    source = path.read_bytes()
    own = path.parent
    while (own / "__init__.py").exists():
        own = own.parent
    files = []
    for name in IMPORT.findall(source.decode()):
        for module in (root.joinpath(*name.split(".")) for root in {own, PACKAGE.parent}):
            file = module / "__init__.py" if module.is_dir() else module.with_suffix(".py")
            files += [file] if file.is_file() else []
    return hashlib.sha256(source).digest(), files


class InUsersFolder(caching.UserWideCacheLocator):
    """In the user's cache folder, if there is one that can be written."""

    def ensure_cache_path(self) -> None:
        """Refuse the relative `~/.cache` of a user without a home; numba asks by this name."""
        if not Path(self.get_cache_path()).is_absolute():
            raise FileNotFoundError(self.get_cache_path())
        super().ensure_cache_path()


LOCATORS = ",".join(
    f"{place.__module__}.{place.__name__}"
    for place in (caching.UserProvidedCacheLocator, caching.InTreeCacheLocator, InUsersFolder)
)
