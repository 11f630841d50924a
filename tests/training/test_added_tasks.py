"""The examples of controllers by hand, by brute force, and as flights with and without news."""

import added_tasks
import numpy as np
import pytest
from added_tasks import (
    APART_M,
    DAMPING_PER_S,
    STIFFNESS_PER_S2,
    Coverage,
    Formation,
    Reynolds,
    block,
    cell,
    moments,
)
from channels import tell_everyone_the_truth, to_nobody
from hypothesis import given
from hypothesis import strategies as st

import swarm_mj
from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.simulation.swarm import Swarm

HALF = 50.0


def states_of(position_m, velocity_mps=0.0, is_active=None):
    position_m = np.array(position_m, dtype=float)
    velocity_mps = np.zeros_like(position_m) + velocity_mps
    return RobotStates(position_m=position_m, velocity_mps=velocity_mps, is_active=is_active)


def news_of(*entries, num_robots):
    """Buffers in which robot 0 has heard where others were, and nobody else has heard anything."""
    buffers = empty_buffers(1, num_robots)
    for j, position_m in entries:
        buffers.timestamp[0, 0, j] = 1.0
        buffers.position_m[0, 0, j] = position_m
    return buffers


@pytest.mark.parametrize("robot", ["point", "quadrotor"])
@pytest.mark.parametrize("name", ["Formation", "Coverage", "Reynolds"])
def test_it_flies_by_name(name, robot):
    """As the command in the example's own docstring does."""
    run = swarm_mj.fly(
        "random-walk",
        policy="tdma",
        controller=f"added_tasks:{name}",
        robot=robot,
        num_robots=6,
        num_windows=300,
    )
    part = getattr(added_tasks, name)
    assert run.task_cost == (part.cost_name, part.cost_unit)
    assert 0.0 < run.summary.task_cost_last < run.summary.task_cost_first


def test_a_robot_at_rest_comes_to_its_target_and_never_past_it():
    """Critically damped from rest: (1 + t / 2) exp(-t / 2) of the way is left."""
    position_m, velocity_mps, step_s = np.array([[[8.0, 0.0]]]), np.zeros((1, 1, 2)), 1e-3
    for n in range(1, 12_001):
        wanted_mps2 = added_tasks.steer(np.zeros((1, 1, 2)), states_of(position_m, velocity_mps))
        velocity_mps = velocity_mps + step_s * wanted_mps2
        position_m = position_m + step_s * velocity_mps
        if n % 3000 == 0:
            t = n * step_s
            left_m = 8.0 * (1.0 + t / 2.0) * np.exp(-t / 2.0)
            assert position_m[0, 0] == pytest.approx([left_m, 0.0], abs=0.01)


def cost_along(part, num_windows, shift_m=0.0, *, tells_the_truth, **fields):
    """The task's cost after each window of a team that begins at rest, without a radio."""
    mission = paper("stationary", velocity_ratio=1.0, **fields)
    swarm = Swarm(mission, [1, 2], channel=to_nobody, controller=part(mission))
    swarm._physics.place(swarm.states.position_m + shift_m, swarm.states.velocity_mps)
    costs = []
    for _ in range(num_windows):
        if tells_the_truth:
            tell_everyone_the_truth(swarm)
        costs.append(swarm.step_with_recipients(swarm.views.silence.copy()).task_cost.value)
    return np.array(costs)


def errors_along(num_windows, shift_m=0.0, *, tells_the_truth=True):
    nine = {"num_robots": 9, "boundary": "none"}
    return cost_along(Formation, num_windows, shift_m, tells_the_truth=tells_the_truth, **nine)


def test_fresh_news_lead_to_the_formation_wherever_it_stands_and_none_do_not():
    informed = errors_along(600)
    assert np.all(np.diff(informed[:200:10], axis=0) < 0.0)
    assert np.all(informed[-1] < 0.01)
    np.testing.assert_allclose(informed[:60], errors_along(60, 1000.0), rtol=1e-6)
    uninformed = errors_along(50, tells_the_truth=False)
    np.testing.assert_allclose(uninformed, uninformed[:1].repeat(50, axis=0))


