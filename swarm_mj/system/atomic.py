"""Files that appear under their name only when they are whole.

What is written stands beside its place until it is on the disk; then it takes the place in one
step. A failure or an interrupt leaves the place as it was. So does a kill, which also leaves an
unfinished part beside it: the next to write there removes it.
"""

import csv
import fcntl
import glob
import io
import json
import os
import secrets
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO

PAGE = bytes(4096)  # a full disk takes an empty file, but not this


def write_bytes(path: Path, content: bytes | memoryview) -> None:
    """Write a file: the old one stays until the new one is on the disk.

    Missing folders are made; of a link, the file that it leads to is replaced.

    Raises:
        OSError: The file could not be written, or not whole; the message names it.
    """
    with _named(path), _part(path) as (target, part):
        _write(part, content)
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
    """Add to a file; if that fails, it is as it was.

    Raises:
        OSError: The file could not be written; the message names it.
    """
    with _named(path):
        size = path.stat().st_size
        try:
            with path.open("ab") as file:
                _write(file, content)
        except BaseException:
            os.truncate(path, size)
            raise


def check_writable(path: Path) -> None:
    """Pass if a file can be written, a small one at least; leave nothing.

    Raises:
        OSError: It cannot.
    """
    target = Path(os.path.realpath(path))
    folder = next(parent for parent in target.parents if parent.exists())
    with _part(folder / target.name) as (_, part):
        _write(part, PAGE)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Name the file in the message of a failure."""
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
            with suppress(OSError):  # on disks without locks parts of the killed stay
                fcntl.flock(file, fcntl.LOCK_EX)
            yield target, file
    finally:
        part.unlink(missing_ok=True)


def _sweep(target: Path) -> None:
    """Remove what killed processes had not finished.

    The kernel gives their locks back. A process number would not tell whether they are alive: other
    machines and containers may share the disk, and numbers are given again.
    """
    for part in target.parent.glob(f".{glob.escape(target.name)}.{'[0-9a-f]' * 8}.part"):
        with suppress(OSError), part.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            part.unlink()


def _write(file: BinaryIO, content: bytes | memoryview) -> None:
    """Write as far as the disk: else a power cut could leave the new name with old content."""
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
