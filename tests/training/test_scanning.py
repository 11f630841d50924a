"""The pilot that keeps off what it sees, and the model that it flies."""

import numpy as np
import pytest
from scanners import SCANNER, SCANNERS

from swarm_mj import paper
from swarm_mj.physics.bodies import BodyWorlds
from swarm_mj.physics.robots import kinds_of
from training.examples.scanning import APPROACH_PER_S, KEEP_M, Scanning, directions, slowed


def only_kind(robot):
    [kind] = kinds_of(paper(robot=robot, num_robots=2))
    return kind


def test_the_scanner_is_the_quadrotor_of_the_package():
    """All but its sensors: how it moves, how it is driven, and what collides of it."""
    plain = only_kind("quadrotor").model
    scanner = only_kind(str(SCANNER)).model
    assert plain.opt.timestep == scanner.opt.timestep
    for name in (
        "body_mass",
        "body_inertia",
        "body_ipos",
        "geom_type",
        "geom_size",
        "geom_pos",
        "geom_rgba",
        "geom_contype",
        "actuator_gear",
        "actuator_ctrlrange",
        "actuator_dynprm",
    ):
        np.testing.assert_array_equal(getattr(plain, name), getattr(scanner, name), name)
    np.testing.assert_array_equal(plain.site_pos, scanner.site_pos[:4])
    assert only_kind("quadrotor").declared == only_kind(str(SCANNER)).declared


def test_its_rays_look_45_degrees_apart():
    """A robot that is turned by 90 degrees about the vertical sees to its front in the north."""
    half = 0.25 * np.pi
    level, turned = [1.0, 0.0, 0.0, 0.0], [np.cos(half), 0.0, 0.0, np.sin(half)]
    direction = directions(np.array([[level, turned]]))
    diagonal = np.sqrt(0.5)
    east_to_west = [[1, 0], [diagonal, diagonal], [0, 1], [-diagonal, diagonal], [-1, 0]]
    np.testing.assert_allclose(direction[0, 0, :5], east_to_west, atol=1e-12)
    np.testing.assert_allclose(direction[0, 1, 0], [0, 1], atol=1e-12)
    np.testing.assert_allclose(direction[0, 1, 2], [-1, 0], atol=1e-12)


def test_a_ray_that_tilts_is_shorter_on_the_map():
    """Pitched by 60 degrees, its front ray reaches half as far, and its left one as before."""
    half = np.pi / 6.0
    direction = directions(np.array([[[np.cos(half), 0.0, np.sin(half), 0.0]]]))
    np.testing.assert_allclose(np.linalg.norm(direction[0, 0], axis=1)[[0, 2]], [0.5, 1.0])


@pytest.mark.parametrize(
    ("range_m", "along_mps"),
    [
        (-1.0, 3.0),  # nothing there
        (20.0, 3.0),
        (KEEP_M + 1.0, 1.0 * APPROACH_PER_S),
        (KEEP_M, 0.0),
        (KEEP_M - 0.5, -0.5 * APPROACH_PER_S),
    ],
)
def test_it_approaches_no_faster_than_the_distance_allows(range_m, along_mps):
    velocity_mps = np.array([[[3.0, 2.0]]])
    slow_mps = slowed(velocity_mps, np.array([[range_m]]), np.array([[[1.0, 0.0]]]))
    np.testing.assert_allclose(slow_mps, [[[along_mps, 2.0]]])


@pytest.mark.slow
def test_it_keeps_off_a_tree_that_others_hit():
    """Straight at the first tree, of a radius of 6 m in the middle of x, from 20 m at 3 m/s."""
    tree_m = np.array([0.0, -1000.0 / 6.0])
    crashed = []
    for pilot in ("swarm_mj.physics.pilots:QuadrotorPilot", SCANNERS["pilot"]):
        mission = paper("random-walk", robot=str(SCANNER), num_robots=40, arena="forest")
        worlds = BodyWorlds(mission, 1, pilot=pilot)
        worlds.start([np.random.default_rng(0)], [])
        position_m = np.zeros((1, 40, 3))
        position_m[0] = np.column_stack([np.arange(40.0), np.zeros(40), np.full(40, 50.0)])
        position_m[0, 0] = (26.0, tree_m[1], 5.0)
        velocity_mps = np.zeros_like(position_m)
        velocity_mps[0, 0, 0] = -3.0
        worlds.place(position_m, velocity_mps)
        for _ in range(120):
            states = worlds.step(np.zeros_like(position_m))
        distance_m = np.linalg.norm(states.position_m[0, 0, :2] - tree_m)
        crashed.append(bool(states.has_crashed[0, 0]))
    assert crashed == [True, False]
    assert distance_m == pytest.approx(6.0 + KEEP_M, abs=0.5)


def test_a_robot_without_its_rangefinders_is_refused():
    with pytest.raises(ValueError, match="needs a rangefinder ray0"):
        Scanning(only_kind("quadrotor").airframe(0.005))
