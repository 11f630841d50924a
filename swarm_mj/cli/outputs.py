"""Files that commands write: checked before the work, whole or not at all."""

import os
from pathlib import Path


def check_writable(path: Path, what: str, *, must_be_new: bool = False) -> None:
    """Passes if a file can be written there.

    Args:
        path: The file; missing folders will be made.
        what: What the file is, for the message.
        must_be_new: Whether an existing file is refused.

    Raises:
        ValueError: The file exists, is a folder, or its folder cannot be written.
    """
    try:
        if path.is_dir():
            raise ValueError(f"{what} {path} is a folder; name a file")
        if must_be_new and path.exists():
            raise ValueError(f"{what} {path} exists; name another, or replace it with --force")
        folder = next(parent for parent in path.absolute().parents if parent.exists())
        probe = folder / f".{path.name}.{os.getpid()}.part"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise ValueError(f"{what} {path} cannot be written: {error.strerror}") from error


def write_text(path: Path, text: str) -> None:
    """Writes a text file that appears under its name only when it is whole.

    Args:
        path: The file, replaced if it exists; missing folders are made.
        text: What it holds.

    Raises:
        OSError: It cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        unfinished.write_text(text, encoding="utf-8")
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
