"""Outputs that one process at a time may write."""

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def owned(path: Path) -> Iterator[None]:
    """Within it, no other process owns the file or what belongs to it; missing folders are made.

    A hidden file beside it is locked. However this process ends, the kernel then unlocks it, so
    one that a killed process left keeps nobody out.

    Raises:
        ValueError: Another process owns it.
        OSError: The folder cannot be written.
    """
    target = path.resolve()
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


def _locked(lock: Path, path: Path) -> int:
    """The open file, locked, under its name."""
    while True:
        number = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if lock.exists() and os.path.samestat(os.fstat(number), lock.stat()):
                return number
        except BlockingIOError:
            owner = os.read(number, 20).decode(errors="replace") or "of another user"
            os.close(number)
            raise ValueError(
                f"{path} is being written by process {owner}; wait until it is done, end it, or "
                "name another"
            ) from None
        os.close(number)  # its last owner has removed it meanwhile
