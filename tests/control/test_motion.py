import math
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from swarm_mj.control.motion import (
    Controller,
    Costed,
    RandomWalk,
    controller_of,
    flocking,
    initial_velocity,
)
from swarm_mj.mission import Task, paper, reference
from swarm_mj.mission.batched_rng import Started
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import empty_buffers

TASKS = get_args(Task)
FLOCKING_SETS = ["heard", "moving"]
SEEDS = st.integers(0, 2**32 - 1)


def generators(num_missions, seed=0):
    return [np.random.default_rng((seed, b)) for b in range(num_missions)]


def started(mission, num_missions):
    """The controller of a mission's task, ready."""
    controller = controller_of(mission)
    if isinstance(controller, Started):
        controller.start(mission.num_robots, generators(num_missions))
    return controller


def overheard_team(seed, num_missions=2, num_robots=5):
    """Buffers of which some entries are unheard and some velocities are 0, and true velocities."""
    rng = np.random.default_rng(seed)
    buffers = empty_buffers(num_missions, num_robots)
    shape = buffers.timestamp.shape
    buffers.timestamp[...] = rng.integers(0, 4, size=shape) / 2.0  # 0 is never
    buffers.velocity_mps[...] = rng.normal(scale=3.0, size=(*shape, 2))
    buffers.position_m[...] = rng.normal(scale=100.0, size=(*shape, 2))
    buffers.velocity_mps[rng.random((*shape, 2)) < 0.3] = 0.0
    return buffers, rng.normal(scale=3.0, size=(num_missions, num_robots, 2))


def bodies_of(velocity_mps):
    return RobotStates(position_m=np.zeros_like(velocity_mps), velocity_mps=velocity_mps)


def walked(mission, num_missions, num_windows, seed=0):
    """A random walk's accelerations [window, mission, robot, axis]."""
    walk = RandomWalk(mission)
    walk.start(mission.num_robots, generators(num_missions, seed))
    shape = (num_missions, mission.num_robots, 2)
    buffers = empty_buffers(num_missions, mission.num_robots)
    return np.stack([walk(buffers, bodies_of(np.zeros(shape))) for _ in range(num_windows)])


def test_iv_a_random_walk_is_normal():
    """u ~ N(0, A_max / 3): a standard deviation."""
    u = walked(paper("random-walk", num_robots=50), 10, 200).ravel()
    assert stats.kstest(u, stats.norm(scale=20.0 / 3.0).cdf).pvalue > 1e-3


def test_iv_a_random_walk_draws_apart_for_every_robot_axis_and_window():
    u = walked(paper("random-walk", num_robots=4), 3, 3000).reshape(3000, -1)
    correlation = np.corrcoef(np.vstack([u[1:].T, u[:-1].T]))  # with itself, one window on, too
    np.testing.assert_allclose(correlation, np.eye(len(correlation)), atol=5 / math.sqrt(3000))


def mean_difference(buffers, velocity_mps, counts):
    """Eq. 16 in words: over those who count, the mean of their velocity less one's own."""
    num_missions, num_robots = velocity_mps.shape[:2]
    u = np.zeros_like(velocity_mps)
    for b in range(num_missions):
        for i in range(num_robots):
            for axis in range(2):
                differences = [
                    buffers.velocity_mps[b, i, j, axis] - velocity_mps[b, i, axis]
                    for j in range(num_robots)
                    if counts(buffers.timestamp[b, i, j], buffers.velocity_mps[b, i, j, axis])
                ]
                u[b, i, axis] = math.fsum(differences) / max(len(differences), 1)
    return u


@given(seed=SEEDS)
def test_eq16_counts_who_was_heard_since_the_start(seed):
    buffers, velocity_mps = overheard_team(seed)
    expected = mean_difference(buffers, velocity_mps, lambda timestamp, _: timestamp > 0.0)
    np.testing.assert_allclose(flocking(buffers, velocity_mps, "heard"), expected, atol=1e-12)


