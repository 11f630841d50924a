"""What this machine has left: memory, addresses, and room for a file."""

import os
import resource
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

YES = "start even though memory or disk may not suffice"  # the help of --yes
CONTROL_GROUPS = Path("/sys/fs/cgroup")
# Of both versions: what a group may have, what it has, and what of that is files it can give back.
GROUP_FILES = {
    "": ("memory.max", "memory.current", ("inactive_file", "active_file", "slab_reclaimable")),
    "memory": (
        "memory.limit_in_bytes",
        "memory.usage_in_bytes",
        ("total_inactive_file", "total_active_file"),
    ),
}


def free_memory() -> int:
    """What this process and its children may still fill: the machine's, or less by a limit."""
    return min([psutil.virtual_memory().available, *_allowed_by_groups()])


def free_addresses() -> int | None:
    """What this process may still ask for under `ulimit -v`; None without one.

    Libraries ask for much that they never fill.
    """
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    used = psutil.Process().memory_info().vms
    return None if limit == resource.RLIM_INFINITY else limit - used


def free_room(path: Path) -> int:
    """What the disk has left for files there, whose folder may not be made yet."""
    target = Path(os.path.realpath(path))
    folder = next(each for each in (target, *target.parents) if each.is_dir())
    return shutil.disk_usage(folder).free


def largest_file() -> int | None:
    """How large a file may get under `ulimit -f`; None without a limit."""
    limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    return None if limit == resource.RLIM_INFINITY else limit


@contextmanager
def memory_errors() -> Iterator[None]:
    """Within it, torch's and MuJoCo's words for a lack of memory are Python's MemoryError."""
    try:
        yield
    except (RuntimeError, ValueError) as error:
        if not any(words in str(error) for words in ("allocate memory", "CUDA out of memory")):
            raise
        raise MemoryError from error


def _allowed_by_groups() -> Iterator[int]:
    """What the control groups of this process leave it, those of a container first of all."""
    groups = Path("/proc/self/cgroup")
    for line in groups.read_text().splitlines() if groups.exists() else ():
        _, kind, path = line.split(":", 2)
        if kind in GROUP_FILES:
            root = CONTROL_GROUPS / kind
            group = root / path.removeprefix("/")
            for folder in (group, *group.parents):  # a limit may be a parent's
                if folder.is_relative_to(root):
                    yield from _left(folder, *GROUP_FILES[kind])


def _left(folder: Path, most: str, used: str, files: tuple[str, ...]) -> Iterator[int]:
    """What one group has left, if it has a limit: this is no number, or huge, without one."""
    try:
        stat = dict(line.split() for line in (folder / "memory.stat").read_text().splitlines())
        left = int((folder / most).read_text()) - int((folder / used).read_text())
        yield left + sum(int(stat.get(name, 0)) for name in files)
    except (OSError, ValueError):
        return
