"""What the machine has: cores, memory, disk, a place for compiled code, a display."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from swarm_mj.cli.health.finding import Finding
from swarm_mj.system.atomic import check_writable
from swarm_mj.system.machine import free_memory, free_room
from swarm_mj.system.needs import in_gb
from swarm_mj.system.terminal import num_cores

LITTLE_MEMORY = 2 * 10**9  # a flight with its replay takes half a gigabyte, a training two
LITTLE_DISK = 10**9


def machine() -> Iterator[Finding]:
    """Everything that is looked at without trying it out."""
    yield _threads()
    yield _compiled_code()
    yield _room("memory free", free_memory(), LITTLE_MEMORY, "end other programs")
    yield _room("disk free here", free_room(Path.cwd()), LITTLE_DISK, "name another folder")
    yield _display()


def _threads() -> Finding:
    set_to = os.environ.get("OMP_NUM_THREADS")
    found = f"{num_cores()} may be used" + (f", OMP_NUM_THREADS={set_to}" if set_to else "")
    return Finding("speed", "cores", "ok", found)


def _compiled_code() -> Finding:
    """Where numba keeps what it compiled of the radio; without a place every start compiles."""
    name = "compiled code"
    try:
        from swarm_mj.radio import reception

        compiled: Any = reception.sinr
        folder = compiled.stats.cache_path
    except ImportError as error:
        return Finding("speed", name, "broken", str(error), "install what is missing")
    mend = "set NUMBA_CACHE_DIR to a folder that you can write"
    if folder is None:
        return Finding("speed", name, "absent", "not kept: every start compiles anew", mend)
    try:
        check_writable(Path(folder) / "kernels")
    except OSError as error:
        return Finding("speed", name, "absent", f"{folder} cannot be written ({error})", mend)
    return Finding("speed", name, "ok", f"kept in {folder}")


def _room(name: str, free: int, little: int, mend: str) -> Finding:
    state = "ok" if free >= little else "absent"
    found = in_gb(free) + ("" if free >= little else f", less than {in_gb(little)}")
    return Finding("room", name, state, found, mend)


def _display() -> Finding:
    group, names = "rerun's viewer", ("DISPLAY", "WAYLAND_DISPLAY")
    if not sys.platform.startswith("linux"):
        return Finding(group, "display", "ok", sys.platform)
    found = [f"{name}={os.environ[name]}" for name in names if os.environ.get(name)]
    if found:
        return Finding(group, "display", "ok", ", ".join(found))
    return Finding(group, "display", "absent", "none", "`swarm-mj replay --web FILE` needs none")
