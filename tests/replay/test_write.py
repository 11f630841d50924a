"""Replays are whole or not there, and hold every layer and the config."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from swarm_mj.replay.read import check_replay, windows
from swarm_mj.replay.write import reach, write_replay

ENTITIES = {
    "/arena/robots",
    "/arena/heading",
    "/arena/trail",
    "/arena/observer",
    "/arena/area/walls",
    "/arena/belief/ring",
    "/arena/belief/error",
    "/arena/tree",
    "/arena/radio/delivered",
    "/arena/radio/lost",
    "/arena/radio/answered",
    "/arena/radio/unanswered",
    "/arena/radio/overheard",
    "/arena/radio/range",
    "/arena/legend/ramp",
    "/tree/nodes",
    "/tree/edges",
    "/ages",
    "/plots/age/mean",
    "/plots/age/observer",
    "/plots/flock/variance",
    "/plots/radio/delivered",
    "/state/r000",
    "/about",
}


def test_all_layers_are_there(replay):
    found = {chunk.entity_path for chunk in RrdReader(replay).stream()}
    assert found >= ENTITIES


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


def test_a_flooded_stationary_flight_can_be_drawn_too(flooded, tmp_path):
    path = tmp_path / "flood.rrd"
    write_replay(flooded.log, flooded.mission, {"seed": 5}, path)
    assert len(windows(path)) == 30


def test_the_map_holds_the_area_and_robots_outside_it(two_way):
    log, mission = two_way.log, two_way.mission
    assert reach(log, mission) == mission.half_side_m
    far = replace(log, position_m=log.position_m + np.array([5e3, 0.0]))
    assert reach(far, mission) == pytest.approx(5e3 + log.position_m[..., 0].max())
