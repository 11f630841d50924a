"""Strict reading of files that others wrote: every value is checked.

Files are regular, and no larger than expected. The rows of a table have as many cells as it has
columns. JSON has the keys of a dataclass and no others, and its numbers are finite; only a field
with a default may lack. Ranges are the dataclass's own.
"""

import csv
import io
import os
import stat
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Annotated, Any, BinaryIO, TypeVar, get_args, get_origin

import msgspec

from swarm_mj.system.fields import former_names
from swarm_mj.system.streams import check_printable

Kind = TypeVar("Kind")
TableRow = tuple[int, dict[str, str]]

MAX_LETTERS = 160  # of what msgspec says
TABLE_BYTES = 10_000_000  # of a table, unless its reader knows better
# To open a pipe must not wait for who writes it. Windows has no such flags, but one that keeps it
# from changing line ends.
OPENED = os.O_RDONLY
for flag in ("O_CLOEXEC", "O_NONBLOCK", "O_BINARY"):
    OPENED |= getattr(os, flag, 0)


def open_file(path: Path, what: str) -> BinaryIO:
    """Open a regular file, or raise ValueError at once: a pipe might have no end."""
    try:
        number = os.open(path, OPENED)
    except FileNotFoundError:
        raise ValueError(f"{what} {path} cannot be found") from None
    except OSError as error:
        raise ValueError(f"{what} {path} cannot be read: {error.strerror}") from error
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise ValueError(f"{what} {path} is a folder, a pipe or a device; name a file")
    return os.fdopen(number, "rb")


def read_file(path: Path, what: str, most_bytes: int) -> bytes:
    """Return all that a file holds; raise ValueError, as `open_file` does, or if that is more."""
    with open_file(path, what) as file:
        size = os.fstat(file.fileno()).st_size
        content = b"" if size > most_bytes else file.read(most_bytes + 1)
    check_size(f"{what} {path}", max(size, len(content)), most_bytes)
    return content


def check_size(what: str, size: int, most_bytes: int) -> None:
    """Raise ValueError for a file that is too large to be read, or to be written."""
    if size > most_bytes:
        raise ValueError(f"{what} may have up to {most_bytes} bytes, not {size}")


def read_rows(path: Path, what: str, most_bytes: int = TABLE_BYTES) -> list[TableRow]:
    """Return a CSV file's rows by column, and the lines they end on; ValueError if it is none."""
    content = read_file(path, what, most_bytes)
    try:
        reader = csv.DictReader(io.StringIO(content.decode("utf-8-sig"), newline=""), strict=True)
        rows = [(reader.line_num, row) for row in reader]
    except (csv.Error, UnicodeDecodeError) as error:
        raise ValueError(f"{what} {path} is no CSV ({error})") from error
    for line, row in rows:
        if None in row or None in row.values():
            raise ValueError(f"{what} {path}, line {line}: as many cells as columns are needed")
        for cell in (*row, *row.values()):
            _check_cell(f"{what} {path}, line {line}", cell)
    return rows


def _check_cell(where: str, cell: str) -> None:
    try:
        check_printable(cell, "write it without them")
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from error


def read_json(text: bytes | str, kind: type[Kind]) -> Kind:
    """Return a text of JSON as a kind that msgspec knows, such as a dataclass."""
    return read_plain(_plain(text), kind)


def read_document(text: bytes | str, name: str, version: int, kind: type[Kind]) -> Kind:
    """Read an object as `read_json`, if it has this `format` and no newer `format_version`."""
    document: Any = _plain(text)
    header = read_plain(document, _Header)
    if header.format != name:
        raise ValueError(f'its format must be "{name}", not {header.format!r:.40}')
    if (newer := header.format_version) > version:
        raise ValueError(
            f"its format_version is {newer}, and this swarm_mj reads {version}; update it"
        )
    names = _Header.__struct_fields__
    return read_plain({key: document[key] for key in document if key not in names}, kind)


def read_plain(value: object, kind: type[Kind]) -> Kind:
    """Return numbers, texts, lists and dicts as `read_json` does, or raise ValueError."""
    try:
        return msgspec.convert(_with_present_names(value, kind), kind, dec_hook=_made)
    except msgspec.ValidationError as error:
        raise ValueError(_in_a_line(error)) from error


class _Header(msgspec.Struct):
    format: str
    format_version: Annotated[int, msgspec.Meta(ge=1)]


def _plain(text: bytes | str) -> object:
    try:
        return msgspec.json.decode(text)
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ValueError(_in_a_line(error)) from error


def _in_a_line(error: Exception) -> str:
    return " ".join(str(error)[:MAX_LETTERS].split())


def _made(kind: type[Any], value: object) -> object:
    """Make a value of a type that msgspec does not know, such as a path, of a text."""
    if not isinstance(value, str | kind):
        raise TypeError(f"Expected `{kind.__name__}`, not {type(value).__name__}")
    return kind(value)


def _with_present_names(value: object, kind: object, at: str = "$") -> object:
    """Return a dataclass's plain values by its fields' present names; ValueError for others."""
    # msgspec itself would drop what is unknown: a newer file would pass. It fills in what lacks and
    # has a default, as such a field is newer than the file, and refuses what has none.
    if get_origin(kind) is tuple and isinstance(value, list):
        of_each = get_args(kind)[0]  # of as many as there are
        return [_with_present_names(each, of_each, f"{at}[{n}]") for n, each in enumerate(value)]
    if not (isinstance(kind, type) and is_dataclass(kind) and isinstance(value, dict)):
        return value
    known: dict[Any, Any] = {spec.name: spec for spec in fields(kind)}
    lacking = known.keys() - value.keys()
    new = {old: name for old, name in former_names(kind).items() if name in lacking}
    named = {new.get(key, key): each for key, each in value.items()}
    for key in named.keys() - known.keys():
        raise ValueError(f"Object contains unknown field `{key!s:.40}` - at `{at}`")
    return {key: _with_present_names(x, known[key].type, f"{at}.{key}") for key, x in named.items()}
