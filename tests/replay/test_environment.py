"""What a world beyond free space adds: outlines by plane geometry, the rest read from the file."""

import mujoco
import numpy as np
import pytest
from reading import column, counts, rows, static
from rerun.chunk import RrdReader

from swarm_mj.physics.arenas import BLOCK_M
from swarm_mj.physics.solid_geoms import obstacles_of
from swarm_mj.replay.environment import filling, footprints


def test_lines_are_the_links_that_surprise(blocked, blocked_replay):
    mismatch, position_m = blocked.log.mismatch, blocked.log.position_m
    for kind, dashes in (("too_weak", 4), ("unbelieved", 1)):
        links = mismatch.by_kind[kind]
        start_m = position_m[mismatch.window[links.row] - 1, links.sender]
        for view, axes, pieces in (("arena", 2, dashes), ("scene", 3, 1)):
            entity, component = f"/{view}/world/{kind}", f"LineStrips{axes}D:strips"
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


def test_who_points_at_an_obstacle_reads_its_loss(blocked_replay):
    entities = {chunk.entity_path for chunk in RrdReader(blocked_replay).stream()}
    blocks = {path for path in entities if path.startswith("/scene/area/geom")}
    assert len(blocks) == 9
    assert {float(static(blocked_replay, path, "loss_db")[0]) for path in blocks} == {25.0}


def test_halos_are_around_the_robots_that_are_cut_off(blocked, blocked_replay):
    log = blocked.log
    is_apart = np.array([[of != team[log.ego] for of in team] for team in log.group])
    assert 0 < np.sum(is_apart) < is_apart.size
    expected = log.position_m[is_apart]
    on_map = rows(blocked_replay, "/arena/world/cut_off", "Points2D:positions", 2)
    np.testing.assert_allclose(on_map, expected, rtol=1e-5, atol=1e-3)
    in_space = rows(blocked_replay, "/scene/world/cut_off", "Cylinders3D:centers", 3)
    np.testing.assert_allclose(in_space[:, :2], expected, rtol=1e-5, atol=1e-3)


def test_free_space_has_nothing_of_this(replay):
    assert not any("/world/" in chunk.entity_path for chunk in RrdReader(replay).stream())


def outline(geom, height_m=1.0):
    scene = f"<mujoco><worldbody><geom group='1' {geom}/></worldbody></mujoco>"
    (found,) = footprints(obstacles_of(mujoco.MjModel.from_xml_string(scene)), height_m)
    np.testing.assert_array_equal(found[0], found[-1])
    return found[:-1]


def area(corners):
    x, y = corners.T
    return 0.5 * abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1)))


def test_a_box_is_its_rectangle():
    corners = outline("type='box' size='3 2 5' pos='10 20 5'")
    assert sorted(map(tuple, corners.round(6).tolist())) == [(7, 18), (7, 22), (13, 18), (13, 22)]


def test_a_turned_box_is_a_turned_rectangle():
    corners = outline("type='box' size='3 3 5' euler='0 0 45'")
    half = np.sqrt(18.0)
    expected = [(-half, 0.0), (0.0, -half), (0.0, half), (half, 0.0)]
    found = sorted(map(tuple, corners.round(9).tolist()))
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize(
    ("geom", "radius_m"),
    [
        ("type='cylinder' size='4 5'", 4.0),
        ("type='capsule' size='4 5'", 4.0),
        ("type='sphere' size='5' pos='0 0 -2'", 4.0),  # cut 3 m above its middle
        ("type='ellipsoid' size='4 4 9' pos='0 0 1'", 4.0),
    ],
)
def test_round_things_are_circles(geom, radius_m):
    distance_m = np.linalg.norm(outline(geom), axis=1)
    np.testing.assert_allclose(distance_m, radius_m, rtol=0.03)
    np.testing.assert_allclose(area(outline(geom)), np.pi * radius_m**2, rtol=0.07)


@pytest.mark.parametrize("z", [-9.0, 9.0])
def test_what_hangs_above_or_lies_below_the_antennas_stands_in_no_way(z):
    scene = f"<mujoco><worldbody><geom group='1' type='box' size='3 3 3' pos='0 0 {z}'/>"
    model = mujoco.MjModel.from_xml_string(scene + "</worldbody></mujoco>")
    assert footprints(obstacles_of(model), 1.0) == []


def test_lines_fill_an_outline():
    corners = outline("type='box' size='3 2 5' euler='0 0 30'")
    lines = filling(np.concatenate([corners, corners[:1]]), 0.05)
    high_m = np.ptp(corners[:, 1]) / len(lines)
    assert high_m <= 0.05
    assert sum(b[0] - a[0] for a, b in lines) * high_m == pytest.approx(24.0, rel=0.01)
