"""Processes that end when the one that started them ends, even if that one is killed."""

import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import IO, Any

# A Python that runs nothing out of the folder one stands in, where a numpy.py may lie.
PYTHON = (sys.executable, "-P")
# The same for a Python that a library starts.
SAFE_PATH = "PYTHONSAFEPATH"
LONGEST_S = 120.0  # of a trial; the first flight of an installation compiles for ten seconds
# Reads until its pipe is closed: the kernel does so when the one who writes has ended.
GUARD = """
import os, signal, sys
for number in [int(line) for line in sys.stdin]:
    try:
        os.kill(number, getattr(signal, "SIGKILL", signal.SIGTERM))
    except OSError:
        pass
"""
# Waits for its guard to know it; is gone if nobody is left to say so.
GATE = 'read -r go && exec "$@"'
# Windows has neither groups of processes nor `sh`: there only the program itself is ended, and no
# gate keeps it from outliving a process that is killed as it starts it.
HAS_GROUPS = hasattr(os, "killpg")


@contextmanager
def safe_children() -> Iterator[None]:
    """Let every Python that is started within it run nothing out of the folder one stands in.

    Libraries start some, too: glfw, which MuJoCo imports, looks for its own library by `python -c`,
    and would run a ctypes.py that lies here.
    """
    before = os.environ.get(SAFE_PATH)
    os.environ[SAFE_PATH] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[SAFE_PATH]
        else:
            os.environ[SAFE_PATH] = before


@contextmanager
def guard() -> Iterator[Callable[[int], None]]:
    """Start a process that kills others, computing or not, if this one ends within the block.

    It yields a function that takes the number of a process to be guarded, or minus that of a group.
    Processes that the block is left with are its own to end.
    """
    command = [sys.executable, "-I", "-S", "-c", GUARD]
    # A session of its own: what ends a terminal's processes does not end it.
    with subprocess.Popen(command, stdin=subprocess.PIPE, start_new_session=True) as process:
        pipe: Any = process.stdin

        def watch(number: int) -> None:
            pipe.write(b"%d\n" % number)
            pipe.flush()

        try:
            yield watch
        finally:
            process.kill()


@contextmanager
def running(
    command: Sequence[str],
    *,
    environment: Mapping[str, str] | None = None,  # this process's
    output: IO[str] | None = None,  # where this process's goes
) -> Iterator[subprocess.Popen[bytes]]:
    """Start a program that ends, with all that it started, when the block or this process does."""
    gated = ["sh", "-c", GATE, "sh", *command] if HAS_GROUPS else list(command)
    with (
        guard() as watch,
        subprocess.Popen(
            gated,
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=output,
            env=environment,
            start_new_session=True,
        ) as process,
    ):
        pipe: Any = process.stdin
        try:
            watch(-process.pid if HAS_GROUPS else process.pid)
            if HAS_GROUPS:
                pipe.write(b"go\n")
            pipe.close()
            yield process
        finally:
            if HAS_GROUPS:
                with suppress(ProcessLookupError):
                    os.killpg(process.pid, signal.SIGKILL)
            else:
                process.kill()


def attempt(
    program: str | Callable[[], None],
    variables: Mapping[str, str] | None = None,
    *,
    longest_s: float = LONGEST_S,
) -> tuple[bool, str]:
    """Run a program in a process of its own: it may crash, hang, or settle on a back end for good.

    Args:
        program: A function of a module that can be imported, or a program's text.
        variables: Environment variables that the process has, beside this one's.
        longest_s: When it is ended [s].

    Returns:
        Whether it ended well, and the last line that it said.
    """
    if callable(program):
        program = f"from {program.__module__} import {program.__name__} as run; run()"
    command = [*PYTHON, "-c", program]
    environment = os.environ | (variables or {})
    with (
        tempfile.TemporaryFile("w+") as said,
        running(command, environment=environment, output=said) as process,
    ):
        try:
            works = process.wait(longest_s) == 0
        except subprocess.TimeoutExpired:
            return False, f"not within {longest_s:g} s"
        said.seek(0)
        lines = said.read().strip().splitlines()
    return works, lines[-1] if lines else "it said nothing"
