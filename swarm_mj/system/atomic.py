"""Files and folders that appear under their name only when they are whole.

What is written stands beside its place until it is on the disk and checked; then it takes the place
in one step. Whoever fails or is interrupted leaves the place as it was. Whoever is killed leaves
that, too, and an unfinished part beside it, which the next of its machine to write there removes.
"""

import csv
import glob
import hashlib
import io
import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

Check = Callable[[Path], object]  # raises ValueError for what is not whole
PIECE_BYTES = 2**20  # read back at a time
PAGE = bytes(4096)  # a full disk takes an empty file, but not this


def write_bytes(path: Path, content: bytes | memoryview, check: Check | None = None) -> None:
    """Write a file: the old one stays until the new one is on the disk and passes the check.

    Missing folders are made; of a link, the file that it leads to is replaced.

    Raises:
        OSError: The file could not be written, or not whole; the message names it.
    """
    with _named(path), _part(path) as (target, part):
        _fill(part, content)
        if check:
            check(part)
        part.replace(target)
        _flush(target.parent)


def write_folder(path: Path, contents: Mapping[str, bytes], check: Check | None = None) -> None:
    """As `write_bytes`, but for a folder of files, replaced with all that it holds.

    No folder takes another's place in one step, so the old one first steps aside. Whoever is killed
    between the two steps leaves it there, where `present_folder` finds it.
    """
    with _named(path), _part(path) as (target, part):
        part.mkdir()
        for name, content in contents.items():
            _fill(part / name, content)
        _flush(part)
        if check:
            check(part)
        _replace(target, part)
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
    """Add to a file; if that fails, it is as it was.

    Raises:
        OSError: The file could not be written; the message names it.
    """
    with _named(path):
        size = path.stat().st_size
        try:
            with path.open("a+b") as file:
                _write(file, content)
        except BaseException:
            os.truncate(path, size)
            raise


def check_writable(path: Path) -> None:
    """Pass if there is place for a file, a small one at least; leaves nothing.

    Raises:
        OSError: There is not.
    """
    target = Path(os.path.realpath(path))
    folder = next(parent for parent in target.parents if parent.exists())
    with _part(folder / target.name) as (_, part):
        _fill(part, PAGE)


def present_folder(path: Path) -> Path:
    """Where a folder's last whole version is: under its name, unless a kill left it aside."""
    target = Path(os.path.realpath(path))
    return _aside(target) if not target.exists() and _aside(target).is_dir() else path


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Says of a failure which file it was."""
    try:
        yield
    except (OSError, ValueError) as error:
        reason = (isinstance(error, OSError) and error.strerror) or error
        raise OSError(f"{path} could not be written: {reason}") from error


@contextmanager
def _part(path: Path) -> Iterator[tuple[Path, Path]]:
    """A file or folder to make until it is whole; yields its place and itself, gone afterwards."""
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    _sweep(target)
    part = target.with_name(f".{target.name}.{_machine()}.{os.getpid()}.part")
    try:
        yield target, part
    finally:
        _remove(part)


def _sweep(target: Path) -> None:
    """Remove what processes of this machine that were killed had not finished writing."""
    for part in target.parent.glob(f".{glob.escape(target.name)}.{_machine()}.*.part"):
        pid = part.name.split(".")[-2]
        if pid.isdecimal() and (int(pid) == os.getpid() or not _is_alive(int(pid))):
            _remove(part)


def _machine() -> str:
    """Where processes have their numbers; others, containers too, may share the disk."""
    return hashlib.sha256(os.fsencode(os.uname().nodename)).hexdigest()[:8]


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # another user's
        return True
    return True


def _remove(part: Path) -> None:
    if part.is_dir():
        shutil.rmtree(part, ignore_errors=True)
    else:
        part.unlink(missing_ok=True)


def _fill(path: Path, content: bytes | memoryview) -> None:
    with path.open("x+b") as file:  # follows no link
        _write(file, content)


def _write(file: BinaryIO, content: bytes | memoryview) -> None:
    """Write as far as the disk; raises OSError if that cannot be, or something else is there."""
    start = file.tell()
    file.write(content)
    file.flush()
    os.fsync(file.fileno())
    file.seek(start)
    for at in range(0, len(content), PIECE_BYTES):
        piece = bytes(content[at : at + PIECE_BYTES])
        if file.read(len(piece)) != piece:
            raise OSError("the disk gives back something else")


def _flush(folder: Path) -> None:
    """Has the disk know the names in a folder, where it can be asked to."""
    with suppress(OSError):
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


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
