"""Replays are whole or not there, and hold every layer and the config."""

import subprocess
import sys

import pytest
from reading import entities, static

from swarm_mj.replay.read import check_replay
from swarm_mj.replay.write import write_replay


def test_what_has_no_layer_is_there_and_rerun_s_own_verifier_accepts_the_file(replay):
    shown = {"/legend/ramp", "/ages", "/plots/age/ego", "/state/r000", "/about"}
    assert entities(replay) >= shown
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(replay)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_the_config_is_kept_as_properties(replay):
    for name, value in {"seed": 5, "policy": "mst", "ratio": 0.25}.items():
        assert static(replay, "/__properties/mission", name).tolist() == [value]


def test_the_sheet_says_what_the_team_sent(two_way, tmp_path):
    """Requests and answers of 100 bytes, in 30 windows of 0.1 s."""
    path = tmp_path / "r.rrd"
    write_replay(two_way.log, two_way.mission, {"policy": "mst", "packet_bytes": 100}, path)
    kbit_per_second = 0.8 * two_way.counted("transmitted").sum() / 3.0
    (about,) = static(path, "/about", "TextDocument:text")
    assert f"- **sent by the team**: {kbit_per_second:.4g} kbit/s" in about


def test_a_replay_is_replaced_whole_or_stays(two_way, tmp_path, monkeypatch):
    path = tmp_path / "mission.rrd"
    path.write_text("old")

    def fail(*_):
        raise OSError("no space left")

    with monkeypatch.context() as broken:
        broken.setattr("swarm_mj.replay.write.draw", fail)
        with pytest.raises(OSError, match="no space left"):
            write_replay(two_way.log, two_way.mission, {"seed": 1}, path)
    assert path.read_text() == "old"
    write_replay(two_way.log, two_way.mission, {"seed": 1}, path)
    check_replay(path)
    assert [file.name for file in tmp_path.iterdir()] == ["mission.rrd"]


def test_a_replay_of_500_windows_of_40_robots_stays_below_5_mb(long, tmp_path):
    write_replay(long.log, long.mission, {"seed": 5}, tmp_path / "a.rrd")
    assert 1e6 < (tmp_path / "a.rrd").stat().st_size < 5e6
