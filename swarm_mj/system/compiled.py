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
from contextlib import AbstractContextManager, suppress
from pathlib import Path
from typing import Any, TypeVar, cast

from numba.core import caching, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.event import Event, Listener, install_listener
from numba.core.registry import CPUDispatcher
from numba.core.runtime.nrt import rtsys

from swarm_mj.system.interrupt import held_interrupts

PACKAGE = Path(__file__).parents[1]
IMPORT = re.compile(r"^from (\w+(?:\.\w+)*) import ", re.MULTILINE)

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(
    *, fastmath: bool | set[str] = False, forceinline: bool = False, makes_arrays: bool = True
) -> Callable[[Function], Function]:
    """Compile a function when it is first called with arguments of new types.

    numba compiles a function with its first caller's assumptions on floats, `fastmath`, unless they
    are said, so here they always are. `forceinline` makes callers take it in: a call with many
    arrays takes longer than a short function. Counting references to arrays takes longer than short
    loops do; a function that neither makes nor returns arrays can do without it. Type checkers see
    the function as it was.
    """
    # Checks for divisions by zero would keep loops that divide from being as fast as they can be.
    options = dict(nopython=True, fastmath=fastmath, error_model="numpy", forceinline=forceinline)
    options["_nrt"] = makes_arrays

    def decorate(function: Function) -> Function:
        plain = inspect.unwrap(function)  # of the checks that tests put around all functions
        return cast(Function, _Loop(plain, options))

    return decorate


class _Loop(CPUDispatcher):
    """A function for Python and, compiled apart, the same for other compiled functions.

    To take Python's objects apart and to make new ones takes half of the time to compile a small
    function. What compiled functions call need not, and is a part of what they are cached as.
    """

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        """Prepare both, and a place for the cache of the first, if there is one."""
        options = {**options, "no_cfunc_wrapper": True}
        super().__init__(function, targetoptions=options)
        options = {**options, "no_cpython_wrapper": True}
        self.inner = CPUDispatcher(function, targetoptions=options, pipeline_class=_PartCompiler)
        with suppress(RuntimeError, OSError):  # no place for a cache, or no file, as in notebooks
            self._cache = _Cache(function)

    @property
    def _numba_type_(self) -> types.Dispatcher:
        """The function that compiled ones call under this name."""
        return types.Dispatcher(self.inner)

    @held_interrupts()
    def compile(self, sig: Any) -> Any:  # noqa: ANN401 - numba's
        """Let a Ctrl-C wait until a function is compiled, or loaded from the cache."""
        # LLVM calls back into Python meanwhile. There an exception is lost, a function is left half
        # made, and the process fails later, or crashes when it ends.
        entry = super().compile(sig)
        for result in self.overloads.values():
            for env in result._find_referenced_environments():
                result.library.codegen.set_env(env.env_name, env)
        return entry


class _PartCompiler(Compiler):
    """Compiles a part of functions that call it."""

    def define_pipelines(self) -> Any:  # noqa: ANN401 - numba's
        """Name the library that the part goes to, and leave the rest as it is."""
        state = self.state
        state.library = _Part(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()


class _Part(JITCodeLibrary):
    """Code that is optimised and made a machine's where it is called, and not before."""

    # By itself nobody calls it, and to optimise it alone, then again in every caller and in theirs,
    # takes half of the time.

    def _optimize_final_module(self) -> None:
        """Leave that to the function that it becomes a part of."""

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True

    @property
    def codegen(self) -> Any:  # noqa: ANN401 - numba's
        """Who is asked to note the constants of what can run: here nobody."""
        return self

    def set_env(self, name: str, env: object) -> None:
        """Wait for the function that this becomes a part of."""


class _Cache(caching.FunctionCache):
    """A function's cache, which the digest of its files keeps up to date."""

    def __init__(self, function: Callable[..., Any]) -> None:
        """Let numba compare the digest before it unpickles the rest of an index."""
        # An index of other code may name classes that no longer exist, which would end the program,
        # and so may one of the same file imported by another name. numba compares its own version
        # first, so digest and name join it.
        super().__init__(function)
        file = Path(function.__code__.co_filename)
        self._cache_file._version += sources_digest(file) + function.__module__

    def load_overload(self, sig: Any, target_context: Any) -> Any:  # noqa: ANN401 - numba's
        """Load a function without all that numba imports to compile one, which takes 0.5 s."""
        rtsys.initialize(target_context)
        return self._load_overload(sig, target_context)


class _Count(Listener):
    """Says how many functions are compiled, as numba says when it begins with one."""

    def __init__(self, say: Callable[[str], object]) -> None:
        self._say = say
        self._number = 0

    def on_start(self, event: Event) -> None:  # noqa: ARG002 - numba's
        self._number += 1
        self._say(f"Compiling what is new here, once for later runs: function {self._number} ...")

    def on_end(self, event: Event) -> None:
        """Say nothing more."""


def compiling(say: Callable[[str], object]) -> AbstractContextManager[None]:
    """Say within it, in a line, which function is compiled; nothing if all are in the cache."""
    return install_listener("numba:compile", _Count(say))


def sources_digest(file: Path) -> str:
    """Return a hash of a file and all that it imports, directly or not, of its package and ours."""
    found: set[Path] = set()
    waiting = [file]
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
