"""Standard streams that take whatever is printed, on any terminal, or on none."""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

GONE = (errno.EPIPE, errno.EIO)  # a pipe's reader has closed it; the terminal is closed


@contextmanager
def lasting_streams() -> Iterator[None]:
    """Within it, what this process says after its reader has gone is dropped, and work goes on.

    Characters that a terminal does not know become `?`. Streams that were closed lead nowhere:
    files opened later would else take their numbers, and with them what libraries complain of.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115 - for good
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = map(_lasting, before)
    try:
        yield
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


def _lasting(stream: Any) -> Any:  # noqa: ANN401 - a test's stream is of any kind
    """A stream to the same file; the stream itself if it leads to none."""
    try:
        file = io.BufferedWriter(_LastingFile(stream.fileno(), "wb", closefd=False))
    except (AttributeError, OSError):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
        return stream
    return io.TextIOWrapper(file, encoding=stream.encoding, errors="replace", line_buffering=True)


class _LastingFile(io.FileIO):
    def write(self, data: Any, /) -> int | None:  # noqa: ANN401 - any buffer
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in GONE:
                raise
            with open(os.devnull, "wb") as nowhere:  # from here on libraries write there, too
                os.dup2(nowhere.fileno(), self.fileno())
            return super().write(data)
