"""Files and folders are replaced whole: a failure or a kill at any moment leaves one that is."""

import errno
import json
import os
import shutil
import subprocess
from pathlib import Path

import pytest
from file_limits import no_larger_files

from swarm_mj.system import atomic
from swarm_mj.system.atomic import (
    append_bytes,
    check_writable,
    present_folder,
    write_bytes,
    write_csv,
    write_folder,
    write_json,
    write_text,
)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_in_folders_that_are_made(tmp_path):
    write_text(tmp_path / "a" / "b.txt", "täxt")
    assert (tmp_path / "a" / "b.txt").read_bytes() == "täxt".encode()
    assert names(tmp_path / "a") == ["b.txt"]


def test_a_file_that_fails_its_check_leaves_the_old_one(tmp_path):
    path = tmp_path / "a"
    seen = []

    def refuse(part):
        seen.append(part.read_bytes())
        raise ValueError("it has no end")

    write_bytes(path, b"old")
    with pytest.raises(OSError, match=rf"{path} could not be written: it has no end"):
        write_bytes(path, b"new", check=refuse)
    assert seen == [b"new"]
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a"]


def test_an_interrupt_leaves_the_old_file(tmp_path):
    def interrupt(_part):
        raise KeyboardInterrupt

    write_bytes(tmp_path / "a", b"old")
    with pytest.raises(KeyboardInterrupt):
        write_bytes(tmp_path / "a", b"new", check=interrupt)
    assert (tmp_path / "a").read_bytes() == b"old"
    assert names(tmp_path) == ["a"]


def test_a_full_disk_leaves_the_old_file_and_is_named(tmp_path):
    path = tmp_path / "a"
    write_bytes(path, b"old")
    with no_larger_files(100), pytest.raises(OSError, match=rf"{path} could not .* File too large"):
        write_bytes(path, bytes(101))
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["a"]


def test_a_full_disk_is_found_before_the_work(tmp_path):
    check_writable(tmp_path / "a" / "b")
    with no_larger_files(), pytest.raises(OSError, match="File too large"):
        check_writable(tmp_path / "a" / "b")
    assert names(tmp_path) == []


