"""Replays are whole or not there; their robots, packets and links are the flight's."""

import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import rerun.blueprint as rrb
from reading import colours, column, counts, entities, rows, static
from rerun.chunk import RrdReader

from swarm_mj.protocol.costs import TaskCost
from swarm_mj.replay import palette
from swarm_mj.replay.read import check_replay
from swarm_mj.replay.write import write_replay

CLOSE = {"rtol": 1e-5, "atol": 1e-2}  # of float32
FLIGHTS = {"": "two_way", "flood_": "flooded", "blocked_": "blocked"}  # by their replays' names
ROBOTS = np.arange(12)


def test_what_has_no_layer_is_there_and_rerun_s_own_verifier_accepts_the_file(replay):
    shown = {"/legend/ramp", "/ages", "/plots/age/ego", "/state", "/about"}
    assert entities(replay) >= shown
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(replay)]
    assert subprocess.run(command, capture_output=True, check=False).returncode == 0


def test_replays_of_one_kind_share_a_layout_and_others_have_their_own(
    replay, flood_replay, still_replay, blocked_replay, two_way, tmp_path
):
    """rerun gives all recordings of one application the layout of the last."""
    names = [kind_of(each) for each in (replay, flood_replay, still_replay, blocked_replay)]
    assert len(set(names)) == 4
    write_replay(two_way.log, {"seed": 6}, tmp_path / "b.rrd")
    assert kind_of(tmp_path / "b.rrd") == names[0]
    cost = TaskCost(name="distance, in metres", unit="m", value=two_way.log.age_mean)
    write_replay(replace(two_way.log, task_cost=cost), {"seed": 5}, tmp_path / "c.rrd")
    assert kind_of(tmp_path / "c.rrd") not in names


def test_a_rerun_without_one_of_our_views_makes_a_layout_of_its_own(two_way, tmp_path, monkeypatch):
    monkeypatch.delattr(rrb, "EyeControls3D")
    path = tmp_path / "r.rrd"
    with pytest.warns(UserWarning, match=r"EyeControls3D.*, so the replay has rerun's own"):
        write_replay(two_way.log, {"seed": 5}, path)
    assert RrdReader(path).blueprints() == []
    assert "/legend/ramp" in entities(path)
    assert check_replay(path) is None


def kind_of(path):
    """The name of the application; rerun warns of characters other than these."""
    (recording,) = RrdReader(path).recordings()
    assert re.fullmatch("[a-zA-Z0-9 _-]+", recording.application_id)
    return recording.application_id


def test_the_config_is_kept_as_properties(replay):
    for name, value in {"seed": 5, "policy": "mst", "ratio": 0.25}.items():
        assert static(replay, "/__properties/mission", name).tolist() == [value]


def test_the_sheet_says_what_the_team_sent(two_way, tmp_path):
    """Requests and answers of 100 bytes, in 30 windows of 0.1 s."""
    path = tmp_path / "r.rrd"
    write_replay(two_way.log, {"policy": "mst", "packet_bytes": 100}, path)
    kbit_per_second = 0.8 * two_way.counted("transmitted").sum() / 3.0
    (about,) = static(path, "/about", "TextDocument:text")
    assert f"- **sent by the team**: {kbit_per_second:.4g} kbit/s" in about


def test_a_replay_is_replaced_whole_or_stays(two_way, tmp_path, monkeypatch):
    path = tmp_path / "mission.rrd"
    path.write_text("old")

    def fail(*_):
        raise OSError("no space left")

    with monkeypatch.context() as broken:
        broken.setattr("swarm_mj.replay.write.draw_team", fail)
        with pytest.raises(OSError, match="no space left"):
            write_replay(two_way.log, {"seed": 1}, path)
    assert path.read_text() == "old"
    write_replay(two_way.log, {"seed": 1}, path)
    check_replay(path)
    assert [file.name for file in tmp_path.iterdir()] == ["mission.rrd"]


def test_a_replay_of_500_windows_of_40_robots_stays_below_5_mb(long, tmp_path):
    write_replay(long.log, {"seed": 5}, tmp_path / "a.rrd")
    assert 1e6 < (tmp_path / "a.rrd").stat().st_size < 5e6


def lines(path, entity):
    """Straight lines as [start, end] pairs, all windows in a row."""
    return rows(path, entity, "LineStrips2D:strips", 2, 2)


def is_known(log):
    return ~np.isnan(log.known_age)


