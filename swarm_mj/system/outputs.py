"""Files that commands write, checked before the work."""

import errno
import os
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from swarm_mj.system.atomic import check_writable

# The machine's fault, not the name's: the disk is full, fails, or takes nothing.
MACHINES_FAULT = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)


class Output(NamedTuple):
    """A file that will be written; None is not."""

    what: str  # as it is called in a message
    path: Path | None
    suffix: str = ""  # that it must have, if any; of several, apart by |
    way_out: str = ""  # what to do if it cannot be written


def check_outputs(*outputs: Output, inputs: Iterable[Path] = (), must_be_new: bool = False) -> None:
    """Pass if a command can write all its files; missing folders will be made.

    Args:
        *outputs: The files.
        inputs: Files and folders that the command reads, so that none is lost.
        must_be_new: Whether existing files are refused.

    Raises:
        ValueError: A file exists, is a folder or an input, is named wrongly, or its folder cannot
            be written; or two are the same.
        OSError: The disk is full, fails, or is read-only.
    """
    named: dict[str, str] = {}
    sources = {os.path.realpath(path) for path in inputs}
    for what, path, suffix, way_out in outputs:
        if path is None:
            continue
        target = os.path.realpath(path)
        if target in named:
            raise ValueError(f"{named[target]} and {what} name the same file, {path}")
        named[target] = what
        parts = {target, *map(str, Path(target).parents)}
        if os.path.exists(target) and sources & parts:
            raise ValueError(f"{what} {path} is an input, or part of one; name another")
        _check(what, path, suffix, way_out, must_be_new=must_be_new)


def _check(what: str, path: Path, suffix: str, way_out: str, *, must_be_new: bool) -> None:
    try:
        if _exists(path):
            if path.is_dir():
                raise ValueError(f"{what} {path} is a folder; name a file")
            if not path.is_file():
                raise ValueError(f"{what} {path} is a device or a pipe; name a file")
            if must_be_new:
                raise ValueError(f"{what} {path} exists; name another, or replace it with --force")
        if suffix and path.suffix.lower() not in suffix.split("|"):
            ways = " or ".join(f"*{ending}" for ending in suffix.split("|"))
            raise ValueError(f"{what} must be named {ways}, not {path}")
        check_writable(path)
    except OSError as error:
        complaint = f"{what} {path} cannot be written: {error.strerror}{way_out and f'; {way_out}'}"
        raise (OSError if error.errno in MACHINES_FAULT else ValueError)(complaint) from error


def _exists(path: Path) -> bool:
    """Also if it cannot be looked at: then it raises OSError, as for links that lead in circles."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    return True