def test_what_cannot_be_added_is_not_added_in_part(tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"12345\n")
    append_bytes(path, b"67890\n")
    with (
        no_larger_files(15),
        pytest.raises(OSError, match=rf"{path} could not be written: File too"),
    ):
        append_bytes(path, b"abcde\n")
    assert path.read_bytes() == b"12345\n67890\n"


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real").write_text("old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write_text(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real").read_text() == "new"


def test_a_loop_of_links_is_one_error(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(OSError, match="a/c could not be written: "):
        write_text(tmp_path / "a" / "c", "new")
    assert present_folder(tmp_path / "a") == tmp_path / "a"


def test_what_json_cannot_say_is_not_written(tmp_path):
    write_json(tmp_path / "a.json", {"aoi": 1.5, "name": "ä", "none": None})
    assert json.loads((tmp_path / "a.json").read_text()) == {"aoi": 1.5, "name": "ä", "none": None}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "a.json", {"aoi": float("nan")})
    assert json.loads((tmp_path / "a.json").read_text())["aoi"] == 1.5


def test_rows_become_lines_of_csv(tmp_path):
    write_csv(tmp_path / "a.csv", ["x", "y"], [{"x": 1, "y": None}, {"x": "a,b", "y": 0.1}])
    assert (tmp_path / "a.csv").read_bytes() == b'x,y\n1,\n"a,b",0.1\n'


def write(path, text):
    write_folder(path, {"a": text.encode(), "b": text.encode()})


def content(path):
    """What the folder holds, which must be of one version; None: there is none."""
    present = present_folder(path)
    if not present.exists():
        return None
    first, second = (present / "a").read_text(), (present / "b").read_text()
    assert first == second
    assert len(list(present.iterdir())) == 2
    return first


def test_a_folder_is_replaced_with_all_that_it_held(tmp_path):
    write(tmp_path / "x", "old")
    (tmp_path / "x" / "c").write_text("more")
    write(tmp_path / "x", "new")
    assert content(tmp_path / "x") == "new"
    assert names(tmp_path) == ["x"]


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_folder_and_nothing_else(tmp_path, failure):
    def fail(part):
        assert content(part) == "new"
        raise failure

    write(tmp_path / "x", "old")
    with pytest.raises((OSError, KeyboardInterrupt)):
        write_folder(tmp_path / "x", {"a": b"new", "b": b"new"}, check=fail)
    assert content(tmp_path / "x") == "old"
    assert names(tmp_path) == ["x"]


class KilledError(BaseException):
    """The process is gone: nothing that it would do to files happens any more."""


def killed_before_step(monkeypatch, last):
    """Lets `last` steps happen to folders, and then no more."""
    steps = 0

    def counted(step):
        def taken(*arguments, **options):
            nonlocal steps
            steps += 1
            if steps > last:
                raise KilledError
            return step(*arguments, **options)

        return taken

    def emptied_first(path, **options):
        """Removing a folder takes two steps: it loses a file, then the rest."""
        next(iter(sorted(Path(path).glob("*"))), Path(path) / "none").unlink(missing_ok=True)
        counted(removed)(path, **options)

    removed = shutil.rmtree
    monkeypatch.setattr(shutil, "rmtree", counted(emptied_first))
    monkeypatch.setattr(os, "fsync", counted(os.fsync))
    for name in ("mkdir", "rename"):
        monkeypatch.setattr(Path, name, counted(getattr(Path, name)))


@pytest.mark.parametrize("is_old_aside", [False, True])
@pytest.mark.parametrize("last", range(16))
def test_a_kill_at_any_moment_leaves_the_old_folder_or_the_new_one(tmp_path, last, is_old_aside):
    """Also if the kill before left the old folder aside; and the next writer finds its way."""
    path = tmp_path / "x"
    write(path, "old")
    if is_old_aside:
        path.rename(tmp_path / ".x.old")
    with pytest.MonkeyPatch.context() as patch:
        killed_before_step(patch, last)
        try:
            write(path, "new")
            is_killed = False
        except KilledError:
            is_killed = True
    assert content(path) in ("old", "new")
    if last == 0:
        assert content(path) == "old"
    if last == 15:
        assert not is_killed
    write(path, "newer")
    assert content(path) == "newer"
    assert names(tmp_path) == ["x"]


def test_a_first_folder_is_there_or_not(tmp_path):
    for last in range(16):
        with pytest.MonkeyPatch.context() as patch:
            killed_before_step(patch, last)
            try:
                write(tmp_path / f"{last}", "new")
            except KilledError:
                assert content(tmp_path / f"{last}") in (None, "new")
    assert content(tmp_path / "15") == "new"


@pytest.fixture
def machine(monkeypatch):
    """Gives this machine another name, as each container has its own."""
    system = os.uname()

    def rename(name):
        renamed = os.uname_result((system[0], name, *system[2:]))
        monkeypatch.setattr(os, "uname", lambda: renamed)

    return rename


def parts_of_a_write(path):
    """The names beside a file while it is being written."""
    seen = []
    write_bytes(path, b"new", check=lambda part: seen.extend(names(part.parent)))
    return [name for name in seen if name.endswith(".part")]


def test_what_the_dead_had_not_finished_is_removed_and_what_others_write_is_not(tmp_path):
    ended = subprocess.Popen(["true"])
    ended.wait()
    (mine,) = parts_of_a_write(tmp_path / "x")
    dead, alive = (mine.replace(str(os.getpid()), str(n)) for n in (ended.pid, os.getppid()))
    (tmp_path / "x").unlink()
    (tmp_path / dead).mkdir()
    (tmp_path / dead / "a").touch()
    (tmp_path / mine).mkdir()  # of a dead process that had this one's number
    (tmp_path / ".x.old").mkdir()
    left = {alive, ".x.notes.part", ".y.part"}
    for name in left:
        (tmp_path / name).touch()
    write(tmp_path / "x", "new")
    assert content(tmp_path / "x") == "new"
    assert set(names(tmp_path)) == {"x", *left}


def test_what_another_machine_writes_is_left_alone(tmp_path, machine):
    """Even by a process of the same number: all containers' first have the number 1."""

    def write_elsewhere(part):
        machine("elsewhere")
        write_bytes(tmp_path / "x", b"theirs")
        assert part.read_bytes() == b"mine"

    machine("here")
    write_bytes(tmp_path / "x", b"mine", check=write_elsewhere)
    assert (tmp_path / "x").read_bytes() == b"mine"
    assert names(tmp_path) == ["x"]


def test_a_link_in_the_part_s_place_is_not_written_through(tmp_path, monkeypatch):
    """It was put there after the last look."""
    (mine,) = parts_of_a_write(tmp_path / "x")
    (tmp_path / "precious").write_text("x")
    monkeypatch.setattr(atomic, "_sweep", lambda _: (tmp_path / mine).symlink_to("precious"))
    with pytest.raises(OSError, match="x could not be written: File exists"):
        write_bytes(tmp_path / "x", b"newer")
    assert (tmp_path / "precious").read_text() == "x"
    assert (tmp_path / "x").read_bytes() == b"new"


@pytest.mark.parametrize("add", [write_bytes, append_bytes])
def test_a_disk_that_holds_something_else_is_told(tmp_path, monkeypatch, add):
    def spoil(number):
        os.ftruncate(number, os.fstat(number).st_size - 1)

    path = tmp_path / "x"
    write_bytes(path, b"old")
    monkeypatch.setattr(os, "fsync", spoil)
    with pytest.raises(OSError, match="x could not be written: the disk gives back something"):
        add(path, bytes(3 * 2**20))
    assert path.read_bytes() == b"old"
    assert names(tmp_path) == ["x"]


def test_a_folder_that_cannot_be_listed_is_written(tmp_path, monkeypatch):
    def refuse(path, *arguments, **options):
        if path == tmp_path:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)
        return opened(path, *arguments, **options)

    opened = os.open
    monkeypatch.setattr(os, "open", refuse)
    write_bytes(tmp_path / "x", b"new")
    assert (tmp_path / "x").read_bytes() == b"new"


def test_a_link_stays_and_its_folder_is_replaced(tmp_path):
    write(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert content(tmp_path / "real") == "new"


def test_what_does_not_exist_is_under_its_own_name(tmp_path):
    assert present_folder(tmp_path / "x") == tmp_path / "x"
