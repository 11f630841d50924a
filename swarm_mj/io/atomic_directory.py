"""Folders that appear under their name only when they are whole."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from swarm_mj.io.atomic_file import temp_path


@contextmanager
def atomic_directory(path: Path) -> Iterator[Path]:
    """Within it, fill the folder it yields; it then replaces `path`, or is gone if that failed.

    No folder takes another's place in one step, so the old one first steps aside. Whoever is killed
    between the two steps leaves it there, where `present_folder` finds it.

    Args:
        path: The folder, replaced with all that it holds; missing parents are made.

    Yields:
        Where to write.

    Raises:
        OSError: The folder cannot be written.
    """
    target = path.resolve()  # of a link, the folder it leads to is replaced, not the link
    target.parent.mkdir(parents=True, exist_ok=True)
    part = temp_path(target)
    shutil.rmtree(part, ignore_errors=True)  # of a killed process that had this one's number
    part.mkdir()
    try:
        yield part
        _replace(target, part)
    finally:
        shutil.rmtree(part, ignore_errors=True)


def present_folder(path: Path) -> Path:
    """Where a folder's last whole version is: under its name, unless a kill left it aside.

    Args:
        path: The folder's name.

    Returns:
        The name itself, also of what does not exist, or that of the version left aside.
    """
    target = path.resolve()
    return _aside(target) if not target.exists() and _aside(target).is_dir() else path


def _replace(target: Path, part: Path) -> None:
    """At each moment, the target's name or the one aside is that of a whole folder."""
    aside = _aside(target)
    if target.exists():
        shutil.rmtree(aside, ignore_errors=True)
        target.rename(aside)
    part.rename(target)
    shutil.rmtree(aside, ignore_errors=True)


def _aside(target: Path) -> Path:
    return target.with_name(f".{target.name}.old")
