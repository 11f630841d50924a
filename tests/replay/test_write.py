"""Replays are whole or not there, and hold every layer and the config."""

import subprocess
import sys

import pytest
from reading import static
from rerun.chunk import RrdReader

from swarm_mj.replay.read import check_replay, windows
from swarm_mj.replay.write import write_replay


def entities(path):
    """What a replay shows."""
    return {chunk.entity_path for chunk in RrdReader(path).stream()}


def test_what_has_no_layer_is_there(replay):
    assert entities(replay) >= {"/legend/ramp", "/ages", "/plots/age/ego", "/state/r000", "/about"}


def test_the_config_is_kept_as_properties(replay):
    (properties,) = (
        chunk.to_record_batch()
        for chunk in RrdReader(replay).stream()
        if chunk.entity_path == "/__properties/mission"
    )
    kept = {
        name.split(":")[-1]: properties.column(name)[0].as_py() for name in properties.schema.names
    }
    assert kept["seed"] == [5]
    assert kept["policy"] == ["mst"]
    assert kept["ratio"] == [0.25]


def test_the_sheet_says_what_the_team_sent(two_way, tmp_path):
    """Requests and answers of 100 bytes, in 30 windows of 0.1 s."""
    path = tmp_path / "r.rrd"
    write_replay(two_way.log, two_way.mission, {"policy": "mst", "packet_bytes": 100}, path)
    kbit_per_second = 0.8 * two_way.counted("transmitted").sum() / 3.0
    (about,) = static(path, "/about", "TextDocument:text")
    assert f"- **sent by the team**: {kbit_per_second:.4g} kbit/s" in about


def test_rerun_s_own_verifier_accepts_the_file(replay):
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(replay)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_a_replay_is_replaced_whole_and_leaves_nothing_beside_it(two_way, tmp_path):
    path = tmp_path / "mission.rrd"
    path.write_text("old")
    write_replay(two_way.log, two_way.mission, {"seed": 1}, path)
    check_replay(path)
    assert [file.name for file in tmp_path.iterdir()] == ["mission.rrd"]


def test_a_failure_while_writing_leaves_nothing(two_way, tmp_path, monkeypatch):
    def fail(*_):
        raise OSError("no space left")

    monkeypatch.setattr("swarm_mj.replay.write.draw", fail)
    with pytest.raises(OSError, match="no space left"):
        write_replay(two_way.log, two_way.mission, {"seed": 1}, tmp_path / "mission.rrd")
    assert list(tmp_path.iterdir()) == []


def test_a_broadcast_has_no_arrow_and_no_verdict(flood_replay):
    found = {path for path in entities(flood_replay) if "radio" in path and "legend" not in path}
    assert found == {
        "/arena/radio/heard",
        "/arena/radio/range",
        "/arena/radio/transmitter",
        "/plots/radio/heard",
        "/plots/radio/sent",
    }
    assert len(windows(flood_replay)) == 30


def test_a_team_at_rest_has_no_velocities(still_replay):
    found = entities(still_replay)
    assert not found & {"/arena/heading", "/arena/trail", "/arena/belief/ring"}
    assert not any(path.startswith("/plots/task") for path in found)
    assert {"/plots/age/mean", "/arena/tree", "/arena/radio/delivered"} <= found


def test_a_replay_of_500_windows_of_40_robots_stays_below_5_mb(long, tmp_path):
    write_replay(long.log, long.mission, {"seed": 5}, tmp_path / "a.rrd")
    assert 1e6 < (tmp_path / "a.rrd").stat().st_size < 5e6
