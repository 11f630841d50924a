"""Standard streams that take whatever is printed, on any terminal, or on none.

And texts that do not drive a terminal: a name from a file may hold breaks and escape sequences.
"""

import errno
import io
import os
import re
import sys
import unicodedata
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, TypeVar

Stream = TypeVar("Stream")

GONE = (errno.EPIPE, errno.EIO)  # a pipe's reader has closed it; the terminal is closed


# Characters that move the cursor, change colours or end a line.
CONTROL = re.compile("[\x00-\x1f\x7f-\x9f\u2028\u2029]")


def check_printable(text: str, way_out: str) -> None:
    """Raise ValueError for a name that would drive the terminal that it is printed on."""
    if CONTROL.search(text):
        raise ValueError(f"{text!a:.80} has control characters; {way_out}")


def in_a_line(text: str) -> str:
    """Return a text with what cannot be printed, line breaks too, as Python would write it."""
    shown: list[str] = []
    for character in text:
        is_plain = character.isprintable() or unicodedata.category(character) == "Zs"
        shown.append(character if is_plain else character.encode("unicode_escape").decode())
    return "".join(shown)


@contextmanager
def lasting_streams() -> Iterator[Callable[[], OSError | None]]:
    """Drop what this process says within it after its reader has gone; work goes on.

    So it does on a full disk, but that is a failure: the function that it yields writes all that
    was said so far, and returns the first failure, if there was one.

    Characters that a terminal does not know become `?`. Streams that were closed lead nowhere:
    files opened later would else take their numbers, and with them what libraries complain of.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, io.TextIOWrapper(io.FileIO(os.devnull, mode), encoding="utf-8"))
    before = sys.stdout, sys.stderr
    failures: list[OSError] = []
    lasting = [_lasting(stream, failures) for stream in before]

    def failure() -> OSError | None:
        for stream in lasting:
            stream.flush()
        return failures[0] if failures else None

    sys.stdout, sys.stderr = lasting
    try:
        yield failure
    finally:
        sys.stdout, sys.stderr = before
        failure()


def _lasting(stream: Stream, failures: list[OSError]) -> Stream | io.TextIOWrapper:
    """Return a stream to the same file, or the stream itself if it leads elsewhere, too."""
    if not isinstance(stream, io.TextIOWrapper):  # a notebook's has its server's file number
        return stream
    with suppress(OSError):
        stream.flush()
    try:
        file = io.BufferedWriter(_LastingFile(stream.fileno(), failures))
    except OSError:
        stream.reconfigure(errors="replace")
        return stream
    return io.TextIOWrapper(file, encoding=stream.encoding, errors="replace", line_buffering=True)


class _LastingFile(io.FileIO):
    def __init__(self, number: int, failures: list[OSError]) -> None:
        super().__init__(number, "wb", closefd=False)
        self._failures = failures

    def write(self, data: Any, /) -> int | None:  # noqa: ANN401 - any buffer
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in GONE:
                self._failures.append(error)
            with open(os.devnull, "wb") as nowhere:  # from here on libraries write there, too
                os.dup2(nowhere.fileno(), self.fileno())
            return super().write(data)
