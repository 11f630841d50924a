"""The replay's map, read back from the file, against the flight it shows."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from reading import colours, column, counts, entities, rows, rows_of_strips, static

from swarm_mj.physics.arenas import BLOCK_M
from swarm_mj.physics.solid_geoms import obstacles_of
from swarm_mj.replay import palette
from swarm_mj.replay.arena import filling, footprints, square_m
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.write import write_replay

NORTH_UP = [1, 0, 0, 0, -1, 0, 0, 0, 1]


def test_positions_are_the_simulation_s_and_north_is_up(replay, two_way):
    shown = rows(replay, "/arena/robots", "Points2D:positions", 12, 2)
    np.testing.assert_allclose(shown, two_way.log.position_m, rtol=1e-6, atol=1e-4)
    np.testing.assert_array_equal(static(replay, "/arena", "Transform3D:mat3x3"), NORTH_UP)


@pytest.mark.parametrize(("fate", "share"), [("delivered", 1.0), ("lost", 0.6)])
def test_arrows_are_the_packets_counted_and_lost_ones_stop_short(replay, two_way, fate, share):
    log, links, entity = two_way.log, two_way.log.packets[fate], f"/arena/radio/{fate}"
    shown = counts(replay, entity, "Arrows2D:vectors")
    np.testing.assert_array_equal(shown, two_way.counted(fate))
    start = log.position_m[links.row, links.sender]
    way = log.position_m[links.row, links.receiver] - start
    origins, vectors = (rows(replay, entity, f"Arrows2D:{of}", 2) for of in ("origins", "vectors"))
    np.testing.assert_allclose(origins, start, rtol=1e-5, atol=1e-2)
    np.testing.assert_allclose(vectors, share * way, rtol=1e-5, atol=1e-2)


def test_rings_are_where_the_observer_believes_the_others(replay, two_way):
    log, entity = two_way.log, "/arena/belief/ring"
    shown = log.is_known & (np.arange(12) != log.ego)
    per_window = counts(replay, entity, "Ellipses2D:centers")
    np.testing.assert_array_equal(per_window, np.sum(shown, axis=1))
    centres = rows(replay, entity, "Ellipses2D:centers", 2)
    np.testing.assert_allclose(centres, log.believed_m[shown], rtol=1e-6, atol=1e-4)


def test_a_map_that_follows_the_team_keeps_it_in_the_middle(two_way, tmp_path):
    """North stays up: what is shown of p is p - c with y turned round."""
    drift = np.linspace(0.0, 9e3, 30)[:, None, None] * np.array([1.0, 0.5])
    log, far = replace(two_way.log, position_m=two_way.log.position_m + drift), tmp_path / "far.rrd"
    write_replay(log, two_way.mission, {"seed": 5}, far)
    np.testing.assert_array_equal(rows(far, "/arena", "Transform3D:mat3x3", 9), [NORTH_UP] * 30)
    shift = rows(far, "/arena", "Transform3D:translation", 3)[:, None, :2]
    shown = log.position_m * (1.0, -1.0) + shift
    middle = (shown.min(axis=1) + shown.max(axis=1)) / 2.0
    np.testing.assert_allclose(middle, 0.0, atol=1e-3)


@pytest.mark.parametrize(
    ("reach_m", "way_m", "square"), [(500.0, 0.0, 100.0), (500.0, 4e3, 100.0), (500.0, 9e3, 1e3)]
)
def test_squares_are_few_enough_to_be_seen(reach_m, way_m, square):
    centre_m = np.array([[0.0, 0.0], [way_m, 0.0]])
    assert square_m(Ground(centre_m=centre_m, reach_m=reach_m)) == square


def test_headings_have_one_length_and_the_direction_of_flight(replay, two_way):
    strips = rows_of_strips(replay, "/arena/heading")
    way = strips[:, 1] - strips[:, 0]
    length = np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(length, length[0], rtol=1e-2)
    velocity = two_way.log.velocity_mps.reshape(-1, 2)
    along = np.sum(way * velocity, axis=1) / length / np.linalg.norm(velocity, axis=1)
    np.testing.assert_allclose(along, 1.0, atol=1e-3)


def test_broadcasts_lead_from_marked_transmitters_to_hearers(flood_replay, flooded):
    log, links = flooded.log, flooded.log.packets["heard"]
    strips = rows_of_strips(flood_replay, "/arena/radio/heard")
    ends = [log.position_m[links.row, robot] for robot in (links.sender, links.receiver)]
    np.testing.assert_allclose(strips, np.stack(ends, axis=1), rtol=1e-5, atol=1e-3)
    row, sender = np.nonzero(np.any(log.recipient != np.arange(12), axis=1))
    marked = rows(flood_replay, "/arena/radio/transmitter", "Points2D:positions", 2)
    np.testing.assert_allclose(marked, log.position_m[row, sender], rtol=1e-5, atol=1e-3)
    per_window = counts(flood_replay, "/arena/radio/transmitter", "Points2D:positions")
    np.testing.assert_array_equal(per_window, np.bincount(row, minlength=30))


def test_robots_wear_the_colour_of_their_age(replay, two_way):
    log, shown = two_way.log, colours(replay, "/arena/robots", "Points2D:colors", 12)
    others = np.arange(12) != log.ego
    assert np.all(shown[:, log.ego] == 255)
    assert np.all(shown[~log.is_known] == palette.UNKNOWN)
    assert np.all(shown[log.is_known & (log.ego_age == 0.0) & others] == (253, 231, 37))
    luma = (shown @ np.array([0.299, 0.587, 0.114]))[-1][log.is_known[-1] & others]
    by_age = np.argsort(log.ego_age[-1][log.is_known[-1] & others])
    assert np.all(np.diff(luma[by_age]) <= 0)


def test_robots_that_are_off_are_dark(failing, tmp_path):
    write_replay(failing.log, failing.mission, {"seed": 5}, tmp_path / "off.rrd")
    shown = colours(tmp_path / "off.rrd", "/arena/robots", "Points2D:colors", 12)
    is_dark = np.all(shown == palette.SWITCHED_OFF, axis=-1)
    np.testing.assert_array_equal(is_dark, ~failing.log.is_on)
    assert np.sum(is_dark, axis=1).tolist() == [0] * 15 + [3] * 15


def test_circles_have_the_range_and_stand_around_transmitters(replay, two_way):
    log, entity = two_way.log, "/arena/radio/range"
    assert set(rows(replay, entity, "Ellipses2D:half_sizes")) == {250.0}
    row, sender = np.nonzero(log.recipient[:, 0] != np.arange(12))
    per_window = counts(replay, entity, "Ellipses2D:centers")
    np.testing.assert_array_equal(per_window, np.bincount(row, minlength=len(log.window)))
    centres = rows(replay, entity, "Ellipses2D:centers", 2)
    np.testing.assert_allclose(centres, log.position_m[row, sender], rtol=1e-5)


def test_the_tree_on_the_map_joins_parents_and_children(replay, two_way):
    log = two_way.log
    row, child = np.nonzero(log.is_known & (np.arange(12) != log.ego))
    ends = [log.position_m[row, robot] for robot in (log.parent[row, child], child)]
    strips = rows_of_strips(replay, "/arena/tree")
    np.testing.assert_allclose(strips, np.stack(ends, axis=1), rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize(("kind", "dashes"), [("too_weak", 4), ("unbelieved", 1)])
@pytest.mark.parametrize(("view", "axes"), [("arena", 2), ("scene", 3)])
def test_lines_are_the_mismatched_links(blocked, blocked_replay, kind, dashes, view, axes):
    mismatch, pieces = blocked.log.mismatch, dashes if view == "arena" else 1
    links, entity = mismatch.by_kind[kind], f"/{view}/world/{kind}"
    start_m = blocked.log.position_m[mismatch.window[links.row] - 1, links.sender]
    component = f"LineStrips{axes}D:strips"
    expected = pieces * np.bincount(links.row, minlength=len(mismatch.window))
    np.testing.assert_array_equal(counts(blocked_replay, entity, component), expected)
    strips = column(blocked_replay, entity, component).flatten().flatten().flatten()
    lines = strips.to_numpy().reshape(-1, 2, axes)[::pieces]
    np.testing.assert_allclose(lines[:, 0, :2], start_m, atol=1e-3)
    shown = column(blocked_replay, entity, "margin_db").flatten().to_numpy()
    np.testing.assert_array_equal(shown[::pieces], links.margin_db)


def test_the_map_has_the_blocks_of_the_city(blocked, blocked_replay):
    """14 robots have a side of 592 m: three blocks of 110 m by three."""
    strips = static(blocked_replay, "/arena/world/obstacle", "LineStrips2D:strips")
    outlines = np.array(strips.tolist()).reshape(9, 5, 2)
    np.testing.assert_allclose(np.ptp(outlines, axis=1), BLOCK_M, rtol=1e-5)
    assert np.abs(outlines).max() < blocked.mission.half_side_m


def test_halos_are_around_the_robots_that_are_cut_off(blocked, blocked_replay):
    log = blocked.log
    is_apart = np.array([[of != team[log.ego] for of in team] for team in log.group])
    assert 0 < np.sum(is_apart) < is_apart.size
    on_map = rows(blocked_replay, "/arena/world/cut_off", "Points2D:positions", 2)
    in_space = rows(blocked_replay, "/scene/world/cut_off", "Cylinders3D:centers", 3)[:, :2]
    for shown in (on_map, in_space):
        np.testing.assert_allclose(shown, log.position_m[is_apart], rtol=1e-5, atol=1e-3)


def test_free_space_has_nothing_of_this(replay):
    assert not any("/world/" in entity for entity in entities(replay))


def outlines(geom):
    scene = f"<mujoco><worldbody><geom group='1' {geom}/></worldbody></mujoco>"
    return footprints(obstacles_of(mujoco.MjModel.from_xml_string(scene)), 1.0)


def outline(geom):
    (found,) = outlines(geom)
    np.testing.assert_array_equal(found[0], found[-1])
    return found[:-1]


ROOT_18 = np.sqrt(18.0)


@pytest.mark.parametrize(
    ("geom", "corners"),
    [
        ("size='3 2 5' pos='10 20 5'", [(7, 18), (7, 22), (13, 18), (13, 22)]),
        ("size='3 3 5' euler='0 0 45'", [(-ROOT_18, 0), (0, -ROOT_18), (0, ROOT_18), (ROOT_18, 0)]),
    ],
)
def test_a_box_is_its_rectangle(geom, corners):
    found = sorted(map(tuple, outline(f"type='box' {geom}").round(9).tolist()))
    np.testing.assert_allclose(found, corners, atol=1e-9)


@pytest.mark.parametrize(
    "geom",
    [
        "type='cylinder' size='4 5'",
        "type='capsule' size='4 5'",
        "type='sphere' size='5' pos='0 0 -2'",  # cut 3 m above its middle
        "type='ellipsoid' size='4 4 9' pos='0 0 1'",
    ],
)
def test_round_things_are_circles_of_4_m(geom):
    corners = outline(geom)
    np.testing.assert_allclose(np.linalg.norm(corners, axis=1), 4.0, rtol=0.03)
    x, y = corners.T
    area = 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))
    np.testing.assert_allclose(area, np.pi * 4.0**2, rtol=0.07)


@pytest.mark.parametrize("z", [-9.0, 9.0])
def test_obstacles_above_or_below_the_antennas_are_in_no_way(z):
    assert outlines(f"type='box' size='3 3 3' pos='0 0 {z}'") == []


def test_lines_fill_an_outline():
    corners = outline("type='box' size='3 2 5' euler='0 0 30'")
    lines = filling(np.concatenate([corners, corners[:1]]), 0.05)
    high_m = np.ptp(corners[:, 1]) / len(lines)
    assert high_m <= 0.05
    assert sum(b[0] - a[0] for a, b in lines) * high_m == pytest.approx(24.0, rel=0.01)
