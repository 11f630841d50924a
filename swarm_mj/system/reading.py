"""The one way of reading what others wrote: nothing is believed that was not checked.

Files are regular, and no larger than expected. The rows of a table have as many cells as it has
columns. JSON has the keys of a dataclass, all of them and no others, its numbers are finite, and it
is not nested without end. Ranges are the dataclass's own.
"""

import csv
import io
import os
import stat
from collections.abc import Iterable
from dataclasses import fields, is_dataclass
from functools import cache
from pathlib import Path
from typing import Annotated, Any, BinaryIO, TypeVar

import msgspec

from swarm_mj.system.fields import FORMER_NAMES

Kind = TypeVar("Kind")

Row = tuple[int, dict[str, str]]

MOST_LEVELS = 20  # lists and objects within each other
MOST_WORDS = 160  # characters of what msgspec says


def open_file(path: Path, what: str, *, folder: Path | None = None) -> BinaryIO:
    """Open a regular file, at once: pipes and devices would be waited for, or have no end.

    Args:
        path: The file; it may be a link.
        what: It is called in a message.
        folder: Where it must be, if it must be somewhere: no link leads out of it.

    Raises:
        ValueError: There is no such file, or it cannot be read.
    """
    try:
        if folder is not None and not path.resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"{what} {path} is a link that leads out of {folder}; copy the file")
        number = os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK)
    except FileNotFoundError:
        raise ValueError(f"there is no {what} {path}") from None
    except (OSError, RuntimeError) as error:  # RuntimeError: Python 3.11 and 3.12, of link loops
        reason = getattr(error, "strerror", None) or "its links lead in a circle"
        raise ValueError(f"{what} {path} cannot be read: {reason}") from error
    if not stat.S_ISREG(os.fstat(number).st_mode):
        os.close(number)
        raise ValueError(f"{what} {path} is a folder, a pipe or a device; name a file")
    return os.fdopen(number, "rb")


def read_file(path: Path, what: str, most_bytes: int, *, folder: Path | None = None) -> bytes:
    """All that a file holds; see `open_file`.

    Raises:
        ValueError: It cannot be read, or holds more than that.
        OSError: The disk fails.
    """
    with open_file(path, what, folder=folder) as file:
        size = os.fstat(file.fileno()).st_size
        content = b"" if size > most_bytes else file.read(most_bytes + 1)
    check_size(f"{what} {path}", max(size, len(content)), most_bytes)
    return content


def check_size(what: str, size: int, most_bytes: int) -> None:
    """Raise ValueError for a file that is too large to be read, or to be written."""
    if size > most_bytes:
        raise ValueError(f"{what} may have up to {most_bytes} bytes, not {size}")


def read_rows(path: Path, what: str, most_bytes: int) -> tuple[list[str], list[Row]]:
    """Return a CSV file: the names of its columns, and its rows with the lines that they end on.

    Raises:
        ValueError: It cannot be read or is too large, is no CSV, or a row has more cells, or fewer,
            than there are columns.
    """
    content = read_file(path, what, most_bytes)
    try:
        reader = csv.DictReader(io.StringIO(content.decode("utf-8-sig"), newline=""), strict=True)
        rows = [(reader.line_num, row) for row in reader]
    except (csv.Error, UnicodeDecodeError) as error:
        raise ValueError(f"{what} {path} is no CSV ({error})") from error
    for line, row in rows:
        if None in row or None in row.values():
            raise ValueError(f"{what} {path}, line {line}: as many cells as columns are needed")
    return list(reader.fieldnames or ()), rows


def read_json(text: bytes | str, kind: type[Kind]) -> Kind:
    """What a text of JSON says, as a dataclass or another type that msgspec knows.

    Raises:
        ValueError: It is no JSON, is nested too deep, or is not of the kind.
    """
    return read_plain(_plain(text), kind)


