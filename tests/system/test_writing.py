"""Files are checked, owned by one process, and replaced whole; a failure or a kill leaves one."""

import errno
import fcntl
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from file_limits import no_larger_files

from swarm_mj.system import writing
from swarm_mj.system.writing import (
    Output,
    append_bytes,
    check_outputs,
    check_writable,
    owned,
    write_bytes,
    write_csv,
    write_json,
    write_text,
)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def failing(number):
    """A call of the system that fails, of whatever it is asked."""

    def fail(*_arguments, **_options):
        raise OSError(number, os.strerror(number))

    return fail


def test_a_file_appears_in_folders_that_are_made(tmp_path):
    write_text(tmp_path / "a" / "b.txt", "täxt")
    assert (tmp_path / "a" / "b.txt").read_bytes() == "täxt".encode()
    assert names(tmp_path / "a") == ["b.txt"]


def test_an_interrupt_leaves_the_old_file(tmp_path, monkeypatch):
    def interrupt(_number):
        raise KeyboardInterrupt

    write_bytes(tmp_path / "a", b"old")
    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "a", b"new")
    assert (tmp_path / "a").read_bytes() == b"old"
    assert names(tmp_path) == ["a"]


def test_a_full_disk_leaves_the_old_file_and_is_named(tmp_path):
    path = tmp_path / "a"
    write_bytes(path, b"12345\n")
    append_bytes(path, b"67890\n")
    complaint = rf"{path} could not be written: File too large"
    with no_larger_files(15), pytest.raises(OSError, match=complaint):
        write_bytes(path, bytes(16))
    assert path.read_bytes() == b"12345\n67890\n"
    with no_larger_files(15), pytest.raises(OSError, match=complaint):
        append_bytes(path, b"abcde\n")
    assert path.read_bytes() == b"12345\n67890\nabc"  # readers drop a line that has no end
    assert names(tmp_path) == ["a"]


def test_a_full_disk_is_found_before_the_work(tmp_path):
    check_writable(tmp_path / "a" / "b")
    with no_larger_files(), pytest.raises(OSError, match="File too large"):
        check_writable(tmp_path / "a" / "b")
    assert names(tmp_path) == []


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write_text(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"


def test_what_json_cannot_say_is_not_written(tmp_path):
    write_json(tmp_path / "a.json", {"aoi": 1.5, "name": "ä", "none": None})
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "a.json", {"aoi": float("nan")})
    assert json.loads((tmp_path / "a.json").read_text()) == {"aoi": 1.5, "name": "ä", "none": None}


def test_rows_become_lines_of_csv(tmp_path):
    write_csv(tmp_path / "a.csv", ["x", "y"], [{"x": 1, "y": None}, {"x": "a,b", "y": 0.1}])
    assert (tmp_path / "a.csv").read_bytes() == b'x,y\n1,\n"a,b",0.1\n'


def test_a_folder_that_cannot_be_listed_on_a_disk_without_locks_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "open", failing(errno.EACCES))
    monkeypatch.setattr(fcntl, "flock", failing(errno.ENOLCK))
    write_bytes(tmp_path / "x", b"new")
    assert (tmp_path / "x").read_bytes() == b"new"
    assert names(tmp_path) == ["x"]


def part_of(path):
    """The name beside a file while it is being written."""
    with writing._part(path):
        (part,) = (name for name in names(path.parent) if name.endswith(".part"))
    return part


def test_what_the_dead_had_not_finished_is_removed_and_what_others_write_is_not(tmp_path):
    """Two that write the same file do not disturb each other; the last one to end is kept."""
    dead = part_of(tmp_path / "x")
    left = {".x.notes.part", ".y.01234567.part"}
    for name in {dead, *left}:
        (tmp_path / name).touch()
    with writing._part(tmp_path / "x"):
        assert dead not in names(tmp_path)
        (alive,) = set(names(tmp_path)) - left
        write_bytes(tmp_path / "x", b"new")
        assert set(names(tmp_path)) == {"x", alive, *left}
    assert set(names(tmp_path)) == {"x", *left}


@pytest.fixture
def places(here):
    """Files, folders and links that may be in the way."""
    (here / "old").write_text("kept")
    (here / "policy").mkdir()
    (here / "policy" / "config.json").touch()
    for name, target in (("a.json", "b.json"), ("b.json", "a.json"), ("in file", "old/below")):
        (here / name).symlink_to(target)
    (here / "in new").symlink_to("new/file")
    return here


