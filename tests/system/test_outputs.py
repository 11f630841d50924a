"""Files are checked before the work and owned by one process; nothing is left by either."""

import errno
import fcntl
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from swarm_mj.system.outputs import Output, check_outputs, owned


def test_a_file_in_missing_folders_can_be_written(tmp_path):
    path = tmp_path / "a" / "b" / "c.json"
    check_outputs(Output("summary", path), must_be_new=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["file/below", "x" * 300])
def test_places_that_cannot_be_written_are_named(tmp_path, name):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(ValueError, match=r"summary .* cannot be written"):
        check_outputs(Output("summary", tmp_path / name))
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_folders_and_existing_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="is a folder"):
        check_outputs(Output("replay", tmp_path))
    path = tmp_path / "old"
    path.write_text("kept")
    with pytest.raises(ValueError, match="--force"):
        check_outputs(Output("replay", path), must_be_new=True)
    check_outputs(Output("replay", path))


def test_devices_are_refused():
    with pytest.raises(ValueError, match="is a device or a pipe"):
        check_outputs(Output("summary", Path("/dev/null")))


def test_links_that_lead_in_circles_are_refused(tmp_path):
    (tmp_path / "a.json").symlink_to("b.json")
    (tmp_path / "b.json").symlink_to("a.json")
    with pytest.raises(ValueError, match=r"a\.json cannot be written: Too many levels"):
        check_outputs(Output("summary", tmp_path / "a.json"))


def test_the_folder_that_a_link_leads_to_must_take_a_file(tmp_path):
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "file" / "below")
    with pytest.raises(ValueError, match="Not a directory"):
        check_outputs(Output("summary", tmp_path / "link"))
    (tmp_path / "other").symlink_to(tmp_path / "new" / "file")
    check_outputs(Output("summary", tmp_path / "other"))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "link", "other"]


def test_inputs_are_not_outputs(tmp_path):
    (tmp_path / "policy").mkdir()
    (tmp_path / "policy" / "config.json").touch()
    with pytest.raises(ValueError, match=r"summary .*config\.json is an input, or part of one"):
        check_outputs(
            Output("summary", tmp_path / "policy" / "config.json"), inputs=[tmp_path / "policy"]
        )
    check_outputs(Output("summary", tmp_path / "policy" / "new"), inputs=[tmp_path / "policy"])


def test_a_file_has_the_ending_that_its_readers_look_for(tmp_path):
    with pytest.raises(ValueError, match=r"summary must be named \*\.json, not .*a\.txt"):
        check_outputs(Output("summary", tmp_path / "a.txt", ".json"))
    check_outputs(Output("summary", tmp_path / "a.json", ".json"), Output("none", None, ".csv"))


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_full_or_read_only_disk_is_the_machines_fault(tmp_path, monkeypatch, number):
    def full(_path):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr("swarm_mj.system.outputs.check_writable", full)
    with pytest.raises(OSError, match=rf"summary .* cannot be written: {os.strerror(number)}"):
        check_outputs(Output("summary", tmp_path / "a"))


OWN_ON_AND_ON = """
import sys, time
from pathlib import Path
from swarm_mj.system.outputs import owned
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


def test_a_lock_is_no_link(tmp_path):
    """The file that it leads to would be written to."""
    (tmp_path / "precious").write_text("x")
    (tmp_path / ".o.csv.lock").symlink_to("precious")
    with pytest.raises(ValueError, match=r"o.csv cannot be locked: .*; unless .* remove .*lock$"):
        owned(tmp_path / "o.csv").__enter__()
    assert (tmp_path / "precious").read_text() == "x"


def test_disks_without_locks_are_written_and_leave_nothing(tmp_path, monkeypatch):
    def fail(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", fail)
    before = num_open()
    with owned(tmp_path / "o.csv"):
        pass
    assert list(tmp_path.iterdir()) == []
    assert num_open() == before
