"""Replays read back from the file, against the flight they show."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest
from rerun.chunk import RrdReader

from swarm_mj.replay import palette
from swarm_mj.replay.links import fates
from swarm_mj.replay.read import check_replay, windows
from swarm_mj.replay.write import write_replay

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


@pytest.fixture(scope="module")
def replay(two_way, tmp_path_factory):
    path = tmp_path_factory.mktemp("replays") / "mission.rrd"
    write_replay(two_way.log, two_way.mission, {"seed": 5, "policy": "mst", "ratio": 0.25}, path)
    return path


def column(path, entity, component):
    """The one timed chunk of an entity: a component's rows as nested lists."""
    chunks = [
        chunk.to_record_batch()
        for chunk in RrdReader(path).stream().filter(content=entity)
        if not chunk.is_static
    ]
    (chunk,) = (batch for batch in chunks if component in batch.schema.names)
    return chunk.column(component)


def rows(path, entity, component, *shape):
    """A component with the same number of values in each window."""
    return column(path, entity, component).flatten().flatten().to_numpy().reshape(-1, *shape)


def counts(path, entity, component):
    """How many values a component has in each window."""
    return np.diff(column(path, entity, component).offsets.to_numpy())


def test_all_layers_are_there(replay):
    found = {chunk.entity_path for chunk in RrdReader(replay).stream()}
    assert found >= ENTITIES


def test_positions_are_the_simulation_s(replay, two_way):
    shown = rows(replay, "/arena/robots", "Points2D:positions", 12, 2)
    np.testing.assert_allclose(shown, two_way.log.position_m, rtol=1e-6, atol=1e-4)


def test_windows_are_the_flight_s(replay, two_way):
    np.testing.assert_array_equal(windows(replay), two_way.log.window)


@pytest.mark.parametrize("fate", ["delivered", "lost", "answered"])
def test_arrows_are_as_many_as_the_packets_counted(replay, two_way, fate):
    shown = counts(replay, f"/arena/radio/{fate}", "Arrows2D:vectors")
    np.testing.assert_array_equal(shown, two_way.counted(fate))


def test_a_delivered_packet_s_arrow_ends_at_its_receiver(replay, two_way):
    links = fates(two_way.log)["delivered"]
    entity = "/arena/radio/delivered"
    start = rows(replay, entity, "Arrows2D:origins", 2)
    way = rows(replay, entity, "Arrows2D:vectors", 2)
    receiver = two_way.log.position_m[links.row, links.receiver]
    np.testing.assert_allclose(start + way, receiver, rtol=1e-5, atol=1e-2)


def test_a_lost_packet_s_arrow_stops_short(replay, two_way):
    links = fates(two_way.log)["lost"]
    start = two_way.log.position_m[links.row, links.sender]
    full = two_way.log.position_m[links.row, links.receiver] - start
    way = rows(replay, "/arena/radio/lost", "Arrows2D:vectors", 2)
    np.testing.assert_allclose(way, 0.6 * full, rtol=1e-5, atol=1e-2)


def test_rings_are_where_the_observer_believes_the_others(replay, two_way):
    log = two_way.log
    shown = log.is_known & (np.arange(12) != log.observer)
    entity = "/arena/belief/ring"
    np.testing.assert_array_equal(
        counts(replay, entity, "Ellipses2D:centers"), np.sum(shown, axis=1)
    )
    centres = rows(replay, entity, "Ellipses2D:centers", 2)
    np.testing.assert_allclose(centres, log.believed_m[shown], rtol=1e-6, atol=1e-4)


def test_the_matrix_holds_every_pair_s_age(replay, two_way):
    tensors = column(replay, "/ages", "Tensor:data").flatten()
    shown = np.stack([np.array(tensor["buffer"]) for tensor in tensors.to_pylist()])
    expected = two_way.log.age.reshape(len(shown), -1)
    full_scale = shown.max()
    # Rows and columns are permuted alike, so the ages agree as a set.
    np.testing.assert_array_equal(
        np.sort(shown, axis=1), np.sort(np.minimum(expected, full_scale), axis=1)
    )


def static(path, entity, component):
    """A component that never changes."""
    (value,) = (
        chunk.to_record_batch().column(component)
        for chunk in RrdReader(path).stream().filter(content=entity)
        if chunk.is_static and component in chunk.to_record_batch().schema.names
    )
    return np.array(value.flatten().flatten().to_pylist()).ravel()


def test_rows_of_the_matrix_own_and_columns_are_owned(replay, two_way):
    """The observer's row, wherever the walk put it, is what the observer knows."""
    tensors = column(replay, "/ages", "Tensor:data").flatten().to_pylist()
    shown = np.array(tensors[-1]["buffer"]).reshape(12, 12)
    full_scale = shown.max()
    own = np.sort(np.minimum(two_way.log.observer_age[-1], full_scale)).astype(np.float16)
    about = np.minimum(two_way.log.age[-1, :, two_way.log.observer], full_scale)
    assert any(np.array_equal(np.sort(row), own) for row in shown)
    assert any(np.array_equal(np.sort(owned), np.sort(about)) for owned in shown.T)
    assert not any(np.array_equal(np.sort(row), np.sort(about)) for row in shown)


