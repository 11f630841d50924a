"""Files that are written: checked before the work, by one process at a time, and only as a whole.

What is written stands beside its place until it is on the disk; then it takes the place in one
step. A failure or an interrupt leaves the place as it was. So does a kill, which also leaves an
unfinished part beside it: the next to write there removes it.
"""

import csv
import errno
import glob
import io
import json
import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

try:
    import fcntl
except ImportError:  # Windows, where no file that is open can be renamed or removed
    fcntl = None

PAGE = bytes(4096)  # a full disk takes an empty file, but not this
# The machine's fault, not the name's: the disk is full, fails, or takes nothing.
MACHINES_FAULT = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS)
# Of some network disks, which know no locks: there nothing keeps other processes out.
WITHOUT_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP)


class Output(NamedTuple):
    """A file that will be written; None is not."""

    what: str  # as it is called in a message
    path: Path | None
    suffix: str = ""  # that it must have, if any; of several, apart by |
    way_out: str = ""  # what to do if it cannot be written


def write_bytes(path: Path, content: bytes | memoryview) -> None:
    """Write a file: the old one stays until the new one is on the disk.

    Missing folders are made; of a link, the file that it leads to is replaced. An OSError names the
    file that could not be written.
    """
    with _named(path), _part(path) as (target, part):
        _write(part, content)
        if fcntl is None:
            part.close()
        os.replace(part.name, target)
        _flush(target.parent)


def write_text(path: Path, text: str) -> None:
    """Write a text file, as `write_bytes` does."""
    write_bytes(path, text.encode())


def write_json(path: Path, document: dict[str, Any]) -> None:
    """Write a JSON file, as `write_bytes` does; raises ValueError for what is not finite."""
    write_text(path, json.dumps(document, indent=2, allow_nan=False) + "\n")


def write_csv(path: Path, names: Sequence[str], rows: Iterable[Mapping[str, object]]) -> None:
    """Write a CSV file of these columns, as `write_bytes` does; None is an empty cell."""
    text = io.StringIO()
    writer = csv.DictWriter(text, names, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(path, text.getvalue())


def append_bytes(path: Path, content: bytes) -> None:
    """Add to a file that exists; an OSError, which names it, may leave a part of the content."""
    with _named(path), path.open("r+b") as file:
        file.seek(0, os.SEEK_END)
        _write(file, content)


def check_outputs(*outputs: Output, inputs: Iterable[Path] = (), must_be_new: bool = False) -> None:
    """Pass if a command can write all its files and loses none of its inputs.

    Missing folders will be made. Raises ValueError if a file exists, is a folder or an input, is
    named wrongly, or its folder cannot be written, or if two are the same; OSError if the disk is
    full, fails, or is read-only.
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


def check_writable(path: Path) -> None:
    """Raise OSError unless a file can be written, a small one at least; leave nothing."""
    target = Path(os.path.realpath(path))
    folder = next(parent for parent in target.parents if parent.exists())
    with _part(folder / target.name) as (_, part):
        _write(part, PAGE)


@contextmanager
def owned(path: Path) -> Iterator[None]:
    """Keep other processes from owning a file or folder meanwhile; missing folders are made.

    A hidden file beside it is locked. However this process ends, the kernel then unlocks it, so
    a file that a killed process left keeps no other out. Of the folders that were made, the empty
    ones are removed in the end. Raises ValueError if another process owns it, and OSError if the
    folder, or the hidden file, cannot be written.
    """
    from filelock import FileLock, Timeout  # brings asyncio, which is slow to import

    target = path.resolve()
    made = [folder for folder in target.parents if not folder.exists()]
    target.parent.mkdir(parents=True, exist_ok=True)
    hidden = target.with_name(f".{target.name}.lock")
    # No soft lock: a mere file would outlive a process that is killed.
    lock = FileLock(hidden, blocking=False, fallback_to_soft=False)
    try:
        lock.acquire()
        if fcntl is not None:  # Windows lets nobody write into a locked file
            hidden.write_text(str(os.getpid()))
    except Timeout:
        owner = _said_by(hidden) or "of another user"
        ways = "wait until it is done, end it, or name another"
        raise ValueError(f"{path} is being written by process {owner}; {ways}") from None
    except OSError as error:
        if error.errno not in WITHOUT_LOCKS:
            raise
    try:
        yield
    finally:
        if fcntl is None:
            lock.release()
        # Before it is unlocked: a process that waits for it sees that it has no name any more.
        # Windows removes it only afterwards, and not if another process has it by then.
        with suppress(PermissionError):
            hidden.unlink(missing_ok=True)
        lock.release()
        with suppress(OSError):  # until one is not empty
            for folder in made:
                folder.rmdir()


def _said_by(file: Path) -> str:
    """Return what a small file says; nothing if it is gone or may not be read."""
    try:
        return file.read_text(errors="replace")[:20]
    except OSError:
        return ""


def _check_place(what: str, path: Path, *, must_be_new: bool) -> None:
    with suppress(FileNotFoundError):
        mode = path.stat().st_mode  # `exists` would hide links that lead in circles
        if not stat.S_ISREG(mode):
            kind = "folder" if stat.S_ISDIR(mode) else "device or a pipe"
            raise ValueError(f"{what} {path} is a {kind}; name a file")
        if must_be_new:
            raise ValueError(f"{what} {path} exists; name another, or replace it with --force")


@contextmanager
def _named(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OSError(f"{path} could not be written: {error.strerror or error}") from error


@contextmanager
def _part(path: Path) -> Iterator[tuple[Path, BinaryIO]]:
    """Yield a file's place and the file to write beside it, which is gone afterwards."""
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    _sweep(target)
    part = target.with_name(f".{target.name}.{secrets.token_hex(4)}.part")
    try:
        with part.open("xb") as file:
            if fcntl is not None:
                with suppress(OSError):  # on disks without locks parts of the killed stay
                    fcntl.flock(file, fcntl.LOCK_EX)
            yield target, file
    finally:
        part.unlink(missing_ok=True)


def _sweep(target: Path) -> None:
    """Remove what killed processes had not finished."""
    # The kernel gives their locks back. A process number would not tell whether they are alive:
    # other machines and containers may share the disk, and numbers are given again.
    for part in target.parent.glob(f".{glob.escape(target.name)}.{'[0-9a-f]' * 8}.part"):
        if fcntl is None:
            with suppress(PermissionError):  # another process still writes it
                part.unlink(missing_ok=True)
            continue
        with suppress(OSError), part.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            part.unlink()


def _write(file: BinaryIO, content: bytes | memoryview) -> None:
    # As far as the disk: else a power cut could leave the new name with old content.
    file.write(content)
    file.flush()
    os.fsync(file.fileno())


def _flush(folder: Path) -> None:
    """Make the disk know the names in a folder, where it can be asked to."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
