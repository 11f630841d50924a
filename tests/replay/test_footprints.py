"""Outlines of obstacles at the antennas' height, against plane geometry."""

import mujoco
import numpy as np
import pytest

from swarm_mj.physics.solid_geoms import obstacles_of
from swarm_mj.replay.footprints import filling, footprints


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