@given(seed=SEEDS)
def test_eq16_reference_counts_who_moves(seed):
    """The authors' code, per axis: a velocity of exactly 0 does not count."""
    buffers, velocity_mps = overheard_team(seed)
    expected = mean_difference(buffers, velocity_mps, lambda _, velocity: velocity != 0.0)
    np.testing.assert_allclose(flocking(buffers, velocity_mps, "moving"), expected, atol=1e-12)


@pytest.mark.parametrize(("preset", "counts_unheard"), [(paper, False), (reference, True)])
def test_flocking_set_is_the_presets(preset, counts_unheard):
    """A velocity without a timestamp counts in the authors' code only."""
    buffers = empty_buffers(1, 2)
    buffers.velocity_mps[...] = 1.0
    controller = started(preset("flocking", num_robots=2), 1)
    u = controller(buffers, bodies_of(np.zeros((1, 2, 2))))
    np.testing.assert_array_equal(u, 1.0 if counts_unheard else 0.0)


def test_stationary_robots_do_not_accelerate():
    buffers, velocity_mps = overheard_team(0)
    stand = started(paper("stationary", num_robots=5), 2)
    np.testing.assert_array_equal(stand(buffers, bodies_of(velocity_mps)), np.zeros((2, 5, 2)))


@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize("task", TASKS)
def test_iv_a_a_controller_knows_its_own_robot_only(task, preset):
    """Row 2's acceleration stays when every other row and every other body is another team's."""
    mission = preset(task, num_robots=5)
    mine, mine_mps = overheard_team(1)
    theirs, theirs_mps = overheard_team(2)
    mine_m, theirs_m = 10.0 * mine_mps, 10.0 * theirs_mps
    before = started(mission, 2)(mine, RobotStates(position_m=mine_m, velocity_mps=mine_mps))
    for array, other in (
        (mine.timestamp, theirs.timestamp),
        (mine.position_m, theirs.position_m),
        (mine.velocity_mps, theirs.velocity_mps),
        (mine_m, theirs_m),
        (mine_mps, theirs_mps),
    ):
        array[:, [0, 1, 3, 4]] = other[:, [0, 1, 3, 4]]
    after = started(mission, 2)(mine, RobotStates(position_m=mine_m, velocity_mps=mine_mps))
    np.testing.assert_array_equal(before[:, 2], after[:, 2])


@pytest.mark.parametrize("task", ["random-walk", "flocking"])
def test_initial_velocity_is_uniform_per_axis(task):
    mission = paper(task, num_robots=1000, velocity_ratio=0.15)
    velocity_mps = initial_velocity(mission, np.random.default_rng(0))
    assert velocity_mps.shape == (1000, 2)
    for axis in range(2):
        drawn = stats.kstest(velocity_mps[:, axis], stats.uniform(-3.0, 6.0).cdf)
        assert drawn.pvalue > 1e-3
    assert abs(np.corrcoef(velocity_mps.T)[0, 1]) < 5 / math.sqrt(1000)


def test_initial_velocity_of_a_team_at_rest_is_zero():
    mission = paper("stationary", num_robots=7)
    velocity_mps = initial_velocity(mission, np.random.default_rng(0))
    np.testing.assert_array_equal(velocity_mps, np.zeros((7, 2)))


def test_who_has_a_cost_says_so():
    assert isinstance(controller_of(paper("stationary")), Controller)
    assert not isinstance(controller_of(paper("stationary")), Costed)
    assert isinstance(controller_of(paper("flocking")), Costed)


@pytest.mark.parametrize(
    ("task", "moves", "flocks"),
    [("stationary", False, False), ("random-walk", True, False), ("flocking", True, True)],
)
def test_missions_say_what_their_task_asks_of_robots(task, moves, flocks):
    mission = paper(task, num_robots=5)
    assert (mission.moves, mission.flocks) == (moves, flocks)
    velocity_mps = initial_velocity(mission, np.random.default_rng(0))
    assert np.any(velocity_mps != 0.0) == moves
    assert isinstance(controller_of(mission), Costed) == flocks