@pytest.mark.parametrize(
    ("path", "complaint"),
    [
        ("old/below", "summary .* cannot be written: Not a directory"),
        ("x" * 300, "summary .* cannot be written: File name too long"),
        (".", r"summary \. is a folder"),
        ("old", "old exists; name another, or replace it with --force"),
        ("/dev/null", "is a device or a pipe"),
        ("a.json", r"a\.json cannot be written: Too many levels"),
        ("in file", "Not a directory"),
        ("policy/config.json", r"summary .*config\.json is an input, or part of one"),
    ],
)
def test_outputs_that_cannot_be_written_or_would_lose_something_are_refused(
    places, path, complaint
):
    before = sorted(places.rglob("*"))
    with pytest.raises(ValueError, match=complaint):
        check_outputs(Output("summary", Path(path)), inputs=[Path("policy")], must_be_new=True)
    assert sorted(places.rglob("*")) == before


@pytest.mark.parametrize("path", ["a/b/c.json", "policy/new", "in new"])
def test_files_in_missing_folders_and_beside_inputs_can_be_written(places, path):
    before = sorted(places.rglob("*"))
    check_outputs(Output("summary", Path(path)), inputs=[Path("policy")], must_be_new=True)
    check_outputs(Output("replay", Path("old")))
    assert sorted(places.rglob("*")) == before


def test_a_file_has_the_ending_that_its_readers_look_for(tmp_path):
    with pytest.raises(ValueError, match=r"summary must be named \*\.json, not .*a\.txt"):
        check_outputs(Output("summary", tmp_path / "a.txt", ".json"))
    check_outputs(Output("summary", tmp_path / "a.json", ".json"), Output("none", None, ".csv"))


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS])
def test_a_full_or_read_only_disk_is_the_machines_fault(tmp_path, monkeypatch, number):
    monkeypatch.setattr(writing, "check_writable", failing(number))
    with pytest.raises(OSError, match=rf"summary .* cannot be written: {os.strerror(number)}"):
        check_outputs(Output("summary", tmp_path / "a"))


OWN_ON_AND_ON = """
import sys, time
from pathlib import Path
from swarm_mj.system.writing import owned
with owned(Path(sys.argv[1])):
    print(flush=True)
    time.sleep(600)
"""


def test_a_second_process_is_refused_until_the_first_is_killed(tmp_path):
    command = [sys.executable, "-c", OWN_ON_AND_ON, str(tmp_path / "o.csv")]
    (tmp_path / "alias").symlink_to(tmp_path)
    with subprocess.Popen(command, stdout=subprocess.PIPE) as owner:
        owner.stdout.readline()
        for name in ("o.csv", "alias/o.csv"):
            with pytest.raises(ValueError, match=f"is being written by process {owner.pid};"):
                owned(tmp_path / name).__enter__()
        with owned(tmp_path / "other.csv"):
            pass
        owner.send_signal(signal.SIGKILL)
    assert names(tmp_path) == [".o.csv.lock", "alias"]
    with owned(tmp_path / "o.csv"):
        assert (tmp_path / ".o.csv.lock").read_text() == str(os.getpid())
    assert names(tmp_path) == ["alias"]


def test_it_can_be_owned_again(tmp_path):
    for _ in range(2):
        with owned(tmp_path / "new" / "o.csv"), pytest.raises(ValueError, match=str(os.getpid())):
            owned(tmp_path / "new" / "o.csv").__enter__()
    assert list(tmp_path.iterdir()) == []


def test_folders_that_it_made_are_left_if_something_is_in_them(tmp_path):
    with owned(tmp_path / "kept" / "new" / "o.csv"):
        (tmp_path / "kept" / "a").touch()
    assert [path.name for path in tmp_path.rglob("*")] == ["kept", "a"]


def test_a_lock_is_no_link(tmp_path):
    """The file that it leads to would be written to."""
    (tmp_path / "precious").write_text("x")
    (tmp_path / ".o.csv.lock").symlink_to("precious")
    with pytest.raises(OSError, match=r"\.o\.csv\.lock"):
        owned(tmp_path / "o.csv").__enter__()
    assert (tmp_path / "precious").read_text() == "x"


def test_disks_without_locks_are_written_and_leave_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr(fcntl, "flock", failing(errno.ENOLCK))
    before = os.listdir("/proc/self/fd")
    with owned(tmp_path / "o.csv"):
        pass
    assert list(tmp_path.iterdir()) == []
    assert len(os.listdir("/proc/self/fd")) == len(before)
