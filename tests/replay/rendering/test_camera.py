"""The camera's geometry, by hand."""

import numpy as np
import pytest

from swarm_mj.replay.rendering.camera import FOV_Y_DEG, look_at


@pytest.mark.parametrize(("width", "height"), [(1280, 720), (400, 400), (300, 900)])
def test_the_whole_square_is_seen_and_fills_the_picture(width, height):
    centre, reach = np.array([250.0, -100.0]), 700.0
    camera = look_at(centre, reach, width, height)
    corners = np.array([[x, y, 0.0] for x in (-reach, reach) for y in (-reach, reach)])
    seen = camera.pixels(corners + np.append(centre, 0.0))
    assert np.all(seen >= 0.0)
    assert np.all(seen <= [width, height])
    extent = np.ptp(seen, axis=0) / [width, height]
    assert 0.8 < extent.max() < 1.0


def test_the_target_is_in_the_middle_and_north_is_up():
    camera = look_at(np.zeros(2), 100.0, 640, 480)
    middle = np.append(camera.target_m, 0.0)
    points = middle + np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
    at, east, north, above = camera.pixels(points)
    np.testing.assert_allclose(at, [320, 240])
    assert east[0] > 320
    assert abs(east[1] - 240) < 1e-9
    assert north[1] < 240
    assert above[1] < 240


def test_a_pixel_is_as_large_as_the_lens_says():
    camera = look_at(np.zeros(2), 100.0, 640, 480)
    middle = np.append(camera.target_m, 0.0)
    one_metre_m = camera.pixels(np.array([middle, middle + np.eye(3)[0]]))
    across = one_metre_m[1, 0] - one_metre_m[0, 0]
    np.testing.assert_allclose(camera.pixel_m, 1.0 / across)
    whole_m = 2.0 * camera.distance_m * np.tan(np.deg2rad(FOV_Y_DEG) / 2.0)
    np.testing.assert_allclose(camera.pixel_m * 480, whole_m)