def test_robots_wear_the_colour_of_their_age(replay, two_way):
    log, shown = two_way.log, colours(replay, "/arena/robots", "Points2D:colors", 12)
    others = np.arange(12) != log.ego
    assert np.all(shown[:, log.ego] == 255)
    assert np.all(shown[~is_known(log)] == palette.UNKNOWN)
    assert np.all(shown[is_known(log) & (log.ego_age == 0.0) & others] == (253, 231, 37))
    in_space = colours(replay, "/scene/robots", "Cylinders3D:colors", 12)
    np.testing.assert_array_equal(in_space, shown)


@pytest.mark.parametrize(("fate", "share"), [("delivered", 1.0), ("lost", 0.6)])
def test_arrows_are_the_packets_counted_and_lost_ones_stop_short(replay, two_way, fate, share):
    packets, entity = two_way.log.packets[fate], f"/arena/radio/{fate}"
    shown = counts(replay, entity, "Arrows2D:vectors")
    np.testing.assert_array_equal(shown, two_way.counted(fate))
    origins, vectors = (rows(replay, entity, f"Arrows2D:{of}", 2) for of in ("origins", "vectors"))
    np.testing.assert_allclose(origins, packets.start_m, **CLOSE)
    np.testing.assert_allclose(vectors, share * (packets.end_m - packets.start_m), **CLOSE)


def test_an_answer_stands_to_the_left_of_its_way(replay, two_way):
    _, start, end = two_way.log.packets["answered"]
    aside = rows(replay, "/arena/radio/answered", "Arrows2D:origins", 2) - start
    way = (end - start) / np.linalg.norm(end - start, axis=1, keepdims=True)
    left = way[:, 0] * aside[:, 1] - way[:, 1] * aside[:, 0]
    np.testing.assert_allclose(left, left[0], atol=1e-2)
    assert left[0] > 1.0


def test_broadcasts_lead_to_hearers(flood_replay, flooded):
    ends = np.stack(flooded.log.packets["heard"][1:], axis=1)
    np.testing.assert_allclose(lines(flood_replay, "/arena/radio/heard"), ends, **CLOSE)


@pytest.mark.parametrize(
    ("flight", "entity", "component", "which"),
    [
        ("", "/arena/robots", "Points2D:positions", lambda log: log.is_on),
        ("", "/scene/robots", "Cylinders3D:centers", lambda log: log.is_on),
        ("", "/arena/belief/ring", "Ellipses2D:centers", lambda log: is_known(log) & (ROBOTS != 4)),
        ("", "/arena/radio/range", "Ellipses2D:centers", lambda log: log.recipient[:, 0] != ROBOTS),
        (
            "flood_",
            "/arena/radio/transmitter",
            "Points2D:positions",
            lambda log: np.any(log.recipient != ROBOTS, axis=1),
        ),
        ("blocked_", "/arena/world/cut_off", "Points2D:positions", lambda log: log.is_cut_off),
        ("blocked_", "/scene/world/cut_off", "Cylinders3D:centers", lambda log: log.is_cut_off),
    ],
)
def test_marks_are_where_the_robots_are_that_they_concern(
    flight, entity, component, which, request
):
    """Rings of beliefs are where the ego robot, r4, believes the others."""
    path, its = request.getfixturevalue(f"{flight}replay"), FLIGHTS[flight]
    log = request.getfixturevalue(its).log
    is_shown, where = which(log), log.believed_m if "belief" in entity else log.position_m
    assert np.any(is_shown)
    num_axes = 3 if "scene" in entity else 2
    per_window = counts(path, entity, component)
    np.testing.assert_array_equal(per_window, np.sum(is_shown, axis=1))
    found = rows(path, entity, component, num_axes)[:, :2]
    np.testing.assert_allclose(found, where[is_shown], **CLOSE)


def test_sizes_are_the_range_on_the_map_and_in_space_the_observer_s_is_the_largest(replay):
    assert set(rows(replay, "/arena/radio/range", "Ellipses2D:half_sizes")) == {250.0}
    assert np.all(rows(replay, "/scene/robots", "Cylinders3D:centers", 3)[:, 2] > 0.0)
    radii = static(replay, "/scene/robots", "Cylinders3D:radii")
    assert (len(radii), np.argmax(radii)) == (12, 4)


def test_headings_have_one_length_and_the_direction_of_flight(replay, two_way):
    strips = lines(replay, "/arena/heading")
    way = strips[:, 1] - strips[:, 0]
    length = np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(length, length[0], rtol=1e-2)
    velocity = two_way.log.velocity_mps.reshape(-1, 2)
    along = np.sum(way * velocity, axis=1) / length / np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(along, 1.0, atol=1e-3)


