"""Files are replaced whole: a failure or a kill at any moment leaves one that is."""

import errno
import json
import os

import pytest
from file_limits import no_larger_files

from swarm_mj.system import atomic
from swarm_mj.system.atomic import (
    append_bytes,
    check_writable,
    write_bytes,
    write_csv,
    write_json,
    write_text,
)


def names(folder):
    return sorted(path.name for path in folder.iterdir())


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


def test_what_json_cannot_say_is_not_written(tmp_path):
    write_json(tmp_path / "a.json", {"aoi": 1.5, "name": "ä", "none": None})
    assert json.loads((tmp_path / "a.json").read_text()) == {"aoi": 1.5, "name": "ä", "none": None}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "a.json", {"aoi": float("nan")})
    assert json.loads((tmp_path / "a.json").read_text())["aoi"] == 1.5


def test_rows_become_lines_of_csv(tmp_path):
    write_csv(tmp_path / "a.csv", ["x", "y"], [{"x": 1, "y": None}, {"x": "a,b", "y": 0.1}])
    assert (tmp_path / "a.csv").read_bytes() == b'x,y\n1,\n"a,b",0.1\n'


def test_a_folder_that_cannot_be_listed_is_written(tmp_path, monkeypatch):
    def refuse(path, *arguments, **options):
        if path == tmp_path:
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), path)
        return opened(path, *arguments, **options)

    opened = os.open
    monkeypatch.setattr(os, "open", refuse)
    write_bytes(tmp_path / "x", b"new")
    assert (tmp_path / "x").read_bytes() == b"new"


def part_of(path):
    """The name beside a file while it is being written."""
    with atomic._part(path):
        (part,) = (name for name in names(path.parent) if name.endswith(".part"))
    return part


def test_what_the_dead_had_not_finished_is_removed_and_what_others_write_is_not(tmp_path):
    """Two that write the same file do not disturb each other; the last one to end is kept."""
    dead = part_of(tmp_path / "x")
    left = {".x.notes.part", ".y.01234567.part"}
    for name in {dead, *left}:
        (tmp_path / name).touch()
    with atomic._part(tmp_path / "x"):
        assert dead not in names(tmp_path)
        (alive,) = set(names(tmp_path)) - left
        write_bytes(tmp_path / "x", b"new")
        assert set(names(tmp_path)) == {"x", alive, *left}
    assert set(names(tmp_path)) == {"x", *left}


def test_a_link_in_the_part_s_place_is_not_written_through(tmp_path, monkeypatch):
    monkeypatch.setattr("secrets.token_hex", lambda _: "01234567")
    (tmp_path / "precious").write_text("x")
    monkeypatch.setattr(
        atomic, "_sweep", lambda _: (tmp_path / ".x.01234567.part").symlink_to("precious")
    )
    with pytest.raises(OSError, match="x could not be written: File exists"):
        write_bytes(tmp_path / "x", b"new")
    assert names(tmp_path) == ["precious"]
    assert (tmp_path / "precious").read_text() == "x"


def test_a_disk_without_locks_is_written(tmp_path, monkeypatch):
    def refuse(*_):
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr("fcntl.flock", refuse)
    write_bytes(tmp_path / "x", b"new")
    assert names(tmp_path) == ["x"]
