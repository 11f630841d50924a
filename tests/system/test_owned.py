"""One process at a time owns an output, and the kernel gives it back."""

import errno
import fcntl
import os
import signal
import subprocess
import sys

import pytest

from swarm_mj.system.owned import owned

OWN_ON_AND_ON = """
import sys, time
from pathlib import Path
from swarm_mj.system.owned import owned
with owned(Path(sys.argv[1])):
    print(flush=True)
    time.sleep(600)
"""


@pytest.fixture
def owner(tmp_path):
    """A process that owns an output."""
    command = [sys.executable, "-c", OWN_ON_AND_ON, str(tmp_path / "o.csv")]
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    process.stdout.readline()
    yield process
    process.kill()
    process.communicate()


def test_a_second_process_is_told_the_first_one_s_id(owner, tmp_path):
    (tmp_path / "alias").symlink_to(tmp_path)
    for name in ("o.csv", "alias/o.csv"):
        with pytest.raises(ValueError, match=f"o.csv is being written by process {owner.pid};"):
            owned(tmp_path / name).__enter__()
    with owned(tmp_path / "other.csv"):
        pass


def test_a_killed_owner_keeps_nobody_out(owner, tmp_path):
    owner.send_signal(signal.SIGKILL)
    owner.wait()
    with owned(tmp_path / "o.csv"):
        assert (tmp_path / ".o.csv.lock").read_text() == str(os.getpid())
    assert list(tmp_path.iterdir()) == []


def test_it_can_be_owned_again(tmp_path):
    for _ in range(2):
        with owned(tmp_path / "new" / "o.csv"), pytest.raises(ValueError, match=str(os.getpid())):
            owned(tmp_path / "new" / "o.csv").__enter__()
    assert list(tmp_path.iterdir()) == []


def test_folders_that_it_made_are_left_if_something_is_in_them(tmp_path):
    with owned(tmp_path / "kept" / "new" / "o.csv"):
        (tmp_path / "kept" / "a").touch()
    assert [path.name for path in tmp_path.rglob("*")] == ["kept", "a"]


@pytest.mark.parametrize("kind", ["link", "hard link", "folder", "pipe"])
def test_a_lock_is_a_file_of_its_own(tmp_path, kind):
    """Another file would be written to."""
    precious, lock = tmp_path / "precious", tmp_path / ".o.csv.lock"
    precious.write_text("x")
    make = {
        "link": lambda: lock.symlink_to("precious"),
        "hard link": lambda: lock.hardlink_to(precious),
        "folder": lock.mkdir,
        "pipe": lambda: os.mkfifo(lock),
    }
    make[kind]()
    with pytest.raises(ValueError, match=r"o.csv cannot be locked: .*; unless .* remove .*lock$"):
        owned(tmp_path / "o.csv").__enter__()
    assert precious.read_text() == "x"
    assert os.path.lexists(lock)


def test_a_lock_of_another_user_is_told(tmp_path, monkeypatch):
    def refuse(path, *_):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)

    (tmp_path / ".o.csv.lock").touch()
    monkeypatch.setattr(os, "open", refuse)
    with pytest.raises(PermissionError):  # nothing is in the way
        owned(tmp_path / "other.csv").__enter__()
    with pytest.raises(ValueError, match=r"o.csv cannot be locked: Permission denied; unless"):
        owned(tmp_path / "o.csv").__enter__()


def num_open():
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.parametrize("code", [errno.ENOSYS, errno.ENOLCK, errno.EOPNOTSUPP, errno.EIO])
def test_disks_without_locks_are_written_and_leave_nothing(tmp_path, monkeypatch, code):
    def fail(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(fcntl, "flock", fail)
    before = num_open()
    if code == errno.EIO:
        with pytest.raises(OSError, match=r"o.csv cannot be locked: Input/output error"):
            owned(tmp_path / "o.csv").__enter__()
    else:
        with owned(tmp_path / "o.csv"):
            pass
    assert list(tmp_path.iterdir()) == []
    assert num_open() == before
