"""Videos show the same from a log and from its replay; the map's frame, by hand."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.replay import palette
from swarm_mj.replay.footage import followed, frame
from swarm_mj.replay.links import LINK, LinkMismatch
from swarm_mj.replay.read import read_footage
from swarm_mj.replay.write import write_replay

CLOSE = {"rtol": 1e-5, "atol": 1e-2}  # of float32


def direction(velocity_mps):
    return velocity_mps / np.maximum(np.linalg.norm(velocity_mps, axis=2, keepdims=True), 1e-9)


@pytest.mark.parametrize("name", ["two_way", "flooded", "still", "failing", "blocked"])
def test_a_replay_holds_what_a_video_shows(name, request, tmp_path):
    log, path = request.getfixturevalue(name).log, tmp_path / "a.rrd"
    log = replace(log, facts=replace(log.facts, channel="my:Radio"))
    write_replay(log, {"seed": 5}, path)
    read = read_footage(path)
    assert read.facts == log.facts
    assert read.facts.own_parts == ["channel my:Radio"]
    for field in ("window", "known_age", "is_on", "is_cut_off"):
        np.testing.assert_array_equal(getattr(read, field), getattr(log, field))
    np.testing.assert_allclose(read.position_m, log.position_m, rtol=1e-6, atol=1e-4)
    np.testing.assert_allclose(read.age_mean, log.age_mean)
    np.testing.assert_allclose(direction(read.velocity_mps), direction(log.velocity_mps), **CLOSE)
    assert list(read.packets) == list(log.packets)
    for fate, (row, *ends) in log.packets.items():
        np.testing.assert_array_equal(read.packets[fate].row, row)
        np.testing.assert_allclose(read.packets[fate][1:], ends, **CLOSE)
    # A snapshot's links are kept by their kind.
    in_order = [np.sort(each.mismatch.links, order=LINK.names) for each in (read, log)]
    np.testing.assert_array_equal(*in_order)
    np.testing.assert_array_equal(read.mismatch.window, log.mismatch.window)
    assert (len(in_order[0]) > 0) == (name == "blocked")


def test_shortfalls_are_those_of_robots_that_the_ego_robot_misses(blocked):
    log, num_found = blocked.log, 0
    for row, window in enumerate(log.window.tolist()):
        others, margin_db = log.shortfalls(row)
        missed = [
            (j if i == log.ego else i, margin)
            for _, i, j, _, margin, weak in log.mismatch.at(window).tolist()
            if weak and log.ego in (i, j)
        ]
        assert list(zip(others, margin_db, strict=True)) == missed
        num_found += len(missed)
    assert num_found > 0


def test_at_once_only_the_observer_s_links_are_shown(two_way):
    """Robots 0 and 1 miss each other, 0 and 2 decode all the same, which takes one line more."""
    links = np.array([(0, 0, 1, 90, -1, True), (0, 0, 2, 80, 3, False)], LINK)
    made = replace(two_way.log, mismatch=LinkMismatch(np.array([1]), links))
    for observer, num_lines in ((0, 5), (1, 4), (2, 1), (3, 0)):
        seen = replace(made, facts=replace(made.facts, observer=observer))
        lines, colours = seen.mismatch_lines(7)
        assert len(lines) == len(colours) == num_lines
        if observer == 2:
            np.testing.assert_allclose(lines[0, :, :2], made.position_m[7, [0, 2]])
            assert colours.tolist() == [list(palette.UNBELIEVED)]


def test_the_share_that_is_cut_off_is_of_robots_that_are_on(two_way):
    is_on = np.ones_like(two_way.log.is_on)
    is_cut_off = np.zeros_like(is_on)
    is_on[1, 10:], is_cut_off[:2, 3:5] = False, True
    made = replace(two_way.log, is_on=is_on, is_cut_off=is_cut_off)
    assert is_on.shape[1] == 12
    assert made.cut_off_share[:3].tolist() == [2.0 / 11.0, 2.0 / 9.0, 0.0]


def test_an_open_area_is_shown_where_robots_ever_are(two_way):
    where, half_side_m = two_way.log.position_m, two_way.log.facts.mission.half_side_m
    seen = frame(where, half_side_m, is_tight=True)
    assert not np.any(np.diff(seen.centre_m, axis=0))
    offset = np.abs(where - seen.centre_m[:, None])
    assert offset.max() == pytest.approx(seen.reach_m)
    assert two_way.log.ground.reach_m == half_side_m


@pytest.mark.parametrize(("farthest_m", "moves"), [(50.0, False), (150.0, False), (150.1, True)])
def test_a_team_that_flies_off_is_followed(farthest_m, moves):
    """An area of half side 100 m; one robot of two stands as far out, in one window of three."""
    position_m = np.zeros((3, 2, 2))
    position_m[1, 1, 1] = -farthest_m
    shown = frame(position_m, 100.0)
    assert shown.moves == moves
    assert shown.reach_m == pytest.approx(farthest_m / 2 if moves else max(100.0, farthest_m))
    assert shown.centre_m[1, 1] == pytest.approx(-farthest_m / 2 if moves else 0.0)


@pytest.mark.parametrize(
    ("low_m", "high_m", "centre_m"),
    [(-50.0, 119.0, 0.0), (-50.0, 130.0, 10.0), (-130.0, 50.0, -10.0), (100.0, 500.0, 300.0)],
)
def test_an_open_map_moves_no_more_than_keeps_the_team_in_view(low_m, high_m, centre_m):
    """An area of half side 100 m and a view of 120 m; a team wider than it is in the middle."""
    mission = paper("flocking", num_robots=4, density_per_km2=100.0)
    assert mission.half_side_m == pytest.approx(100.0)
    position_m = np.zeros((2, 4, 2))
    position_m[1, 0, 0] = low_m
    position_m[1, 1:, 0] = high_m
    shown = followed(position_m, mission)
    np.testing.assert_allclose(shown.centre_m, [[0.0, 0.0], [centre_m, 0.0]], atol=1e-9)
    farthest_m = max(abs(low_m - centre_m), abs(high_m - centre_m), 100.0)
    assert shown.reach_m == pytest.approx(farthest_m)
    walled = followed(position_m, replace(mission, boundary="reflect"))
    assert not walled.moves


def test_between_two_windows_robots_are_between_their_places(two_way):
    """A quarter of the way from window 7 to window 8; of all other windows nothing changes."""
    log = two_way.log
    moved = log.moved_to(7.25)
    between_m = 0.75 * log.position_m[7] + 0.25 * log.position_m[8]
    np.testing.assert_allclose(moved.position_m[7], between_m)
    np.testing.assert_array_equal(
        np.delete(moved.position_m, 7, 0), np.delete(log.position_m, 7, 0)
    )
    assert log.moved_to(7.0) is log
    later = log.moved_to(7.75)  # nearer to window 8, whose packets it has
    np.testing.assert_allclose(
        later.position_m[8], 0.25 * log.position_m[7] + 0.75 * log.position_m[8]
    )


def test_bodies_turn_on_the_shorter_way_and_climb_between_windows(high):
    """From no turn to one of 0.2 rad about the vertical, whose quaternion has the other sign."""
    log = high.log
    height_m, attitude = log.height_m.copy(), log.attitude.copy()
    height_m[7], height_m[8] = 10.0, 11.0
    attitude[7] = (1.0, 0.0, 0.0, 0.0)
    attitude[8] = (-np.cos(0.1), 0.0, 0.0, -np.sin(0.1))
    moved = replace(log, height_m=height_m, attitude=attitude).moved_to(7.5)
    middle = (8, slice(None))
    np.testing.assert_allclose(moved.height_m[middle], 10.5)
    half = np.tile([np.cos(0.05), 0.0, 0.0, np.sin(0.05)], (12, 1))
    np.testing.assert_allclose(moved.attitude[middle], half, atol=1e-12)


def test_points_have_their_middle_1_m_above_the_floor_and_bodies_at_their_height(two_way, high):
    place_m = two_way.log.place_m(3)
    np.testing.assert_array_equal(place_m[:, :2], two_way.log.position_m[3])
    assert np.all(place_m[:, 2] == 1.0)
    np.testing.assert_array_equal(high.log.place_m(3)[:, 2], high.log.height_m[3])
