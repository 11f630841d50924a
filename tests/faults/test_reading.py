"""Files that others hand us, damaged or crafted: one line says so, and the exit code is 2."""

import pytest
from damage import complaint, damaged, program

from swarm_mj.cli import main


@pytest.fixture(scope="module")
def replay(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "a.rrd"
    mission = ["--robots", "5", "--windows", "5"]
    assert main(["fly", "--policy", "tdma", *mission, "--record", str(path)]) == 0
    return path


@pytest.mark.fault("damaged files are told")
def test_damaged_replays_are_told_by_all_readers(replay, tmp_path, capsys, record_property):
    """Fault 11: a flip in what a replay holds was shown as if it had been flown, or crashed."""
    picture = program("tools", "picture")
    path, num_tries = tmp_path / "a.rrd", 0
    for content in damaged(replay.read_bytes()):
        path.write_bytes(content)
        num_tries += 1
        assert "is no whole replay: damaged" in complaint(capsys, main(["replay", str(path)]))
        with pytest.raises(ValueError, match="is no whole replay: damaged"):
            picture.take_picture(path, None, tmp_path / "a.png", "1600x900", 0)
    record_property("tries", num_tries)
