"""Files that commands write: checked before the work, and written by one process at a time."""

import errno
import fcntl
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
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
    """Pass if a command can write all its files and loses none of its inputs.

    Missing folders will be made.

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
        if os.path.exists(target) and sources & {target, *map(str, Path(target).parents)}:
            raise ValueError(f"{what} {path} is an input, or part of one; name another")
        try:
            _check_place(what, path, must_be_new=must_be_new)
            if suffix and path.suffix.lower() not in suffix.split("|"):
                ways = " or ".join(f"*{ending}" for ending in suffix.split("|"))
                raise ValueError(f"{what} must be named {ways}, not {path}")
            check_writable(path)
        except OSError as error:
            reason = f"{error.strerror}{way_out and f'; {way_out}'}"
            kind = OSError if error.errno in MACHINES_FAULT else ValueError
            raise kind(f"{what} {path} cannot be written: {reason}") from error


def _check_place(what: str, path: Path, *, must_be_new: bool) -> None:
    with suppress(FileNotFoundError):
        mode = path.stat().st_mode  # `exists` would hide links that lead in circles
        if stat.S_ISDIR(mode):
            raise ValueError(f"{what} {path} is a folder; name a file")
        if not stat.S_ISREG(mode):
            raise ValueError(f"{what} {path} is a device or a pipe; name a file")
        if must_be_new:
            raise ValueError(f"{what} {path} exists; name another, or replace it with --force")


@contextmanager
def owned(path: Path) -> Iterator[None]:
    """Keep other processes from owning a file or folder meanwhile; missing folders are made.

    A hidden file beside it is locked. However this process ends, the kernel then unlocks it, so
    a file that a killed process left keeps no other out. Of the folders that were made, the empty
    ones are removed in the end.

    Raises:
        ValueError: Another process owns it, or something else has the hidden file's name.
        OSError: The folder cannot be written.
    """
    target = path.resolve()
    made = [folder for folder in target.parents if not folder.exists()]
    target.parent.mkdir(parents=True, exist_ok=True)
    lock = target.with_name(f".{target.name}.lock")
    number = _locked(lock, path)
    try:
        os.ftruncate(number, 0)
        os.write(number, str(os.getpid()).encode())
        yield
    finally:
        lock.unlink(missing_ok=True)
        os.close(number)
        with suppress(OSError):  # until one is not empty
            for folder in made:
                folder.rmdir()


def _locked(lock: Path, path: Path) -> int:
    """Return the hidden file, open and locked, if the disk knows locks."""
    while True:
        try:
            number = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW, 0o666)
        except OSError as error:
            if not os.path.lexists(lock):
                raise
            raise ValueError(
                f"{path} cannot be locked: {error.strerror}; unless it is being written, "
                f"remove {lock}"
            ) from error
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(number, 20).decode(errors="replace") or "of another user"
            os.close(number)
            raise ValueError(
                f"{path} is being written by process {owner}; wait until it is done, end it, or "
                "name another"
            ) from None
        except OSError:  # some network disks know no locks
            return number
        # Its last owner may have removed it between the two steps: then it locks no name.
        if lock.exists() and os.path.samestat(os.fstat(number), lock.stat()):
            return number
        os.close(number)