def read_document(text: bytes | str, name: str, version: int, kind: type[Kind]) -> Kind:
    """As `read_json`, of a JSON object that begins with its `format` and `format_version`.

    Raises:
        ValueError: It has another format, or a newer version of it; else as `read_json`.
    """
    document = _plain(text)
    header = read_plain(document, _Header)
    if header.format != name:
        raise ValueError(f'its format must be "{name}", not {header.format!r:.40}')
    if header.format_version > version:
        raise ValueError(
            f"its format_version is {header.format_version}, and this swarm_mj reads {version}; "
            "update it"
        )
    return read_plain(document, kind, bases=(_Header,))


def format_of(text: bytes | str) -> str:
    """Return the `format` that a JSON object begins with; raises ValueError if it has none."""
    return read_plain(_plain(text), _Header).format


def read_plain(value: object, kind: type[Kind], bases: tuple[type, ...] = ()) -> Kind:
    """Numbers, texts, lists and dicts as a dataclass, or another type that msgspec knows.

    Raises:
        ValueError: They are not of the kind.
    """
    try:
        found = msgspec.convert(_by_new_names(value, kind), _strict(kind, bases), dec_hook=_made)
        return msgspec.convert(found, kind, from_attributes=True, dec_hook=_made)
    except msgspec.ValidationError as error:
        raise ValueError(_in_a_line(error)) from error


class _Header(msgspec.Struct):
    """What documents of any version begin with."""

    format: str
    format_version: Annotated[int, msgspec.Meta(ge=1)]


def _plain(text: bytes | str) -> object:
    """What is in a text of JSON, which is not nested without end."""
    try:
        value = msgspec.json.decode(text)
        _check_levels([value])
    except RecursionError as error:
        raise ValueError("it is nested too deep") from error
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ValueError(_in_a_line(error)) from error
    return value


def _in_a_line(error: Exception) -> str:
    return " ".join(str(error)[:MOST_WORDS].split())


def _made(kind: type[Any], value: object) -> object:
    """A value of a type that msgspec does not know, such as a path; TypeError unless of a text."""
    if not isinstance(value, str | kind):
        raise TypeError(f"Expected `{kind.__name__}`, not {type(value).__name__}")
    return kind(value)


@cache
def _strict(kind: Any, bases: tuple[type, ...] = ()) -> Any:  # noqa: ANN401 - any type
    """Like a dataclass, but all keys are needed and no others known; other types are themselves.

    Fields that say `may_lack` are newer than some files: there they have their default.
    """
    if not (isinstance(kind, type) and is_dataclass(kind)):
        return kind
    keys = [
        (spec.name, _strict(spec.type), spec.default)
        if spec.metadata.get("may_lack")
        else (spec.name, _strict(spec.type))
        for spec in fields(kind)
    ]
    return msgspec.defstruct(
        f"_{kind.__name__}", keys, bases=bases or None, forbid_unknown_fields=True, kw_only=True
    )


def _by_new_names(value: Any, kind: object) -> Any:  # noqa: ANN401 - any plain value
    """Return plain values with the present names of a dataclass's fields, nested ones included."""
    if not (isinstance(kind, type) and is_dataclass(kind) and isinstance(value, dict)):
        return value
    kinds: dict[Any, Any] = {spec.name: spec.type for spec in fields(kind)}
    missing = kinds.keys() - value.keys()
    new = {old: name for old, name in FORMER_NAMES.items() if name in missing}
    named = {new.get(key, key): each for key, each in value.items()}
    return {key: _by_new_names(each, kinds.get(key)) for key, each in named.items()}


def _check_levels(values: Iterable[Any], num_levels: int = 0) -> None:
    """Raise RecursionError if lists and objects are nested too deep."""
    if num_levels > MOST_LEVELS:
        raise RecursionError
    for value in values:
        if isinstance(value, list | dict):
            _check_levels(value.values() if isinstance(value, dict) else value, num_levels + 1)