def test_trails_end_at_the_robots_and_start_at_most_150_windows_ago(replay, two_way):
    trails = rows(replay, "/arena/trail", "LineStrips2D:strips", 12, 11, 2)
    where = two_way.log.position_m
    np.testing.assert_allclose(trails[:, :, 0], where[::5], **CLOSE)
    np.testing.assert_allclose(trails[-1, :, 1], where[25 - 15], **CLOSE)
    np.testing.assert_allclose(trails[-1, :, -1], where[0], **CLOSE)


def test_the_tree_on_the_map_joins_parents_and_children(replay, two_way):
    log = two_way.log
    row, child = np.nonzero(is_known(log) & (np.arange(12) != log.ego))
    ends = [log.position_m[row, robot] for robot in (log.parent[row, child], child)]
    np.testing.assert_allclose(lines(replay, "/arena/tree"), np.stack(ends, axis=1), **CLOSE)


@pytest.mark.parametrize(("kind", "dashes"), [("too_weak", 4), ("unbelieved", 1)])
@pytest.mark.parametrize(("view", "axes"), [("arena", 2), ("scene", 3)])
@pytest.mark.parametrize("whose", ["", "others/"])
def test_lines_are_the_mismatched_links(blocked, blocked_replay, kind, dashes, view, axes, whose):
    """Those of the ego robot, r4, are apart from the others'."""
    (window, links), pieces = blocked.log.mismatch, dashes if view == "arena" else 1
    is_own = (links["sender"] == 4) | (links["receiver"] == 4)
    links = links[(links["is_too_weak"] == (kind == "too_weak")) & (is_own == (whose == ""))]
    start_m = blocked.log.position_m[window[links["row"]] - 1, links["sender"]]
    entity, component = f"/{view}/world/{whose}{kind}", f"LineStrips{axes}D:strips"
    expected = pieces * np.bincount(links["row"], minlength=len(window))
    np.testing.assert_array_equal(counts(blocked_replay, entity, component), expected)
    shown = rows(blocked_replay, entity, component, 2, axes)[::pieces]
    np.testing.assert_allclose(shown[:, 0, :2], start_m, atol=1e-3)
    margins = column(blocked_replay, entity, "margin_db").flatten().to_numpy()
    np.testing.assert_array_equal(margins[::pieces], links["margin_db"])


def test_what_a_mission_lacks_is_not_drawn(replay, still_replay, flood_replay):
    """Free space has no mismatch, a team at rest no motion, and a broadcast no verdict."""
    assert not any("/world/" in entity for entity in entities(replay))
    found = entities(still_replay)
    moving = {"/arena/heading", "/scene/heading", "/arena/trail", "/arena/belief/ring"}
    assert not found & moving
    assert not any(path.startswith("/plots/task") for path in found)
    assert {"/arena/tree", "/arena/radio/delivered", "/scene/robots"} <= found
    radio = {path for path in entities(flood_replay) if "/radio/" in path and "legend" not in path}
    shown = {"/arena/radio/heard", "/arena/radio/range", "/arena/radio/transmitter"}
    assert radio == shown | {"/plots/radio/heard", "/plots/radio/sent"}


def test_a_map_that_follows_the_team_keeps_it_in_view(two_way, tmp_path):
    """North stays up: what is shown of p is p - c with y turned round."""
    drift = np.linspace(0.0, 9e3, 30)[:, None, None] * np.array([1.0, 0.5])
    facts = two_way.log.facts
    facts = replace(facts, mission=replace(facts.mission, boundary="none"))
    log = replace(two_way.log, facts=facts, position_m=two_way.log.position_m + drift)
    far = tmp_path / "far.rrd"
    write_replay(log, {"seed": 5}, far)
    north_up = [[1, 0, 0, 0, -1, 0, 0, 0, 1]] * 30
    np.testing.assert_array_equal(rows(far, "/arena", "Transform3D:mat3x3", 9), north_up)
    shift = rows(far, "/arena", "Transform3D:translation", 3)[:, None, :2]
    shown = log.position_m * (1.0, -1.0) + shift
    farthest_m = np.abs(shown).max(axis=(1, 2))
    assert np.all(farthest_m[1:] == pytest.approx(1.2 * facts.mission.half_side_m, rel=1e-4))
    assert farthest_m[0] < facts.mission.half_side_m
