"""One process at a time owns an output, and the kernel gives it back."""

import os
import signal
import subprocess
import sys

import pytest

from swarm_mj.io.owned import owned

OWN_ON_AND_ON = """
import sys, time
from pathlib import Path
from swarm_mj.io.owned import owned
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
    assert list((tmp_path / "new").iterdir()) == []


def test_a_lock_is_no_link(tmp_path):
    """It would be written to."""
    (tmp_path / "precious").write_text("x")
    (tmp_path / ".o.csv.lock").symlink_to("precious")
    with pytest.raises(OSError, match=r"symbolic links|o\.csv\.lock"):
        owned(tmp_path / "o.csv").__enter__()
    assert (tmp_path / "precious").read_text() == "x"
