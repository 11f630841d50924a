"""The cache of compiled functions, in a small package of its own."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest
from numba.core.errors import NumbaError

import swarm_mj.system.compiled
import swarm_mj.system.interrupt
from swarm_mj.system.compiled import _read, compiled, sources_digest

PHYSICS = """
from typing import NamedTuple
from swarm_mj.system.compiled import compiled
HALF = {half}
class {name}(NamedTuple):
    x: float
@compiled()
def scaled(pair: {name}) -> float:
    return {factor} * pair.x
"""
LOOP = """
from swarm_mj.system.compiled import compiled
from swarm_mj.physics import HALF, {name}, scaled
@compiled(fastmath=True)
def total(n: int) -> float:
    return HALF * n + scaled({name}(1.0))
"""
RUN = """
from swarm_mj.loop import total
print(total(4), sum(total.stats.cache_hits.values()), total.stats.cache_path)
"""
# Presses Ctrl-C where LLVM calls back into Python, both when a function is compiled and when it is
# loaded, and then uses the function all the same.
INTERRUPTED = """
import signal
from numba.core.codegen import JITCodeLibrary
finalize = JITCodeLibrary.finalize
def interrupted(self):
    signal.raise_signal(signal.SIGINT)
    return finalize(self)
JITCodeLibrary.finalize = interrupted
signal.signal(signal.SIGINT, signal.default_int_handler)
from swarm_mj.loop import total
try:
    print("was not interrupted", total(4))
except KeyboardInterrupt:
    print(sum(map(len, (total.stats.cache_hits, total.stats.cache_misses))), total(4))
"""
ASSUMED = """
from swarm_mj.physics import scaled
if total.stats.cache_misses:
    print(*(" fast " in str(function.inspect_llvm()) for function in (total, scaled.inner)))
"""
SAID = """
from swarm_mj.system.compiled import compiling
from swarm_mj.loop import total
with compiling(print):
    total(4)
"""
# How often the function inside is compiled, and whether all that numba compiles with is imported.
PARTS = """
import sys
from swarm_mj.loop import total
from swarm_mj.physics import Pair, scaled
total(4)
print("numba.np.arraymath" in sys.modules, len(scaled.signatures), len(scaled.inner.signatures))
print(scaled(Pair(2.0)))
"""


class Checkout:
    """A package of two modules, of which one calls the other."""

    def __init__(self, root):
        self.root = root
        self.package = root / "swarm_mj"
        (self.package / "system").mkdir(parents=True)
        for module in (swarm_mj.system.compiled, swarm_mj.system.interrupt):
            shutil.copy(module.__file__, self.package / "system")
        for folder in (self.package, self.package / "system"):
            (folder / "__init__.py").touch()
        self.write()

    def write(self, factor=2.0, half=0.5, name="Pair"):
        """New physics; the loop's own file changes with the name only."""
        source = PHYSICS.format(factor=factor, half=half, name=name)
        (self.package / "physics.py").write_text(source)
        (self.package / "loop.py").write_text(LOOP.format(name=name))

    def python(self, code, **environment):
        """What a new process prints."""
        plain = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=self.root,
            env={**plain, "PYTHONPATH": str(self.root), **environment},
            capture_output=True,
            text=True,
            check=True,
        )
        return done.stdout.strip()

    def run(self, **environment):
        """What a new process makes of it, whether from the cache, and where that lies."""
        value, num_hits, path = self.python(RUN, **environment).split()
        return float(value), num_hits == "1", path


@pytest.fixture
def checkout(tmp_path):
    return Checkout(tmp_path)


def files_of(folder):
    return sorted(path.name for path in Path(folder).glob("*.nb*"))


@pytest.mark.slow
def test_functions_are_compiled_anew_when_what_they_call_changes(checkout):
    """In another file: a function, a constant, a class that an index names and that is gone.

    The old cache is overwritten.
    """
    beside = str(checkout.package / "__pycache__")
    assert checkout.run() == (4.0, False, beside)
    before = files_of(beside)
    (checkout.package / "unrelated.py").write_text("NAME = 'fly'\n")
    assert checkout.run() == (4.0, True, beside)
    checkout.write(factor=3.0)
    assert checkout.run() == (5.0, False, beside)
    checkout.write(factor=3.0, half=1.5, name="Other")
    assert checkout.run() == (9.0, False, beside)
    assert files_of(beside) == before


