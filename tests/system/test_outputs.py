"""Files are checked before the work, and nothing is left by the check."""

import errno
import os
from pathlib import Path

import pytest

from swarm_mj.system.outputs import Output, check_outputs


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
