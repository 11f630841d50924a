import warnings

import numpy as np
import pytest
import supersuit
from gymnasium import spaces
from pettingzoo.test import parallel_api_test, parallel_seed_test
from scanners import SCANNERS
from stable_baselines3 import PPO

from swarm_mj.envs.pettingzoo import parallel_env
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm

SMALL = {"num_robots": 6, "num_windows": 12, "range_ratio": 0.4}
FAILING = {**SMALL, "failure_fraction": 0.3}  # 2 of 6, at the start of the 7th window


@pytest.mark.parametrize(
    "options",
    [
        SMALL,
        {**FAILING, "with_parents": True},
        {**FAILING, "reward": "credit"},
        {**FAILING, **SCANNERS, "with_sensors": True},
    ],
)
def test_pettingzoos_own_checks(options):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        parallel_api_test(parallel_env(**options), num_cycles=30)
        parallel_seed_test(lambda: parallel_env(**options), num_cycles=5)


def test_robots_that_fail_drop_out():
    env, swarm = parallel_env(**FAILING), Swarm(paper("flocking", **FAILING), [2])
    env.reset(seed=2)
    for window in range(12):
        before = list(env.agents)
        seen, rewards, ended, cut, infos = env.step({agent: 0 for agent in env.agents})
        swarm.step_with_recipients(np.zeros((1, 6), dtype=int))
        for answer in (seen, rewards, ended, cut, infos):
            assert list(answer) == before
        fails = [agent for agent in before if ended[agent]]
        assert len(fails) == (2 if window == 6 else 0)
        assert set(cut.values()) == {window == 11}
        if window >= 6:
            alive = [f"robot_{i}" for i in np.flatnonzero(swarm.states.is_active[0])]
            assert env.agents == ([] if window == 11 else alive)
            for agent in fails:  # who may only be silent
                assert np.flatnonzero(seen[agent]["action_mask"]) == [int(agent[6:])]


def test_each_agent_sees_and_is_paid_its_own():
    env = parallel_env("stationary", reward="credit", **SMALL)
    seen, _ = env.reset(seed=2)
    oneself = 0  # the first of the extended features
    for i, agent in enumerate(env.agents):
        assert np.flatnonzero(seen[agent]["observation"][:, oneself]) == [i]
    rewards = env.step({agent: 1 if agent == "robot_0" else i for i, agent in enumerate(seen)})[1]
    assert [agent for agent, reward in rewards.items() if reward != 0.0] == ["robot_0"]


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        ({"robot_6": 1}, "agents are robot_0 to robot_5, not 'robot_6'"),
        ({"robot_0": 1, "robot_3": None}, "must be integers from 0 to 5, not object"),
        ({"robot_0": 0, "robot_2": 1.0}, "must be integers from 0 to 5, not float"),
        ({"robot_0": 0, "robot_2": np.float32(1.7)}, "must be integers from 0 to 5, not float"),
    ],
)
def test_refused_actions_move_nothing(actions, message):
    env = parallel_env(**SMALL)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(actions)
    assert env.batch.flown.now[0] == 0


def test_nothing_flies_on_when_nobody_is_left():
    env = parallel_env(**SMALL)
    with pytest.raises(ValueError, match="call reset"):
        env.step({})
    env.reset(seed=0)
    while env.agents:
        env.step({})
    assert env.step({"robot_0": 1}) == ({}, {}, {}, {}, {})
    assert env.batch.flown.now[0] == 12.0


def test_supersuits_black_death_trains_where_robots_fail():
    env = supersuit.observation_lambda_v0(
        parallel_env(**FAILING),
        lambda seen, _: seen["observation"],
        lambda space: space["observation"],
    )
    env = supersuit.black_death_v3(env)
    assert isinstance(env.observation_space("robot_0"), spaces.Box)
    env = supersuit.pettingzoo_env_to_vec_env_v1(env)
    env = supersuit.concat_vec_envs_v1(env, 2, base_class="stable_baselines3")
    model = PPO("MlpPolicy", env, n_steps=8, batch_size=48, n_epochs=1)
    assert model.learn(200).num_timesteps >= 200