@pytest.mark.slow
def test_a_file_may_be_imported_by_two_names(tmp_path):
    """What a cache holds names classes by their module, which may not exist by that name."""
    (tmp_path / "inside").mkdir()
    source = PHYSICS.format(factor=2.0, half=0.5, name="Pair")
    (tmp_path / "inside" / "loops.py").write_text(source)
    for folder, module in [("inside", "loops"), (".", "inside.loops")]:
        code = f"import {module} as loops; print(loops.scaled(loops.Pair(1.0)))"
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path / folder,
            env={k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.stdout.strip() == "2.0", done.stderr


@pytest.mark.slow
def test_the_cache_is_where_it_is_to_be_else_in_the_user_s_folder_or_nowhere(checkout, tmp_path):
    """A file where the package's folder should be cannot be written to by anyone."""
    value, _, path = checkout.run(NUMBA_CACHE_DIR=str(tmp_path / "given"))
    assert (value, Path(path).parent) == (4.0, tmp_path / "given")
    assert files_of(path)
    shutil.rmtree(checkout.package / "__pycache__", ignore_errors=True)
    (checkout.package / "__pycache__").touch()
    home = str(tmp_path / "home")
    value, _, path = checkout.run(XDG_CACHE_HOME=home, HOME=home)
    assert value == 4.0
    assert path.startswith(home)
    nowhere = str(checkout.package / "__init__.py")
    assert checkout.run(XDG_CACHE_HOME=nowhere, HOME=nowhere) == (4.0, False, "None")


@pytest.mark.slow
def test_ctrl_c_interrupts_only_once_a_function_is_whole(checkout):
    """Broken off, the process crashed when it ended, or failed of a function half made.

    Of the two functions, the loop lets its sums be reordered; the one that it calls does not say
    so, and never has its caller's assumptions on floats.
    """
    assert checkout.python(INTERRUPTED + ASSUMED).split("\n") == ["1 4.0", "True False"]
    assert checkout.python(INTERRUPTED) == "1 4.0"


@pytest.mark.slow
def test_what_compiled_functions_call_is_not_compiled_for_python(checkout):
    """From the cache, it is a part of its caller, and nothing that compiles is imported for it."""
    assert checkout.python(PARTS).split() == ["True", "0", "1", "4.0"]
    assert checkout.python(PARTS).split() == ["False", "0", "0", "4.0"]


def test_a_part_is_made_a_machines_in_its_caller_alone():
    """An error in it reaches Python all the same."""

    @compiled(forceinline=True)
    def root(x: float) -> float:
        if x < 0.0:
            raise ValueError("below 0")
        return x**0.5

    @compiled()
    def sum_of_roots(x: float, y: float) -> float:
        return root(x) + root(y)

    assert sum_of_roots(4.0, 9.0) == 5.0
    with pytest.raises(ValueError, match="below 0"):
        sum_of_roots(4.0, -1.0)
    of_root, of_sum = cast(Any, root), cast(Any, sum_of_roots)
    (part,), (whole,) = of_root.inner.overloads.values(), of_sum.overloads.values()
    for result, is_machines in ((part, False), (whole, True)):
        name = result.fndesc.mangled_name
        assert bool(result.library.get_pointer_to_function(name)) == is_machines
    assert "alwaysinline" in part.library.get_llvm_str()


def test_a_loop_that_makes_no_arrays_counts_no_references():
    """It cannot make an array."""

    @compiled(makes_arrays=False)
    def write(row: np.ndarray, k: int) -> None:
        row[k] = k

    @compiled(makes_arrays=False)
    def fill(numbers: np.ndarray) -> None:
        for k in range(numbers.shape[1]):
            write(numbers[0], k)

    @compiled(makes_arrays=False)
    def zeros(num: int) -> np.ndarray:
        return np.zeros(num)

    numbers = np.full((2, 3), 7.0)
    before = sys.getrefcount(numbers)
    fill(numbers)
    assert numbers.tolist() == [[0.0, 1.0, 2.0], [7.0, 7.0, 7.0]]
    assert sys.getrefcount(numbers) == before
    (result,) = cast(Any, fill).overloads.values()
    assert "NRT_incref" not in result.library.get_llvm_str()
    with pytest.raises(NumbaError, match="returning of array"):
        zeros(3)


@pytest.mark.slow
def test_what_is_compiled_is_counted_as_it_begins(checkout):
    lines = checkout.python(SAID).split("\n")
    assert [line.endswith(f": function {n} ...") for n, line in enumerate(lines, 1)] == [True] * 2
    assert checkout.python(SAID) == ""  # from the cache


def test_the_digest_of_a_users_file_watches_its_own_package(tmp_path):
    package = tmp_path / "mine"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "outer.py").write_text("from mine.inner import loop\nfrom numpy import pi\n")
    (package / "inner.py").write_text("loop = 1\n")
    before = sources_digest(package / "outer.py")
    (package / "inner.py").write_text("loop = 2\n")
    _read.cache_clear()
    assert sources_digest(package / "outer.py") != before
