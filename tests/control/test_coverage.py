import numpy as np
import pytest
from channels import to_nobody
from hypothesis import given
from hypothesis import strategies as st
from truth import tell_everyone_the_truth

from swarm_mj.control.controller import DAMPING_PER_S, STIFFNESS_PER_S2
from swarm_mj.control.coverage import Coverage, cell, locational_cost, moments
from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.simulation.swarm import Swarm


def standing(position_m, **more):
    position_m = np.array(position_m, dtype=float)
    return RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m), **more)


def silence(swarm):
    return swarm.views.silence.copy()


def test_a_robot_that_knows_nobody_moves_to_the_middle_of_the_area():
    mission = paper("coverage", num_robots=2)
    states = standing([[[10.0, -20.0], [30.0, 40.0]]])
    u = Coverage(mission)(empty_buffers(1, 2), states)
    np.testing.assert_allclose(u, -STIFFNESS_PER_S2 * states.position_m)


def test_a_robot_moves_to_the_centroid_of_its_cell_by_what_it_heard():
    """Robot 0 at x = -20 heard that robot 1 was at x = 40: its cell ends at x = 10.

    The cell is 10 m + P_max wide and its centroid at (10 - P_max) / 2. It does not matter where
    robot 1 is now.
    """
    mission = paper("coverage", num_robots=2)
    buffers = empty_buffers(1, 2)
    buffers.timestamp[0, 0, 1] = 3.0
    buffers.position_m[0, 0, 1] = [40.0, 0.0]
    states = standing([[[-20.0, 0.0], [99.0, 99.0]]])
    u = Coverage(mission)(buffers, states)
    target_m = (10.0 - mission.half_side_m) / 2.0
    expected = STIFFNESS_PER_S2 * np.array([target_m + 20.0, 0.0])
    np.testing.assert_allclose(u[0, 0], expected, atol=1e-9)


def test_robots_brake():
    mission = paper("coverage", num_robots=2)
    states = RobotStates(position_m=np.zeros((1, 2, 2)), velocity_mps=np.full((1, 2, 2), 2.0))
    np.testing.assert_allclose(
        Coverage(mission)(empty_buffers(1, 2), states), -2.0 * DAMPING_PER_S, atol=1e-9
    )


def test_who_is_outside_the_area_and_has_no_ground_there_returns():
    mission = paper("coverage", num_robots=2, boundary="none")
    half = mission.half_side_m
    buffers = empty_buffers(1, 2)
    buffers.timestamp[0, 0, 1] = 1.0
    buffers.position_m[0, 0, 1] = [half, 0.0]
    states = standing([[[half + 50.0, 0.0], [half, 0.0]]])
    u = Coverage(mission)(buffers, states)
    np.testing.assert_allclose(u[0, 0], [-50.0 * STIFFNESS_PER_S2, 0.0])


def test_the_cost_of_one_robot_in_the_middle_by_hand():
    """The mean of x² + y² over a square of 2 h is 2 h² / 3."""
    cost = locational_cost(np.zeros((1, 1, 2)), 30.0, np.ones((1, 1), dtype=bool))
    assert cost[0] == pytest.approx(2 * 30.0**2 / 3)


def test_the_cost_is_the_mean_squared_distance_to_the_nearest_robot():
    position_m = np.random.default_rng(0).uniform(-50.0, 50.0, (3, 8, 2))
    is_active = np.ones((3, 8), dtype=bool)
    is_active[1, :4] = False
    x = np.linspace(-50.0, 50.0, 401)[:-1] + 0.125
    points = np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 1, 2)
    cost = locational_cost(position_m, 50.0, is_active)
    for b in range(3):
        apart_m2 = np.sum((points - position_m[b, is_active[b]]) ** 2, axis=2)
        assert cost[b] == pytest.approx(np.mean(np.min(apart_m2, axis=1)), rel=1e-4)


def costs_along(tells_the_truth):
    mission = paper("coverage", num_robots=12, velocity_ratio=0.5)
    swarm = Swarm(mission, [1, 2], channel=to_nobody)
    costs = []
    for _ in range(300):
        if tells_the_truth:
            tell_everyone_the_truth(swarm)
        costs.append(swarm.step_with_recipients(silence(swarm)).task_cost.value)
    return np.array(costs)


