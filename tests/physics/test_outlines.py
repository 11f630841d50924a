"""Outlines of obstacles at the height of the antennas, against plain geometry."""

import mujoco
import numpy as np
import pytest

from swarm_mj.physics.obstacles import obstacles_of
from swarm_mj.physics.outlines import footprints


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
