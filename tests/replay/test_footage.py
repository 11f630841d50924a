"""What a video shows is the same from a log and from its replay; the map's frame, by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swarm_mj.mission.components import Components
from swarm_mj.replay import palette
from swarm_mj.replay.footage import footage_of, frame
from swarm_mj.replay.read import read_footage
from swarm_mj.replay.write import write_replay

RECORDED = ["two_way", "flooded", "still", "failing", "blocked"]


@pytest.mark.parametrize("name", RECORDED)
def test_a_replay_holds_what_a_video_shows(name, request, tmp_path):
    recorded = request.getfixturevalue(name)
    log, mission = recorded.log, recorded.mission
    write_replay(log, mission, {"seed": 5, "policy": "mst"}, tmp_path / "a.rrd")
    read, made = read_footage(tmp_path / "a.rrd"), footage_of(log, mission, "mst", 5)
    assert read.facts == made.facts
    np.testing.assert_array_equal(read.window, made.window)
    np.testing.assert_allclose(read.position_m, made.position_m, rtol=1e-6, atol=1e-4)
    np.testing.assert_array_equal(read.age, made.age)
    np.testing.assert_array_equal(read.is_on, log.is_on)
    np.testing.assert_array_equal(read.is_cut_off, log.is_cut_off)
    assert (read.mismatch is None) == (made.mismatch is None)
    np.testing.assert_allclose(read.age_mean, made.age_mean)
    speed = np.maximum(np.linalg.norm(made.velocity_mps, axis=2, keepdims=True), 1e-9)
    length = np.maximum(np.linalg.norm(read.velocity_mps, axis=2, keepdims=True), 1e-9)
    headings = read.velocity_mps / length, made.velocity_mps / speed
    np.testing.assert_allclose(*headings, atol=1e-3)
    assert list(read.segments) == list(made.segments)
    for fate, expected in made.segments.items():
        np.testing.assert_array_equal(read.segments[fate].row, expected.row)
        for end in ("start_m", "end_m"):
            ends = (getattr(each, end) for each in (read.segments[fate], expected))
            np.testing.assert_allclose(*ends, rtol=1e-5, atol=1e-2)


def test_a_replay_holds_the_links_that_surprise(blocked, blocked_replay):
    read, made = read_footage(blocked_replay).mismatch, blocked.log.mismatch
    np.testing.assert_array_equal(read.window, made.window)
    for window in made.window.tolist():
        for kind, expected in made.at(window).by_kind.items():
            found = read.at(window).by_kind[kind]
            for name in ("sender", "receiver", "loss_db", "margin_db"):
                np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    assert all(len(of.row) > 0 for of in made.by_kind.values())


def test_shortfalls_are_those_of_robots_that_the_observer_misses(blocked):
    log = blocked.log
    footage = footage_of(log, blocked.mission, "random-flooding", 5)
    num_said = 0
    for row, window in enumerate(log.window.tolist()):
        others, margin_db = footage.shortfalls(row)
        found = log.mismatch.at(window)
        missed = [
            (j if i == log.ego else i, margin)
            for i, j, margin, weak in zip(
                found.sender, found.receiver, found.margin_db, found.is_too_weak, strict=True
            )
            if weak and log.ego in (i, j)
        ]
        assert list(zip(others, margin_db, strict=True)) == missed
        num_said += len(missed)
    assert num_said > 0


def test_colours_are_by_age_white_for_the_observer_and_dark_for_the_fallen(failing):
    log = failing.log
    footage = footage_of(log, failing.mission, "mst", 5)
    shown = np.stack([footage.contents(row).colour for row in range(30)])
    np.testing.assert_array_equal(np.all(shown == palette.SWITCHED_OFF, axis=2), ~log.is_on)
    np.testing.assert_array_equal(shown[:, log.ego][log.is_on[:, log.ego]], 255)


def test_a_moment_has_the_packets_of_its_window(two_way):
    footage = footage_of(two_way.log, two_way.mission, "mst", 5)
    for row in (0, 7, 29):
        colours = [tuple(colour) for colour in footage.contents(row).packet_colour.tolist()]
        for fate in ("delivered", "lost", "answered"):
            assert colours.count(palette.PACKETS[fate][0]) == two_way.counted(fate)[row]


def test_an_open_area_is_shown_where_robots_ever_are(two_way):
    footage = footage_of(two_way.log, replace(two_way.mission, boundary="none"), "mst", 5)
    seen, where = footage.frame, two_way.log.position_m
    assert not np.any(np.diff(seen.centre_m, axis=0))
    offset = np.abs(where - seen.centre_m[:, None])
    assert offset.max() == pytest.approx(seen.reach_m)
    walled = footage_of(two_way.log, two_way.mission, "mst", 5).frame
    assert walled.reach_m == two_way.mission.half_side_m


def test_a_replay_without_facts_is_refused_in_one_line(two_way, tmp_path, monkeypatch):
    monkeypatch.setattr("swarm_mj.replay.write.FACTS", "other")
    write_replay(two_way.log, two_way.mission, {"seed": 5}, tmp_path / "old.rrd")
    with pytest.raises(ValueError, match=r"old\.rrd does not hold .*; record it again"):
        read_footage(Path(tmp_path / "old.rrd"))


def test_a_replay_keeps_the_names_of_ones_own_parts(two_way, tmp_path):
    config = {"seed": 5, "policy": "mst", "channel": "my:Radio", "scene": None}
    write_replay(two_way.log, two_way.mission, config, tmp_path / "a.rrd")
    parts = Components(channel="my:Radio")
    read, made = (
        read_footage(tmp_path / "a.rrd"),
        footage_of(two_way.log, two_way.mission, "mst", 5, parts),
    )
    assert read.facts == made.facts
    assert read.facts.own_parts == ["channel my:Radio"]


def test_a_file_of_another_kind_is_called_so(tmp_path):
    (tmp_path / "fading.py").write_text("text")
    with pytest.raises(ValueError, match=r"fading.py is no .rrd file; `swarm-mj fly` records them"):
        read_footage(tmp_path / "fading.py")


def moved(log, *, by_m):
    """The log with a team that drifts, so much in all."""
    drift = np.linspace(0.0, 1.0, len(log.window))[:, None, None] * np.array(by_m)
    return replace(log, position_m=log.position_m + drift)


@pytest.mark.parametrize("by_m", [0.0, 100.0])
def test_a_team_that_leaves_the_area_a_little_or_not_is_shown_with_it(two_way, by_m):
    """Its mission's boundary reflects."""
    log, half_side_m = moved(two_way.log, by_m=(0.0, by_m)), two_way.mission.half_side_m
    shown = frame(log.position_m, half_side_m)
    assert shown.reach_m == max(half_side_m, np.max(np.abs(log.position_m)))
    assert (shown.reach_m > half_side_m) == (by_m > 0.0)
    assert not shown.moves


@pytest.mark.parametrize(("farthest_m", "moves"), [(150.0, False), (150.1, True)])
def test_a_team_within_one_and_a_half_times_the_area_is_shown_with_it(two_way, farthest_m, moves):
    """An area of half side 100 m; one robot stands as far out, in one window."""
    position_m = np.zeros_like(two_way.log.position_m)
    position_m[3, 5, 1] = -farthest_m
    shown = frame(position_m, 100.0)
    assert shown.moves == moves


def test_a_team_that_flies_off_is_followed(two_way):
    log = moved(two_way.log, by_m=(9000.0, -500.0))
    shown = frame(log.position_m, two_way.mission.half_side_m)
    assert shown.moves
    for here, centre in zip(log.position_m, shown.centre_m, strict=True):
        assert np.max(np.abs(here - centre)) <= shown.reach_m + 1e-6
    assert shown.reach_m == pytest.approx(
        max(np.ptp(here, axis=0).max() for here in log.position_m) / 2
    )
