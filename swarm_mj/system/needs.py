"""Memory and disk: whether this machine has left what a command needs, asked before the work.

What is needed, those know who fill it: `simulation.memory`, `replay.replay_size`, `learning`.
"""

import math
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

try:
    import resource
except ImportError:  # Windows, which has no such limits
    resource = None

YES = "start even though memory or disk may not suffice"  # the help of --yes
WAY_ON = ", or try it with --yes"
CONTROL_GROUPS = Path("/sys/fs/cgroup")
# Of both versions of control groups: folder, limit, use, and how names in memory.stat begin.
GROUPS = {
    "": ("", "memory.max", "memory.current", ""),
    "memory": ("memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_"),
}
FILES = ("inactive_file", "active_file", "slab_reclaimable")  # memory that a group can give back

GB = 1e9
# Address space that libraries reserve and never fill; most of it is rerun's, a sixth torch's.
ADDRESSES = 4.2 * GB


@dataclass(frozen=True, kw_only=True)
class Needs:
    """The memory and disk that a command takes beyond its process's start [bytes]."""

    memory: float
    file: float = 0.0  # all that it writes
    grows: str = ""  # a sentence on what takes the memory, where it grows faster than expected


def check_fits(
    needs: Needs, output: Path | None, way_out: str, *, is_forced: bool, way_on: str = WAY_ON
) -> None:
    """Raise ValueError if a command's needs will not be met, unless it is forced by `--yes`.

    The message says what lacks and how much, what to choose instead (the way out), and how to start
    all the same (the way on).
    """
    has = [
        ("of memory", needs.memory, free_memory(), "are free"),
        ("of address space", needs.memory + ADDRESSES, free_addresses(), "are left by ulimit -v"),
    ]
    if output is not None:
        has += [
            ("on disk", needs.file, free_room(output), f"fit at {output}"),
            ("in files", needs.file, largest_file(), "are allowed in one by ulimit -f"),
        ]
    for what, needed, free, where in has:
        if needed > free and not is_forced:
            lack = f"this takes about {in_gb(needed)} {what}, and {in_gb(free)} {where}"
            if needs.grows and what.startswith(("of memory", "of address")):
                lack = f"{lack}; {needs.grows}"
            raise ValueError(f"{lack}; {way_out}{way_on}")


def in_gb(size: int | float) -> str:
    """Return a size as messages name it."""
    return f"{float(f'{size / GB:.3g}'):,g} GB"


@contextmanager
def memory_errors() -> Iterator[None]:
    """Turn torch's and MuJoCo's words for a lack of memory into Python's MemoryError."""
    try:
        yield
    except (RuntimeError, ValueError) as error:
        if not any(words in str(error) for words in ("allocate memory", "CUDA out of memory")):
            raise
        raise MemoryError from error


def free_memory() -> int:
    """Return what this process and its children may still fill: the machine's, or a limit's."""
    return min([psutil.virtual_memory().available, *_left_by_groups()])


def peak_memory() -> int:
    """Return the most memory that this process has held [bytes]; macOS says only what it holds."""
    # `resource` would also count the process that started this one.
    status = Path("/proc/self/status")
    if status.exists():
        return 1024 * int(status.read_text().partition("VmHWM:")[2].split()[0])
    held = psutil.Process().memory_info()
    return int(getattr(held, "peak_wset", held.rss))


def free_addresses() -> float:
    """Return the addresses that `ulimit -v` leaves this process, filled or not; may be infinite."""
    return _limit("RLIMIT_AS") - psutil.Process().memory_info().vms


def free_room(path: Path) -> int:
    """Return what the disk has left for files there, whose folder may not be made yet."""
    target = Path(os.path.realpath(path))
    folder = next(each for each in (target, *target.parents) if each.is_dir())
    return shutil.disk_usage(folder).free


def largest_file() -> float:
    """Return how large a file may get under `ulimit -f`; may be infinite."""
    return _limit("RLIMIT_FSIZE")


def _limit(which: str) -> float:
    """Return a limit of `resource`, by its name there."""
    if resource is None:
        return math.inf
    limit, _ = resource.getrlimit(getattr(resource, which))
    return math.inf if limit == resource.RLIM_INFINITY else float(limit)


def _left_by_groups() -> Iterator[int]:
    """Yield what this process's control groups leave it, such as a container's."""
    # A limit may be a parent's. Where there is none, the file says `max`, or there is no file.
    groups = Path("/proc/self/cgroup")
    for line in groups.read_text().splitlines() if groups.exists() else ():
        _, kind, path = line.split(":", 2)
        if kind not in GROUPS:
            continue
        root, limit, usage, prefix = GROUPS[kind]
        group = CONTROL_GROUPS / root / path.removeprefix("/")
        for folder in (group, *group.parents):
            try:
                left = int((folder / limit).read_text()) - int((folder / usage).read_text())
                stat = (folder / "memory.stat").read_text().splitlines()
            except (OSError, ValueError):
                continue
            kept = dict(line.split() for line in stat)
            yield left + sum(int(kept.get(prefix + name, 0)) for name in FILES)
