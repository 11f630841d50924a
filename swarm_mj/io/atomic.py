"""Files and folders that appear under their name only when they are whole."""

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any


def temp_path(path: Path) -> Path:
    """Where this process writes something until it is whole: hidden, in the same folder."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Within it, write the file it yields; it then replaces `path`, or is gone if that failed.

    Missing folders are made; of a link, the file that it leads to is replaced.

    Raises:
        OSError: The file cannot be written.
    """
    target = path.resolve()
    target.parent.mkdir(parents=True, exist_ok=True)
    part = temp_path(target)
    try:
        yield part
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)


def write_text(path: Path, text: str) -> None:
    """Writes a text file, as `atomic_write` does."""
    with atomic_write(path) as part:
        part.write_text(text, encoding="utf-8")


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Writes a JSON file, as `atomic_write` does; raises ValueError for what is not finite."""
    write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


@contextmanager
def atomic_directory(path: Path) -> Iterator[Path]:
    """As `atomic_write`, but for a folder, replaced with all that it holds.

    No folder takes another's place in one step, so the old one first steps aside. Whoever is killed
    between the two steps leaves it there, where `present_folder` finds it.
    """
    target = path.resolve()
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
    """Where a folder's last whole version is: under its name, unless a kill left it aside."""
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