def test_the_cost_falls_by_lloyds_algorithm_and_not_where_nobody_hears_anything():
    informed, uninformed = (
        cost_along(Coverage, 200, tells_the_truth=is_informed, num_robots=12)
        for is_informed in (True, False)
    )
    assert np.all(np.diff(informed[::25], axis=0) <= 1e-9)
    assert np.all(informed[-1] < 0.85 * informed[0])
    assert np.all(uninformed[-1] > 1.5 * informed[-1])  # all of them moved to the middle


def formation_error(position_m, place_m, is_active=None):
    """The task's cost, with these places."""
    task = Formation(paper(num_robots=len(place_m)))
    task._place_m = place_m
    return task.cost(states_of(position_m, is_active=is_active))


def test_a_block_of_five_by_hand():
    """Three columns 30 m wide: rows of 3 and 2, 15 m apart; their mean is the origin."""
    place_m = block(5, 30.0)
    apart = place_m - place_m[0]
    np.testing.assert_allclose(apart, [[0, 0], [15, 0], [30, 0], [0, -15], [15, -15]])
    np.testing.assert_allclose(place_m.mean(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("num_robots", [2, 3, 10, 97, 1000])
def test_a_block_fits_the_area_whatever_the_team(num_robots):
    place_m = block(num_robots, HALF)
    assert len(np.unique(place_m.round(6), axis=0)) == num_robots
    assert np.all(np.ptp(place_m, axis=0) <= HALF + 1e-9)


def test_the_law_of_the_formation_by_hand():
    """Robot 0 knows robot 2 alone, which was at (100, 0): its own place is d_0 - d_2 from there."""
    mission = paper(num_robots=4)
    place_m = block(4, mission.side_m / 2)
    states = states_of(np.full((1, 4, 2), 7.0), 3.0)
    u = Formation(mission)(news_of((2, [100.0, 0.0]), num_robots=4), states)
    target_m = np.array([100.0, 0.0]) + place_m[0] - place_m[2]
    expected = STIFFNESS_PER_S2 * (target_m - 7.0) - DAMPING_PER_S * 3.0
    np.testing.assert_allclose(u[0, 0], expected)
    np.testing.assert_allclose(u[0, 1:], -3.0 * DAMPING_PER_S)  # they know nobody, and stop


def test_the_error_of_a_formation_by_hand():
    """None wherever it stands. One of four is 8 m off: 2 m of it are everyone's, so 6 and 3 x 2."""
    place_m = block(4, 100.0)
    there = np.stack([place_m, place_m + np.array([30.0, -500.0])])
    np.testing.assert_allclose(formation_error(there, place_m), 0.0, atol=1e-9)
    there[:, 3, 0] += 8.0
    expected = np.sqrt((6.0**2 + 3 * 2.0**2) / 4)
    assert formation_error(there, place_m) == pytest.approx([expected] * 2)
    everyone_else = np.array([[True, True, True, False]] * 2)
    np.testing.assert_allclose(formation_error(there, place_m, everyone_else), 0.0, atol=1e-9)


def test_a_robot_that_knows_nobody_moves_to_the_middle_of_the_area():
    states = states_of([[[10.0, -20.0], [30.0, 40.0]]])
    u = Coverage(paper(num_robots=2))(empty_buffers(1, 2), states)
    np.testing.assert_allclose(u, -STIFFNESS_PER_S2 * states.position_m)


def test_a_robot_moves_to_the_centroid_of_its_cell_by_what_it_heard():
    """Robot 0 at x = -20 heard that robot 1 was at x = 40: its cell ends at x = 10.

    The cell is 10 m + P_max wide and its centroid at (10 - P_max) / 2. It does not matter where
    robot 1 is now. Outside the area and without ground there, a robot returns.
    """
    mission = paper(num_robots=2)
    half = mission.half_side_m
    states = states_of([[[-20.0, 0.0], [99.0, 99.0]]])
    u = Coverage(mission)(news_of((1, [40.0, 0.0]), num_robots=2), states)
    expected = STIFFNESS_PER_S2 * np.array([(10.0 - half) / 2.0 + 20.0, 0.0])
    np.testing.assert_allclose(u[0, 0], expected, atol=1e-9)
    outside = states_of([[[half + 50.0, 0.0], [half, 0.0]]])
    u = Coverage(mission)(news_of((1, [half, 0.0]), num_robots=2), outside)
    np.testing.assert_allclose(u[0, 0], [-50.0 * STIFFNESS_PER_S2, 0.0])


def test_the_cost_of_two_robots_in_the_middle_by_hand():
    """The mean of x² + y² over a square of 2 h is 2 h² / 3."""
    mission = paper(num_robots=2)
    cost = Coverage(mission).cost(states_of(np.zeros((1, 2, 2))))
    assert cost[0] ** 2 == pytest.approx(2 * mission.half_side_m**2 / 3)


def test_the_cost_is_the_distance_to_the_nearest_active_robot():
    mission = paper(num_robots=8, density_per_km2=800.0)  # 100 m by 100 m
    position_m = np.random.default_rng(0).uniform(-HALF, HALF, (3, 8, 2))
    is_active = np.ones((3, 8), dtype=bool)
    is_active[1, :4] = False
    points = grid(HALF, 400)[:, None]
    cost = Coverage(mission).cost(states_of(position_m, is_active=is_active))
    for b in range(3):
        apart_m2 = np.sum((points - position_m[b, is_active[b]]) ** 2, axis=2)
        assert cost[b] ** 2 == pytest.approx(np.mean(np.min(apart_m2, axis=1)), rel=1e-4)


def grid(half, num):
    """Centres of num x num squares that tile the area."""
    x = (np.arange(num) + 0.5) * (2 * half / num) - half
    return np.stack(np.meshgrid(x, x), axis=-1).reshape(-1, 2)


def everyone(position_m):
    return np.ones(len(position_m), dtype=np.bool_)


def corners_of(polygon):
    return sorted({(round(x, 9), round(y, 9)) for x, y in polygon})


def test_two_robots_share_by_the_bisector():
    """At x = -20 and x = 40 the border is x = 10: 60 m and 40 m of 100 m each."""
    pair = np.array([[-20.0, 0.0], [40.0, 0.0]])
    west, east = (cell(pair, everyone(pair), i, HALF) for i in range(2))
    assert corners_of(west) == [(-50, -50), (-50, 50), (10, -50), (10, 50)]
    assert corners_of(east) == [(10, -50), (10, 50), (50, -50), (50, 50)]


def test_of_robots_at_one_point_the_first_takes_all_and_who_does_not_count_nothing():
    three = np.array([[1.0, 1.0], [1.0, 1.0], [-1.0, 0.0]])
    counts = np.array([True, True, False])
    first, second = (cell(three, counts, i, HALF) for i in range(2))
    assert moments(first, three[0])[0] == pytest.approx(1e4)
    assert len(second) == 0


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


def test_moments_of_a_rectangle_by_hand():
    """2 m by 4 m from (0, 0), about (0, 0): A 8; A x 8, A y 16; 8 (2² + 4²) / 3."""
    rectangle = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 4.0], [0.0, 4.0]])
    assert moments(rectangle, np.zeros(2)) == pytest.approx((8.0, 8.0, 16.0, 160.0 / 3.0))


