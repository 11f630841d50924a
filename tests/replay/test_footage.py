"""Videos show the same from a log and from its replay; live pictures; the map's frame, by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.mission.components import Components
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay import palette
from swarm_mj.replay.footage import contents_of, footage_of, frame
from swarm_mj.replay.mismatch import radio_snapshot
from swarm_mj.replay.read import read_footage
from swarm_mj.replay.write import write_replay
from swarm_mj.simulation.swarm import Swarm

RECORDED = ["two_way", "flooded", "still", "failing", "blocked"]


@pytest.mark.parametrize("name", RECORDED)
def test_a_replay_holds_what_a_video_shows(name, request, tmp_path):
    recorded = request.getfixturevalue(name)
    log, mission, parts = recorded.log, recorded.mission, {"channel": "my:Radio"}
    config = {"seed": 5, "policy": "mst", "scene": None, **parts}
    write_replay(log, mission, config, tmp_path / "a.rrd")
    read = read_footage(tmp_path / "a.rrd")
    made = footage_of(log, mission, "mst", 5, Components(**parts))
    assert read.facts == made.facts
    assert read.facts.own_parts == ["channel my:Radio"]
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


@pytest.mark.parametrize(("farthest_m", "moves"), [(50.0, False), (150.0, False), (150.1, True)])
def test_a_team_within_one_and_a_half_times_the_area_is_shown_with_it(two_way, farthest_m, moves):
    """An area of half side 100 m; one robot stands as far out, in one window."""
    position_m = np.zeros_like(two_way.log.position_m)
    position_m[3, 5, 1] = -farthest_m
    shown = frame(position_m, 100.0)
    assert shown.moves == moves
    assert moves or shown.reach_m == max(100.0, farthest_m)


def test_a_team_that_flies_off_is_followed(two_way):
    drift = np.linspace(0.0, 1.0, 30)[:, None, None] * np.array([9000.0, -500.0])
    position_m = two_way.log.position_m + drift
    shown = frame(position_m, two_way.mission.half_side_m)
    assert shown.moves
    assert np.max(np.abs(position_m - shown.centre_m[:, None])) <= shown.reach_m + 1e-6
    assert shown.reach_m == pytest.approx(np.ptp(position_m, axis=1).max() / 2)


@pytest.fixture
def swarm():
    return Swarm(paper("flocking", num_robots=8, num_windows=20, failure_fraction=0.25), [3, 4])


def test_before_the_first_window_everyone_is_grey_but_the_white_observer(swarm):
    contents = contents_of(swarm, 1, observer=2)
    np.testing.assert_array_equal(contents.position_m, swarm.states.position_m[1])
    np.testing.assert_array_equal(contents.velocity_mps, swarm.states.velocity_mps[1])
    expected = np.tile(np.array(palette.UNKNOWN), (8, 1))
    expected[2] = palette.EGO
    np.testing.assert_array_equal(contents.colour, expected)
    assert len(contents.start_m) == 0


def test_packets_are_those_of_the_last_window(swarm):
    """Robot 0 asks 1, which answers, if they decode each other; whoever else hears overhears."""
    recipient = np.tile(np.arange(8), (2, 1))
    recipient[:, 0] = 1
    swarm.step_with_recipients(recipient)
    contents = contents_of(swarm, 0)
    request, response = swarm.phases
    where = swarm.states.position_m[0]
    expected = []
    for phase in (request, response):
        for j in range(8):
            i = phase.heard[0, j]
            if i != j:
                expected.append((*where[i], *where[j]))
    colours = {tuple(colour) for colour in contents.packet_colour.tolist()}
    if request.heard[0, 1] == 0:
        assert palette.DELIVERED in colours
        assert palette.LOST not in colours
        drawn = np.hstack([contents.start_m, contents.end_m]).tolist()
        np.testing.assert_allclose(sorted(map(tuple, drawn)), sorted(expected))
    else:
        assert palette.LOST in colours


def test_a_broadcast_leads_to_all_who_hear_it(swarm):
    policy = make_policy("random-flooding", swarm.mission, 0.3)
    for _ in range(4):
        swarm.step(policy)
    contents = contents_of(swarm, 1)
    num_heard = sum(int(np.sum(phase.heard[1] != np.arange(8))) for phase in swarm.phases)
    assert len(contents.start_m) == num_heard
    assert {tuple(colour) for colour in contents.packet_colour.tolist()} <= {palette.BROADCAST}


def test_links_that_surprise_are_seen_and_who_is_cut_off():
    mission = paper("random-walk", num_robots=10, arena="blocks", shadowing_db=6.0)
    city = Swarm(mission, [3, 4])
    for _ in range(60):
        city.move()
    seen, contents = radio_snapshot(city, 1), contents_of(city, 1, observer=2)
    kinds = seen.mismatch.by_kind
    ends = kinds["too_weak"].sender.tolist() + kinds["too_weak"].receiver.tolist()
    assert ends.count(2) > 0
    assert len(contents.lines_m) == 4 * ends.count(2) + len(kinds["unbelieved"].row)
    np.testing.assert_array_equal(contents.is_cut_off, seen.group != seen.group[2])


def test_bright_is_fresh_and_robots_that_failed_are_dark(swarm):
    policy = make_policy("tdma", swarm.mission)
    for _ in range(9):
        swarm.step(policy)
    brightness = contents_of(swarm, full_scale=9.0).colour.astype(float).sum(axis=1)[1:]
    age = (swarm.now[0] - swarm.buffers.timestamp[0, 0])[1:]
    is_known = swarm.buffers.is_known[0, 0, 1:]
    assert np.sum(is_known) > 3
    order = np.argsort(age[is_known])
    assert np.all(np.diff(brightness[is_known][order]) <= 0.0)
    for _ in range(3):
        swarm.step(policy)
    is_off = ~swarm.states.is_active[0]
    assert np.sum(is_off) == 2
    is_dark = np.all(contents_of(swarm).colour == palette.SWITCHED_OFF, axis=1)
    np.testing.assert_array_equal(is_dark, is_off)


def test_what_is_not_there_is_refused(swarm):
    with pytest.raises(ValueError, match="observer must be from 0 to 7, not 8"):
        contents_of(swarm, observer=8)
    with pytest.raises(ValueError, match="index must be from 0 to 1, not 2"):
        contents_of(swarm, 2)
