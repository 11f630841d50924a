"""Outputs that one process at a time may write."""

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

NO_LOCKS = (errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP)  # as some network disks say


@contextmanager
def owned(path: Path) -> Iterator[None]:
    """Within it, no other process owns the file or what belongs to it; missing folders are made.

    A hidden file beside it is locked. However this process ends, the kernel then unlocks it, so
    one that a killed process left keeps nobody out. Disks that know no locks keep nobody out
    either. Of the folders that were made, the empty ones are removed in the end.

    Raises:
        ValueError: Another process owns it, or something else has the hidden file's name.
        OSError: The folder cannot be written.
    """
    target = path.resolve()
    made = [folder for folder in target.parents if not folder.exists()]
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
        with suppress(OSError):  # until one is not empty
            for folder in made:
                folder.rmdir()


def _locked(lock: Path, path: Path) -> int:
    """Return the open file under its name, locked if the disk knows locks."""
    while True:
        number = _opened(lock, path)
        try:
            fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            owner = os.read(number, 20).decode(errors="replace") or "of another user"
            os.close(number)
            raise ValueError(
                f"{path} is being written by process {owner}; wait until it is done, end it, or "
                "name another"
            ) from None
        except OSError as error:
            if error.errno in NO_LOCKS:
                return number
            os.close(number)
            lock.unlink(missing_ok=True)
            raise OSError(f"{path} cannot be locked: {error.strerror}") from error
        if lock.exists() and os.path.samestat(os.fstat(number), lock.stat()):
            return number
        os.close(number)  # its last owner has removed it meanwhile


def _opened(lock: Path, path: Path) -> int:
    """Open or makes the file; raises ValueError if that would touch a file of another name."""
    flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC
    way_out = f"unless it is being written, remove {lock}"
    try:
        number = os.open(lock, flags, 0o666)
    except OSError as error:
        if not os.path.lexists(lock):
            raise
        reason = "its lock is a link" if lock.is_symlink() else error.strerror
        raise ValueError(f"{path} cannot be locked: {reason}; {way_out}") from error
    status = os.fstat(number)
    if not stat.S_ISREG(status.st_mode) or status.st_nlink > 1:
        os.close(number)
        raise ValueError(f"{path} cannot be locked: its lock is no file of its own; {way_out}")
    return number
