"""The `VecEnv` of stable-baselines3, and what sb3-contrib learns on it."""

import numpy as np
import pytest
import torch
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported
from stable_baselines3 import A2C
from stable_baselines3.common.vec_env import VecMonitor

from swarm_mj.envs.sb3 import make_vec_env

torch.set_num_threads(1)
SMALL = {"num_robots": 4, "num_windows": 6, "range_ratio": 0.4}


def actions(env, num_steps):
    env.action_space.seed(3)
    return [
        np.array([env.action_space.sample() for _ in range(env.num_envs)]) for _ in range(num_steps)
    ]


@pytest.mark.parametrize(("agent", "num_envs", "seen"), [("robot", 12, (4,)), ("team", 3, (4, 4))])
def test_environments_are_robots_or_teams(agent, num_envs, seen):
    env = make_vec_env("stationary", 3, agent=agent, seed=1, **SMALL)
    assert env.num_envs == num_envs
    assert env.reset()["action_mask"].shape == (num_envs, *seen)
    assert env.observation_space["action_mask"].shape == seen
    assert [info["seed"] for info in env.reset_infos] == [
        b for b in (1, 2, 3) for _ in range(num_envs // 3)
    ]


def test_after_the_last_window_another_mission_begins():
    env = make_vec_env("random-walk", 2, seed=1, **SMALL)
    first = env.reset()
    for window, action in enumerate(actions(env, 12), start=1):
        seen, _, done, infos = env.step(action)
        assert np.all(done) == np.any(done) == (window % 6 == 0)
        if window % 6 == 0:
            for n, info in enumerate(infos):
                assert info["TimeLimit.truncated"]
                last = info["terminal_observation"]["observation"]
                assert not np.array_equal(last, seen["observation"][n])
            assert np.all(seen["observation"][:, :, 1].sum(axis=1) == 1)  # knows but itself
        else:
            assert "terminal_observation" not in infos[0]
    env.seed(1)
    np.testing.assert_array_equal(env.reset()["observation"], first["observation"])


def test_rewards_are_each_robots_own():
    env = make_vec_env("stationary", 2, reward="credit", seed=1, **SMALL)
    env.reset()
    silence = np.tile(np.arange(4), 2)
    spoken = silence.copy()
    spoken[5] = 0  # robot 1 of the second mission
    reward = env.step(spoken)[1]
    assert np.flatnonzero(reward).tolist() == [5]


@pytest.mark.parametrize(("agent", "size"), [("robot", 4), ("team", 16)])
def test_sb3_contrib_gets_the_masks(agent, size):
    env = make_vec_env("stationary", 2, agent=agent, seed=1, **{**SMALL, "range_ratio": 0.15})
    seen = env.reset()
    assert is_masking_supported(env)
    for action in actions(env, 5):
        masks = get_action_masks(env)
        np.testing.assert_array_equal(masks, seen["action_mask"].reshape(env.num_envs, size) == 1)
        seen = env.step(action)[0]
    assert np.array_equal(env.env_method("action_masks", indices=[1])[0], env.action_masks()[1])


@pytest.mark.parametrize("agent", ["robot", "team"])
def test_plain_algorithms_train(agent):
    env = VecMonitor(make_vec_env("flocking", 2, agent=agent, **SMALL))
    model = A2C("MultiInputPolicy", env, seed=1).learn(100)
    assert model.num_timesteps >= 100
    assert model.ep_info_buffer  # a mission's length and reward


def mean_age(model):
    """Of the first windows of missions that training does not see."""
    env = make_vec_env("stationary", 8, seed=0, num_robots=5, num_windows=100)
    seen, ages = env.reset(), []
    for _ in range(100):
        action, _ = model.predict(seen, action_masks=env.action_masks())
        seen, _, _, infos = env.step(action)
        ages.append(np.mean([info["age_windows"] for info in infos]))
    return np.mean(ages)


def test_maskable_ppo_learns():
    """From radio silence by collisions, 15 windows old, to 5; who never talks is 40 windows old."""
    env = make_vec_env("stationary", 8, reward="credit", num_robots=5, num_windows=100)
    model = MaskablePPO(
        "MultiInputPolicy",
        env,
        n_steps=32,
        batch_size=256,
        n_epochs=4,
        gamma=0.0,
        learning_rate=1e-3,
        policy_kwargs={"net_arch": [32, 32]},
        seed=0,
    )
    before = mean_age(model)
    assert mean_age(model.learn(20_000)) < 0.5 * before


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"agent": "mission"}, "agent must be one of robot, team, not 'mission'"),
        ({"agent": "team", "reward": "credit"}, "choose reward aoi"),
        ({"reward": "age"}, "reward must be one of"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(ValueError, match=message):
        make_vec_env(**options)


def test_what_environments_do_not_have():
    env = make_vec_env(**SMALL)
    with pytest.raises(AttributeError, match="no environment has its own fly"):
        env.env_method("fly")
    with pytest.raises(AttributeError, match="no environment has its own wind"):
        env.set_attr("wind", 3)
    assert not any(env.env_is_wrapped(VecMonitor))
    assert env.get_attr("render_mode") == [None] * 4
