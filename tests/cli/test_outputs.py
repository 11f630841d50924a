"""Files are checked before the work, and nothing is left by the check."""

from pathlib import Path

import pytest

from swarm_mj.cli.outputs import check_outputs


def test_a_file_in_missing_folders_can_be_written(tmp_path):
    path = tmp_path / "a" / "b" / "c.json"
    check_outputs({"summary": path}, must_be_new=True)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["file/below", "x" * 300])
def test_places_that_cannot_be_written_are_named(tmp_path, name):
    (tmp_path / "file").write_text("kept")
    with pytest.raises(ValueError, match=r"summary .* cannot be written"):
        check_outputs({"summary": tmp_path / name})
    assert [file.name for file in tmp_path.iterdir()] == ["file"]


def test_folders_and_existing_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="is a folder"):
        check_outputs({"replay": tmp_path})
    path = tmp_path / "old"
    path.write_text("kept")
    with pytest.raises(ValueError, match="--force"):
        check_outputs({"replay": path}, must_be_new=True)
    check_outputs({"replay": path})


def test_devices_are_refused():
    with pytest.raises(ValueError, match="is a device or a pipe"):
        check_outputs({"summary": Path("/dev/null")})