def test_the_cost_falls_by_lloyds_algorithm_and_not_where_nobody_hears_anything():
    told, untold = costs_along(True), costs_along(False)
    assert np.all(np.diff(told[::25], axis=0) <= 1e-9)
    assert np.all(told[-1] < 0.85 * told[0])
    assert np.all(untold[-1] > 1.5 * told[-1])  # all of them moved to the middle


HALF = 50.0


def grid(half, num):
    """Centres of num x num squares that tile the area."""
    x = (np.arange(num) + 0.5) * (2 * half / num) - half
    return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)


def everyone(position_m):
    return np.ones(len(position_m), dtype=np.bool_)


def corners_of(polygon):
    return sorted({(round(x, 9), round(y, 9)) for x, y in polygon})


def test_a_robot_alone_has_the_area():
    alone = np.array([[10.0, 20.0]])
    polygon = cell(alone, everyone(alone), 0, HALF)
    assert corners_of(polygon) == [(-50, -50), (-50, 50), (50, -50), (50, 50)]


def test_two_robots_share_by_the_bisector():
    """At x = -20 and x = 40 the border is x = 10: 60 m and 40 m of 100 m each."""
    pair = np.array([[-20.0, 0.0], [40.0, 0.0]])
    west, east = (cell(pair, everyone(pair), i, HALF) for i in range(2))
    assert corners_of(west) == [(-50, -50), (-50, 50), (10, -50), (10, 50)]
    assert corners_of(east) == [(10, -50), (10, 50), (50, -50), (50, 50)]


def test_a_border_through_the_areas_corners_keeps_them():
    pair = np.array([[-1.0, 1.0], [1.0, -1.0]])
    north_west = cell(pair, everyone(pair), 0, HALF)
    assert corners_of(north_west) == [(-50, -50), (-50, 50), (50, 50)]


def test_of_robots_at_one_point_the_first_takes_all():
    pair = np.array([[1.0, 1.0], [1.0, 1.0]])
    assert len(cell(pair, everyone(pair), 0, HALF)) == 4
    assert len(cell(pair, everyone(pair), 1, HALF)) == 0


def test_who_does_not_count_takes_nothing():
    three = np.array([[0.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
    polygon = cell(three, np.array([True, False, False]), 0, HALF)
    assert moments(polygon, three[0])[0] == pytest.approx(1e4)


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 12))
def test_cells_hold_the_points_that_are_nearer_to_their_robot_than_to_others(seed, num_robots):
    """By brute force: the nearest robot of every point of a fine grid, robots outside included."""
    position_m = np.random.default_rng(seed).uniform(-1.3 * HALF, 1.3 * HALF, (num_robots, 2))
    points = grid(HALF, 100)
    apart_m2 = np.sum((points[:, None] - position_m) ** 2, axis=2)
    nearest = np.argmin(apart_m2, axis=1)
    for i in range(num_robots):
        area, first_x, first_y, second = moments(
            cell(position_m, everyone(position_m), i, HALF), position_m[i]
        )
        own = points[nearest == i] - position_m[i]
        border = 4 * 2 * HALF  # a square of 1 m² that a border cuts is given to one robot whole
        assert area == pytest.approx(len(own), abs=border)
        scale = 3 * HALF
        assert [first_x, first_y] == pytest.approx(own.sum(axis=0).tolist(), abs=border * scale)
        assert second == pytest.approx(np.sum(own**2), abs=border * scale**2)


def test_cells_tile_the_area():
    position_m = np.random.default_rng(3).uniform(-HALF, HALF, (30, 2))
    areas = [
        moments(cell(position_m, everyone(position_m), i, HALF), position_m[i])[0]
        for i in range(30)
    ]
    assert sum(areas) == pytest.approx(1e4, rel=1e-12)


def test_moments_of_a_rectangle_by_hand():
    """2 m by 4 m from (0, 0), about (0, 0): A 8; A x 8, A y 16; 8 (2² + 4²) / 3."""
    rectangle = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]])
    assert moments(rectangle, np.zeros(2)) == pytest.approx((8.0, 8.0, 16.0, 160.0 / 3.0))
