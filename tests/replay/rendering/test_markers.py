"""Robots and packets in a scene; the camera's geometry, by hand."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from moments import moment

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.links import LINK, SEGMENTS, LinkMismatch
from swarm_mj.replay.rendering.markers import (
    CHASE_FOV_Y_DEG,
    CHASE_POINT_M,
    FOV_Y_DEG,
    TRAIL_PIECES,
    TRAIL_S,
    chase,
    draw_markers,
    look_at,
)
from swarm_mj.replay.rendering.theme import DARK, LIGHT


def drawn(footage, row=0, theme=DARK):
    scene = mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
    scene.ngeom = 0
    draw_markers(scene, footage, row, look_at(footage.ground, row, 640, 480), theme)
    return [scene.geoms[k] for k in range(scene.ngeom)]


def end(line):
    """Where a line ends that MuJoCo keeps by its start, turn and length."""
    return line.pos + line.size[2] * line.mat[:, 2]


def test_the_observer_is_the_largest_and_white():
    discs = drawn(moment([(0.0, 0.0), (100.0, 0.0), (0.0, 100.0)], observer=1))
    assert np.argmax([disc.size[0] for disc in discs]) == 1
    assert discs[0].size[0] == discs[2].size[0]
    np.testing.assert_array_equal(discs[1].rgba, 1.0)
    np.testing.assert_allclose([disc.pos[:2] for disc in discs], [(0, 0), (100, 0), (0, 100)])


def test_a_robot_that_is_cut_off_has_a_flat_red_halo():
    seen = moment([(0.0, 0.0), (100.0, 0.0)])
    seen.is_cut_off[0, 1] = True
    _, robot, halo = drawn(seen)
    np.testing.assert_allclose(halo.pos[:2], (100, 0))
    np.testing.assert_allclose(halo.rgba[:3] * 255.0, palette.CUT_OFF)
    assert halo.size[0] > robot.size[0]
    assert halo.size[2] < 0.3 * robot.size[2]


def test_a_robot_that_moved_has_a_trail_and_one_at_rest_has_none():
    seen = moment([(0.0, 0.0), (100.0, 0.0)], num_windows=200)
    seen.position_m[:, 1, 0] += np.arange(200.0)
    trail = drawn(seen, 199)[:-2]
    assert len(trail) == TRAIL_PIECES
    np.testing.assert_allclose(trail[0].pos[:2], (100 + 199 - TRAIL_S / 0.1, 0))
    np.testing.assert_allclose(end(trail[-1])[:2], (299, 0))


def test_on_light_ground_robots_have_rims_and_the_observer_is_black():
    rim, observer, *others = drawn(moment([(0.0, 0.0), (100.0, 0.0)]), theme=LIGHT)
    assert rim.size[0] > observer.size[0]
    assert rim.size[2] < observer.size[2]
    np.testing.assert_allclose(observer.rgba[:3] * 255.0, LIGHT.ego)
    assert len(others) == 2


def test_links_that_surprise_are_drawn_until_there_is_no_room():
    seen = moment([(0.0, 0.0), (100.0, 0.0)])
    for num in (3, 500):
        links = np.array([(0, 0, 1, 90, 5, False)] * num, LINK)
        geoms = drawn(replace(seen, mismatch=LinkMismatch(np.array([1]), links)))
        assert len(geoms) == min(2 + num, 100)
        np.testing.assert_allclose(geoms[-1].rgba[:3] * 255.0, palette.UNBELIEVED)


def test_what_marks_bodies_is_as_high_as_they_are():
    """All but packets, whose ends are recorded in space: rims, discs, halos and links."""
    seen = moment([(0.0, 0.0), (100.0, 0.0)])
    seen.is_cut_off[0, 1] = True
    mismatch = LinkMismatch(np.array([1]), np.array([(0, 0, 1, 90, 5, False)], LINK))
    seen = replace(seen, mismatch=mismatch)
    on_floor = drawn(seen, theme=LIGHT)
    in_air = drawn(replace(seen, height_m=np.array([[20.0, 50.0]])), theme=LIGHT)
    assert len(on_floor) == 6  # a rim and a disc for each, a halo and a line
    risen_m = [high.pos[2] - low.pos[2] for high, low in zip(in_air, on_floor, strict=True)]
    np.testing.assert_allclose(risen_m, [20.0, 20.0, 50.0, 50.0, 50.0, 20.0], rtol=1e-5)
    assert end(in_air[-1])[2] - end(on_floor[-1])[2] == pytest.approx(50.0, rel=1e-5)


def test_a_packet_is_an_arc_of_lines_and_a_heading_one_more():
    seen = moment([(0.0, 0.0), (100.0, 0.0)], [(0, 1)])
    arc = drawn(seen)[2:]
    assert len(arc) == SEGMENTS
    places = [*(line.pos for line in arc), end(arc[-1])]
    np.testing.assert_allclose([end(line) for line in arc], places[1:], atol=1e-4)
    np.testing.assert_allclose([places[0][:2], places[-1][:2]], [(0, 0), (100, 0)], atol=1e-4)
    seen.velocity_mps[0, 1] = (0.0, 3.0)
    assert len(drawn(seen)) == 3 + SEGMENTS
    heading = drawn(seen)[2]
    np.testing.assert_allclose(heading.pos[:2], (100, 0))
    np.testing.assert_allclose(heading.mat[:, 2], (0, 1, 0), atol=1e-6)


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (400, 400), (300, 900)])
def test_the_whole_square_is_seen_and_fills_the_picture(width, height):
    centre, reach = np.array([250.0, -100.0]), 700.0
    camera = look_at(Ground(centre_m=centre[None], reach_m=reach), 0, width, height)
    corners = np.array([[x, y, 0.0] for x in (-reach, reach) for y in (-reach, reach)])
    seen = camera.pixels(corners + np.append(centre, 0.0))
    assert np.all(seen >= 0.0)
    assert np.all(seen <= [width, height])
    extent = np.ptp(seen, axis=0) / [width, height]
    assert 0.8 < extent.max() < 1.0


@pytest.mark.parametrize(("height", "axis"), [(560, 0), (1250, 1)])
def test_the_camera_is_flat_in_wide_pictures_and_steep_in_high_ones(height, axis):
    """From one angle for all, a wide one had empty sides and a high one an empty quarter."""
    camera = look_at(Ground(centre_m=np.zeros((1, 2)), reach_m=100.0), 0, 1280, height)
    corners = np.array([[x, y, 0.0] for x in (-100.0, 100.0) for y in (-100.0, 100.0)])
    extent = np.ptp(camera.pixels(corners), axis=0)
    assert extent[axis] / (1280, height)[axis] > 0.72


def test_the_target_is_in_the_middle_north_is_up_and_a_pixel_as_large_as_the_lens_says():
    camera = look_at(Ground(centre_m=np.zeros((1, 2)), reach_m=100.0), 0, 640, 480)
    middle = camera.target_m
    at, east, north, above = camera.pixels(middle + np.vstack([np.zeros(3), np.eye(3)]))
    np.testing.assert_allclose(at, [320, 240])
    np.testing.assert_allclose(east, [320 + 1.0 / camera.pixel_m, 240])
    assert max(north[1], above[1]) < 240
    whole_m = 2.0 * camera.distance_m * np.tan(np.deg2rad(FOV_Y_DEG) / 2.0)
    np.testing.assert_allclose(camera.pixel_m * 480, whole_m)


def flying(way_m, **facts):
    """Robot 0 goes along a way, at a window a place, and robot 1 stands 40 m to the north."""
    seen = moment([(0.0, 0.0), (0.0, 40.0)], num_windows=len(way_m), **facts)
    seen.position_m[:, 0] = way_m
    return seen


def east(num_windows=100):
    """10 m a second to the east."""
    along_m = np.arange(num_windows, dtype=float)
    return np.stack([along_m, np.zeros(num_windows)], axis=1)


def test_the_chasing_camera_is_behind_and_above_its_robot_and_looks_where_it_flies():
    camera = chase(flying(east()), 50, 640, 480)
    assert camera.azimuth_deg == pytest.approx(0.0, abs=0.1)
    elevation = np.deg2rad(camera.elevation_deg)
    behind_m = CHASE_POINT_M * np.array([np.cos(elevation), 0.0, -np.sin(elevation)])
    eye_m = camera.target_m - behind_m
    np.testing.assert_allclose(camera.target_m[:2], [50.0, 0.0])
    assert eye_m[0] == pytest.approx(50.0 - CHASE_POINT_M, abs=0.2)
    assert eye_m[2] > 2.0  # a point's middle is at 1 m
    robot, left, ahead, above = camera.pixels(
        np.array([[50.0, 0.0, 1.0], [50.0, 5.0, 1.0], [90.0, 0.0, 1.0], [50.0, 0.0, 3.0]])
    )
    assert robot[0] == pytest.approx(320.0, abs=0.5)
    assert 240.0 < robot[1] < 0.75 * 480.0
    assert left[0] < robot[0] - 50.0
    assert ahead[1] < robot[1] - 20.0
    assert above[1] < robot[1] - 50.0


def test_pixels_of_the_chasing_camera_are_as_the_lens_says():
    """At the distance of its target, the picture is twice the tangent of half the angle high."""
    camera = chase(flying(east()), 50, 640, 480)
    up_m = np.array([0.0, 0.0, 1.0])
    _, up, _ = camera.axes(up_m[None])
    (place,) = camera.pixels((camera.target_m + 0.01 * up_m)[None])
    whole_m = 2.0 * CHASE_POINT_M * np.tan(np.deg2rad(CHASE_FOV_Y_DEG / 2.0))
    assert 240.0 - place[1] == pytest.approx(480.0 * 0.01 * up[0] / whole_m, rel=0.01)


def test_a_robot_that_turns_at_once_lets_the_camera_swing_round():
    """By less than 10 degrees a window, over some seconds."""
    way_m = east()
    way_m[50:, 0] = way_m[50, 0]
    way_m[50:, 1] = np.arange(50.0)
    seen = flying(way_m)
    azimuth_deg = np.array([chase(seen, k, 640, 480).azimuth_deg for k in range(100)])
    assert azimuth_deg[10] == pytest.approx(0.0, abs=0.5)
    assert azimuth_deg[90] == pytest.approx(90.0, abs=0.5)
    assert np.all(np.diff(azimuth_deg) > -0.5)
    assert np.max(np.diff(azimuth_deg)) < 10.0


def test_the_camera_of_a_robot_at_rest_looks_at_its_team():
    """To the north, where the other one is; and so does that of robots at one place."""
    still = np.zeros((5, 2))
    assert chase(flying(still), 2, 640, 480).azimuth_deg == pytest.approx(90.0)
    together = moment([(0.0, 0.0), (0.0, 0.0)])
    assert chase(together, 0, 640, 480).azimuth_deg == pytest.approx(90.0)


def test_from_nearby_others_are_balls_as_large_on_the_picture_wherever_they_are():
    """The followed robot has none; each has a stem, down to the floor."""
    seen = moment([(0.0, 0.0), (0.0, 80.0), (0.0, 160.0)])
    camera = chase(seen, 0, 640, 480)
    scene = mujoco.MjvScene(mujoco.MjModel.from_xml_string("<mujoco/>"), 100)
    scene.ngeom = 0
    draw_markers(scene, seen, 0, camera)
    geoms = [scene.geoms[k] for k in range(scene.ngeom)]
    balls = [geom for geom in geoms if geom.type == mujoco.mjtGeom.mjGEOM_SPHERE]
    stems = [geom for geom in geoms if geom.type == mujoco.mjtGeom.mjGEOM_LINE]
    np.testing.assert_allclose([ball.pos for ball in balls], [(0, 80, 1), (0, 160, 1)], atol=1e-5)
    np.testing.assert_allclose([end(stem)[2] for stem in stems], [0.0] * 3, atol=1e-5)
    _, _, ahead_m = camera.axes(np.array([ball.pos for ball in balls]) - camera.target_m)
    far_m = camera.distance_m + ahead_m
    shares = [ball.size[0] / far for ball, far in zip(balls, far_m, strict=True)]
    assert shares[0] == pytest.approx(shares[1], rel=1e-4)
