"""Files that appear under their name only when they are whole."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


def temp_path(path: Path) -> Path:
    """Where this process writes a file until it is whole: hidden, in the same folder."""
    return path.with_name(f".{path.name}.{os.getpid()}.part")


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """Within it, write the path it yields; it then replaces `path`, or is gone if that failed.

    Args:
        path: The file; missing folders are made.

    Yields:
        Where to write.

    Raises:
        OSError: The file cannot be written.
    """
    target = path.resolve()  # of a link, the file it leads to is replaced, not the link
    target.parent.mkdir(parents=True, exist_ok=True)
    part = temp_path(target)
    try:
        yield part
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
