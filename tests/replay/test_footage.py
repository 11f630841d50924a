"""Videos show the same from a log and from its replay; live pictures; the map's frame, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.mission.components import Components
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay import palette
from swarm_mj.replay.footage import footage_now, footage_of, frame
from swarm_mj.replay.links import LINK, LinkMismatch, radio_snapshot
from swarm_mj.replay.read import read_footage
from swarm_mj.replay.write import write_replay
from swarm_mj.simulation.swarm import Swarm

CLOSE = {"rtol": 1e-5, "atol": 1e-2}  # of float32


def direction(velocity_mps):
    return velocity_mps / np.maximum(np.linalg.norm(velocity_mps, axis=2, keepdims=True), 1e-9)


@pytest.mark.parametrize("name", ["two_way", "flooded", "still", "failing", "blocked"])
def test_a_replay_holds_what_a_video_shows(name, request, tmp_path):
    recorded = request.getfixturevalue(name)
    log, mission, parts = recorded.log, recorded.mission, {"channel": "my:Radio"}
    config = {"seed": 5, "policy": "mst", "scene": None, **parts}
    write_replay(log, mission, config, tmp_path / "a.rrd")
    read = read_footage(tmp_path / "a.rrd")
    made = footage_of(log, mission, "mst", 5, Components(**parts))
    assert read.facts == made.facts
    assert read.facts.own_parts == ["channel my:Radio"]
    for field in ("window", "age", "is_on", "is_cut_off"):
        np.testing.assert_array_equal(getattr(read, field), getattr(made, field))
    np.testing.assert_allclose(read.position_m, made.position_m, rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(read.age_mean, made.age_mean)
    np.testing.assert_allclose(direction(read.velocity_mps), direction(made.velocity_mps), **CLOSE)
    assert list(read.segments) == list(made.segments)
    for fate, (row, *ends) in made.segments.items():
        np.testing.assert_array_equal(read.segments[fate].row, row)
        np.testing.assert_allclose(read.segments[fate][1:], ends, **CLOSE)
    # A snapshot's links are kept by their kind.
    in_order = [np.sort(each.mismatch.links, order=LINK.names) for each in (read, made)]
    np.testing.assert_array_equal(*in_order)
    np.testing.assert_array_equal(read.mismatch.window, made.mismatch.window)
    assert (len(in_order[0]) > 0) == (name == "blocked")


def test_shortfalls_are_those_of_robots_that_the_observer_misses(blocked):
    log, num_said = blocked.log, 0
    footage = footage_of(log, blocked.mission, "random-flooding", 5)
    for row, window in enumerate(log.window.tolist()):
        others, margin_db = footage.shortfalls(row)
        missed = [
            (j if i == log.ego else i, margin)
            for _, i, j, _, margin, weak in log.mismatch.at(window).tolist()
            if weak and log.ego in (i, j)
        ]
        assert list(zip(others, margin_db, strict=True)) == missed
        num_said += len(missed)
    assert num_said > 0


def test_at_once_only_the_observer_s_links_are_too_weak(two_way):
    """Robots 0 and 1 miss each other, 0 and 2 decode all the same, which takes one line more."""
    links = np.array([(0, 0, 1, 90, -1, True), (0, 0, 2, 80, 3, False)], LINK)
    made = footage_of(two_way.log, two_way.mission, "mst", 5)
    made = replace(made, mismatch=LinkMismatch(np.array([1]), links))
    for observer, num_lines in ((0, 5), (1, 5), (2, 1)):
        seen = replace(made, facts=replace(made.facts, observer=observer))
        lines, colours = seen.mismatch_lines(7)
        assert len(lines) == len(colours) == num_lines
    np.testing.assert_allclose(lines[0], made.position_m[7, [0, 2]])
    assert colours.tolist() == [list(palette.UNBELIEVED)]


def test_an_open_area_is_shown_where_robots_ever_are(two_way):
    footage = footage_of(two_way.log, replace(two_way.mission, boundary="none"), "mst", 5)
    seen, where = footage.ground, two_way.log.position_m
    assert not np.any(np.diff(seen.centre_m, axis=0))
    offset = np.abs(where - seen.centre_m[:, None])
    assert offset.max() == pytest.approx(seen.reach_m)
    walled = footage_of(two_way.log, two_way.mission, "mst", 5).ground
    assert walled.reach_m == two_way.mission.half_side_m


@pytest.mark.parametrize(("farthest_m", "moves"), [(50.0, False), (150.0, False), (150.1, True)])
def test_a_team_that_flies_off_is_followed(farthest_m, moves):
    """An area of half side 100 m; one robot of two stands as far out, in one window of three."""
    position_m = np.zeros((3, 2, 2))
    position_m[1, 1, 1] = -farthest_m
    shown = frame(position_m, 100.0)
    assert shown.moves == moves
    assert shown.reach_m == pytest.approx(farthest_m / 2 if moves else max(100.0, farthest_m))
    assert shown.centre_m[1, 1] == pytest.approx(-farthest_m / 2 if moves else 0.0)


@pytest.fixture
def swarm():
    return Swarm(paper("flocking", num_robots=8, num_windows=20, failure_fraction=0.25), [3, 4])


def test_before_the_first_window_everyone_is_grey_but_the_white_observer(swarm):
    seen = footage_now(swarm, 1, observer=2)
    np.testing.assert_array_equal(seen.position_m[0], swarm.states.position_m[1])
    np.testing.assert_array_equal(seen.velocity_mps[0], swarm.states.velocity_mps[1])
    expected = np.tile(np.array(palette.UNKNOWN), (8, 1))
    expected[2] = palette.EGO
    np.testing.assert_array_equal(seen.colours(0), expected)
    assert not any(len(start_m) for start_m, _, _ in seen.packets(0))


def test_a_live_picture_has_the_packets_of_the_last_window_of_its_mission(swarm):
    policy = make_policy("random-flooding", swarm.mission, 0.3)
    for _ in range(4):
        swarm.step(policy)
    ((start_m, end_m, colour),) = footage_now(swarm, 1).packets(0)
    where = swarm.states.position_m[1]
    expected = [
        (*where[phase.heard[1, j]], *where[j])
        for phase in swarm.phases
        for j in range(8)
        if phase.heard[1, j] != j
    ]
    assert len(expected) > 0
    np.testing.assert_allclose(np.hstack([start_m, end_m]), expected)
    assert colour == palette.BROADCAST


def test_a_live_picture_shows_links_that_surprise_and_who_is_cut_off():
    mission = paper("random-walk", num_robots=10, arena="blocks", shadowing_db=6.0)
    city = Swarm(mission, [3, 4])
    for _ in range(60):
        city.move()
    seen, shown = radio_snapshot(city, 1), footage_now(city, 1, observer=2)
    weak = seen.links[seen.links["is_too_weak"]]
    num_own = np.sum((weak["sender"] == 2) | (weak["receiver"] == 2))
    assert num_own > 0
    assert len(shown.mismatch_lines(0)[0]) == 4 * num_own + len(seen.links) - len(weak)
    np.testing.assert_array_equal(shown.is_cut_off[0], seen.group != seen.group[2])


def test_bright_is_fresh_and_robots_that_failed_are_dark(swarm):
    policy = make_policy("tdma", swarm.mission)
    for _ in range(9):
        swarm.step(policy)
    brightness = footage_now(swarm, full_scale=9.0).colours(0).astype(float).sum(axis=1)[1:]
    age = (swarm.now[0] - swarm.buffers.timestamp[0, 0])[1:]
    is_known = swarm.buffers.is_known[0, 0, 1:]
    assert np.sum(is_known) > 3
    assert np.all(np.diff(brightness[is_known][np.argsort(age[is_known])]) <= 0.0)
    for _ in range(3):
        swarm.step(policy)
    is_off = ~swarm.states.is_active[0]
    assert np.sum(is_off) == 2
    is_dark = np.all(footage_now(swarm).colours(0) == palette.SWITCHED_OFF, axis=1)
    np.testing.assert_array_equal(is_dark, is_off)


def test_what_is_not_there_is_refused(swarm):
    with pytest.raises(ValueError, match="observer must be from 0 to 7, not 8"):
        footage_now(swarm, observer=8)
    with pytest.raises(ValueError, match="index must be from 0 to 1, not 2"):
        footage_now(swarm, 2)
