"""The truth that a centralised critic may see, against a swarm flown beside it."""

import math
import warnings
from typing import Any

import numpy as np
import pytest
from pettingzoo.test.state_test import state_test
from pettingzoo.utils import parallel_to_aec

from swarm_mj.envs.options import make_batch, truth
from swarm_mj.envs.pettingzoo import parallel_env
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm

SMALL = {"num_robots": 4, "num_windows": 10, "range_ratio": 0.4}


def flown(num_windows, **options):
    batch = make_batch("random-walk", 2, **SMALL, **options)
    batch.restart([5, 6])
    swarm = Swarm(paper("random-walk", **SMALL, **options), [5, 6])
    for recipient in np.random.default_rng(1).integers(0, 4, (num_windows, 2, 4)):
        batch.step(recipient)
        swarm.step_with_recipients(recipient)
    return truth(batch), swarm


def test_it_is_where_robots_are_and_how_old_what_they_know_is():
    seen, swarm = flown(6, failure_fraction=0.25)
    mission, states = swarm.mission, swarm.states
    is_on = np.asarray(states.is_active)
    assert np.all(seen[:, 0] == np.float32(0.6))  # of the mission is flown
    for b in (0, 1):
        for i in range(4):
            x, y, vx, vy, is_active, *ages = seen[b, 1 + 9 * i : 10 + 9 * i]
            where = np.array([x, y]) * mission.side_m / 2.0
            np.testing.assert_allclose(where, states.position_m[b, i], rtol=1e-5)
            speed = np.array([vx, vy]) * mission.max_velocity_mps
            np.testing.assert_allclose(speed, states.velocity_mps[b, i], rtol=1e-5)
            assert is_active == is_on[b, i]
            for j in range(4):
                then = swarm.buffers.timestamp[b, i, j]
                age = math.log(1.0 + 6.0 - then) / math.log(501.0) if then > 0.0 else 1.0
                assert ages[j] == pytest.approx(age, abs=1e-6)
    assert np.any(is_on == 0)


def test_what_all_were_granted_at_the_start_has_an_age():
    seen, _ = flown(2, prior_knowledge="start")
    assert np.all(seen[:, 6:10] <= math.log(3.0) / math.log(501.0) + 1e-6)


@pytest.mark.parametrize("task", ["stationary", "flocking"])
def test_pettingzoos_own_check_of_the_state(task):
    env: Any = parallel_env(task, **SMALL, failure_fraction=0.25)
    whole: Any = parallel_env(task, **SMALL)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        state_test(parallel_to_aec(whole), env)


def test_no_robot_observes_it():
    env: Any = parallel_env(**SMALL)
    env.reset(seed=1)
    view = env.observation_space("robot_0")
    assert sorted(view) == ["action_mask", "observation"]
    assert list(env.observation_spaces) == list(env.action_spaces) == env.possible_agents
    for agent in env.possible_agents:  # one object each, as PettingZoo seeds them one by one
        assert env.observation_spaces[agent] is env.observation_space(agent)
        assert env.action_spaces[agent] is env.action_space(agent)
