"""The `VecEnv` of stable-baselines3: agents, seeds, ends, rewards, masks."""

import numpy as np
import pytest
from sb3_contrib import MaskablePPO
from sb3_contrib.common.maskable.utils import get_action_masks, is_masking_supported
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.sb3 import make_vec_env

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


def test_a_models_own_seed_wins():
    env = make_vec_env("stationary", 3, agent="team", seed=1000, **SMALL)
    PPO("MultiInputPolicy", env, seed=7, n_steps=2, batch_size=6)
    env.reset()
    assert [info["seed"] for info in env.reset_infos] == [7, 8, 9]
    env.seed(True)
    with pytest.raises(ValueError, match=r"not \[True, 2, 3\]"):
        env.reset()


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


@pytest.mark.parametrize(("agent", "size"), [("robot", 4), ("team", 16)])
def test_sb3_contrib_gets_the_masks(agent, size):
    far_apart = {**SMALL, "range_ratio": 0.15, "num_windows": 100}
    env = make_vec_env("stationary", 2, agent=agent, seed=1, **far_apart)
    seen = env.reset()
    assert is_masking_supported(env)
    for action in actions(env, 80):
        masks = get_action_masks(env)
        np.testing.assert_array_equal(masks, seen["action_mask"].reshape(env.num_envs, size) == 1)
        seen = env.step(action)[0]
    assert not np.array_equal(env.action_masks(), env.action_masks()[::-1])
    assert np.array_equal(env.env_method("action_masks", indices=[1])[0], env.action_masks()[1])


def test_sb3_contrib_gets_the_masks_of_a_single_environment():
    model = MaskablePPO("MultiInputPolicy", SwarmEnv("stationary", **SMALL), n_steps=8)
    env = model.get_env()
    assert is_masking_supported(env)
    seen = env.reset()
    np.testing.assert_array_equal(get_action_masks(env)[0], seen["action_mask"].ravel() == 1)
    assert model.learn(16).num_timesteps == 16


@pytest.mark.parametrize(
    ("agent", "given", "said"),
    [
        ("robot", "x", r"actions must have shape \(8,\), not \(\)"),
        ("robot", None, r"actions must have shape \(8,\), not \(\)"),
        ("robot", [0, 0], r"actions must have shape \(8,\), not \(2,\)"),
        ("robot", np.zeros((8, 2), dtype=int), r"not \(8, 2\)"),
        ("robot", ["a"] * 8, "action must be integers from 0 to 3, not <U1"),
        ("robot", [0, [1]], "actions must be an array, or lists of the same length"),
        ("team", 5, r"actions must have shape \(2, 4\), not \(\)"),
        ("team", np.zeros((2, 4)), "action must be integers from 0 to 3, not float64"),
    ],
)
def test_actions_of_other_kinds_are_refused(agent, given, said):
    env = make_vec_env("stationary", 2, agent=agent, seed=1, **SMALL)
    env.reset()
    env._actions = given  # `step_async` does no more, and its type is checked in tests only
    with pytest.raises(ValueError, match=said):
        env.step_wait()
    assert env.batches[0].flown.now.tolist() == [0.0, 0.0]


@pytest.mark.parametrize("shape", [(8,), (8, 1)])
def test_actions_may_be_lists_and_wrapped_one_by_one(shape):
    env = make_vec_env("stationary", 2, seed=1, **SMALL)
    env.reset()
    env._actions = np.zeros(shape, dtype=int).tolist()
    env.step_wait()
    env.step(np.zeros(shape, dtype=">i4"))
    assert env.batches[0].flown.now.tolist() == [2.0, 2.0]


def test_what_environments_do_not_have():
    env = make_vec_env(**SMALL)
    with pytest.raises(AttributeError, match="no environment has its own fly"):
        env.env_method("fly")
    with pytest.raises(AttributeError, match="no environment has its own wind"):
        env.set_attr("wind", 3)
    assert not any(env.env_is_wrapped(VecMonitor))
    assert env.get_attr("render_mode") == [None] * 4


def test_masks_before_the_first_reset_are_refused():
    env = make_vec_env(**SMALL)
    with pytest.raises(ValueError, match=r"no mission has begun; call reset\(\) first"):
        env.env_method("action_masks")