def test_north_is_up(replay):
    np.testing.assert_array_equal(
        static(replay, "/arena", "Transform3D:mat3x3"), [1, 0, 0, 0, -1, 0, 0, 0, 1]
    )


def test_robots_wear_the_colour_of_their_age(replay, two_way):
    log = two_way.log
    rgba = column(replay, "/arena/robots", "Points2D:colors").flatten().to_numpy()
    shown = np.stack([(rgba >> shift) & 255 for shift in (24, 16, 8)], axis=-1).reshape(-1, 12, 3)
    assert np.all(shown[:, log.observer] == 255)
    assert np.all(shown[~log.is_known] == palette.UNKNOWN)
    newest = log.is_known & (log.observer_age == 0.0) & (np.arange(12) != log.observer)
    assert np.all(shown[newest] == (253, 231, 37))
    luma = shown @ np.array([0.299, 0.587, 0.114])
    others = log.is_known[-1] & (np.arange(12) != log.observer)
    by_age = np.argsort(log.observer_age[-1][others])
    assert np.all(np.diff(luma[-1][others][by_age]) <= 0)


def test_circles_have_the_range_and_stand_around_transmitters(replay, two_way):
    log = two_way.log
    entity = "/arena/radio/range"
    assert set(rows(replay, entity, "Ellipses2D:half_sizes")) == {250.0}
    centres = rows(replay, entity, "Ellipses2D:centers", 2)
    per_window = counts(replay, entity, "Ellipses2D:centers")
    row, sender = np.nonzero(log.recipient[:, 0] != np.arange(12))
    np.testing.assert_array_equal(per_window, np.bincount(row, minlength=len(log.window)))
    expected = log.position_m[row, sender]
    for window in range(len(log.window)):
        here = np.repeat(np.arange(len(log.window)), per_window) == window
        np.testing.assert_allclose(
            sorted(centres[here].tolist()), sorted(expected[row == window].tolist()), rtol=1e-5
        )


def test_the_tree_on_the_map_joins_parents_and_children(replay, two_way):
    log = two_way.log
    strips = rows_of_strips(replay, "/arena/tree")
    row, child = np.nonzero(log.is_known & (np.arange(12) != log.observer))
    parent = log.parent[row, child]
    expected = np.stack([log.position_m[row, parent], log.position_m[row, child]], axis=1)
    np.testing.assert_allclose(strips, expected, rtol=1e-5, atol=1e-3)


def rows_of_strips(path, entity):
    """Straight lines as [start, end] pairs, all windows in a row."""
    lines = column(path, entity, "LineStrips2D:strips").flatten()
    return lines.flatten().flatten().to_numpy().reshape(-1, 2, 2)


def test_the_clock_of_the_mission_runs_beside_the_windows(replay, two_way):
    (chunk,) = (
        chunk.to_record_batch()
        for chunk in RrdReader(replay).stream().filter(content="/arena/robots")
        if not chunk.is_static
    )
    nanoseconds = chunk.column("mission_time").to_numpy(zero_copy_only=False).astype(np.int64)
    np.testing.assert_allclose(nanoseconds / 1e9, 0.1 * two_way.log.window)


def test_plots_are_the_costs(replay, two_way):
    shown = column(replay, "/plots/flock/variance", "Scalars:scalars").flatten().to_numpy()
    np.testing.assert_allclose(shown, two_way.log.velocity_variance_m2ps2, rtol=1e-12)
    values = column(replay, "/plots/age/mean", "Measurements:values").flatten().to_numpy()
    np.testing.assert_allclose(values, two_way.log.age_mean, rtol=1e-6)


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


def test_the_layout_is_inside_the_file(replay):
    assert len(RrdReader(replay).blueprints()) == 1


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


def test_a_truncated_replay_is_refused(replay, tmp_path):
    broken = tmp_path / "broken.rrd"
    broken.write_bytes(replay.read_bytes()[: replay.stat().st_size // 2])
    with pytest.raises(ValueError, match="truncated, or not an"):
        check_replay(broken)


def test_a_file_that_is_no_replay_is_refused(tmp_path):
    other = tmp_path / "other.rrd"
    other.write_text(json.dumps({"not": "a replay"}))
    with pytest.raises(ValueError, match="truncated, or not an"):
        check_replay(other)
    with pytest.raises(ValueError, match="there is no replay"):
        check_replay(tmp_path / "missing.rrd")


def test_a_recording_of_something_else_shows_no_robots(tmp_path):
    import rerun as rr

    path = tmp_path / "else.rrd"
    with rr.RecordingStream("other") as recording:
        recording.save(path)
        recording.log("thing", rr.TextLog("hello"))
    check_replay(path)
    with pytest.raises(ValueError, match="no replay of swarm_mj"):
        windows(path)


def test_a_copy_is_as_good(replay, tmp_path):
    copy = tmp_path / "copy.rrd"
    shutil.copy(replay, copy)
    check_replay(copy)