def test_a_flock_is_drawn_to_the_mean_of_those_it_has_heard_of():
    """Robot 0, at rest, has heard of two that are far, and of one of the two that it moves."""
    news = news_of((1, [30.0, 0.0]), (2, [0.0, 60.0]), num_robots=4)
    news.velocity_mps[0, 0, 1] = [2.0, 0.0]
    found = Reynolds()(news, states_of([[[0.0, 0.0]] * 4]))
    # Eq. 16 is a mean over both, and so is cohesion.
    assert found[0, 0] == pytest.approx([1.0 + 0.05 * 15.0, 0.05 * 30.0])
    assert np.all(found[0, 3] == 0.0)


def test_a_flock_keeps_apart():
    """Of one at half the distance, half of the push is left, in space as in the plane."""
    for way in ([1.0, 0.0], [0.0, 0.0, 1.0]):
        near_m = 0.5 * APART_M * np.array(way)
        buffers = empty_buffers(1, 2, num_axes=len(way))
        buffers.timestamp[0, 0, 1] = 1.0
        buffers.position_m[0, 0, 1] = near_m
        found = Reynolds()(buffers, states_of([[[0.0] * len(way)] * 2]))
        np.testing.assert_allclose(found[0, 0], 0.05 * near_m - 0.5 * 3.0 * np.array(way))


def test_the_spread_is_that_of_active_robots():
    states = states_of(
        [[[0.0, 0.0], [6.0, 8.0], [900.0, 0.0]]], is_active=np.array([[True, True, False]])
    )
    assert Reynolds().cost(states) == pytest.approx([5.0])
