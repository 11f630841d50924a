"""Files and folders are replaced whole: a failure or a kill at any moment leaves one that is."""

import json
import shutil
from pathlib import Path

import pytest

from swarm_mj.io.atomic import atomic_directory, atomic_write, present_folder, write_json


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "a" / "b.txt"
    with atomic_write(path) as part:
        part.write_text("text")
        assert not path.exists()
    assert path.read_text() == "text"
    assert list(path.parent.iterdir()) == [path]


@pytest.mark.parametrize("failure", [OSError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_file_and_nothing_else(tmp_path, failure):
    path = tmp_path / "summary.json"
    path.write_text("old")

    def write_half():
        with atomic_write(path) as part:
            part.write_text("ne")
            raise failure

    with pytest.raises(failure):
        write_half()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_link_stays_and_its_file_is_replaced(tmp_path):
    (tmp_path / "real").write_text("old")
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "real")
    with atomic_write(link) as part:
        part.write_text("new")
    assert link.is_symlink()
    assert (tmp_path / "real").read_text() == "new"


def test_what_json_cannot_say_is_not_written(tmp_path):
    write_json(tmp_path / "a.json", {"aoi": 1.5, "name": "ä", "none": None})
    assert json.loads((tmp_path / "a.json").read_text()) == {"aoi": 1.5, "name": "ä", "none": None}
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "a.json", {"aoi": float("nan")})
    assert json.loads((tmp_path / "a.json").read_text())["aoi"] == 1.5


def write(path, text):
    with atomic_directory(path) as part:
        for name in ("a", "b"):
            (part / name).write_text(text)


def content(path):
    """What the folder holds, which must be of one version; None: there is none."""
    present = present_folder(path)
    if not present.exists():
        return None
    first, second = (present / "a").read_text(), (present / "b").read_text()
    assert first == second
    assert len(list(present.iterdir())) == 2
    return first


def test_a_folder_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "runs" / "x"
    with atomic_directory(path) as part:
        (part / "a").write_text("text")
        assert not path.exists()
    assert (path / "a").read_text() == "text"
    assert list(path.parent.iterdir()) == [path]


def test_a_folder_is_replaced_with_all_that_it_held(tmp_path):
    write(tmp_path / "x", "old")
    (tmp_path / "x" / "c").write_text("more")
    write(tmp_path / "x", "new")
    assert content(tmp_path / "x") == "new"
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


@pytest.mark.parametrize("failure", [OSError, KeyboardInterrupt])
def test_a_failure_leaves_the_old_folder_and_nothing_else(tmp_path, failure):
    write(tmp_path / "x", "old")

    def write_half():
        with atomic_directory(tmp_path / "x") as part:
            (part / "a").write_text("ne")
            raise failure

    with pytest.raises(failure):
        write_half()
    assert content(tmp_path / "x") == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["x"]


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
    for name in ("mkdir", "rename", "write_text"):
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
    assert not (tmp_path / ".x.old").exists()


def test_a_first_folder_is_there_or_not(tmp_path):
    for last in range(12):
        with pytest.MonkeyPatch.context() as patch:
            killed_before_step(patch, last)
            try:
                write(tmp_path / f"{last}", "new")
            except KilledError:
                assert content(tmp_path / f"{last}") in (None, "new")
    assert content(tmp_path / "11") == "new"


def test_leftovers_of_others_do_no_harm(tmp_path):
    (tmp_path / ".x.1.part").mkdir()
    (tmp_path / ".x.old").mkdir()
    write(tmp_path / "x", "new")
    assert content(tmp_path / "x") == "new"
    assert sorted(path.name for path in tmp_path.iterdir()) == [".x.1.part", "x"]


def test_a_link_stays_and_its_folder_is_replaced(tmp_path):
    write(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    write(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert content(tmp_path / "real") == "new"


def test_what_does_not_exist_is_under_its_own_name(tmp_path):
    assert present_folder(tmp_path / "x") == tmp_path / "x"
