"""The `VecEnv` of stable-baselines3, and what sb3-contrib learns on it."""

from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from sb3_contrib import MaskablePPO, RecurrentPPO
from scanners import SCANNERS
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.torch_layers import CombinedExtractor
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize
from torch import nn

from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.sb3 import make_vec_env, save_policy
from swarm_mj.policies.registry import make_policy

torch.set_num_threads(1)
SMALL = {"num_robots": 4, "num_windows": 6, "range_ratio": 0.4}


def mean_age(model):
    """Of the first windows of missions that training does not see."""
    env = make_vec_env("stationary", 8, seed=0, num_robots=5, num_windows=100)
    seen, ages = env.reset(), []
    for _ in range(100):
        action, _ = model.predict(seen, action_masks=env.action_masks())
        seen, _, _, infos = env.step(action)
        ages.append(np.mean([info["age_windows"] for info in infos]))
    return np.mean(ages)


@pytest.mark.slow
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
        ({"num_envs": 3}, "has no 'num_envs'; did you mean num_missions"),
        ({"n_envs": 3}, "has no 'n_envs'; did you mean num_missions"),
        ({"render_mode": "rgb_array"}, r"has no 'render_mode', .*Flown\(model\)"),
    ],
)
def test_refusals(options, message):
    with pytest.raises((ValueError, TypeError), match=message):
        make_vec_env(**options)


# A trained network as a policy.


def trained(algorithm=MaskablePPO, env=None, **options):
    env = env or make_vec_env("stationary", 2, seed=1, **SMALL)
    policy = options.pop("policy", "MultiInputPolicy")
    return algorithm(policy, env, n_steps=8, seed=1, **options).learn(64)


@pytest.mark.parametrize(("algorithm", "net_arch"), [(MaskablePPO, [16, 8]), (A2C, [8]), (PPO, [])])
def test_a_stored_actor_decides_as_the_trained_one(tmp_path, algorithm, net_arch):
    activation = nn.ReLU if net_arch == [8] else nn.Tanh
    kwargs = {"net_arch": net_arch, "activation_fn": activation}
    model = trained(algorithm, policy_kwargs=kwargs)
    save_policy(model, tmp_path / "policy")
    env = make_vec_env("stationary", 2, seed=7, **SMALL)
    env.reset()
    policy = make_policy(str(tmp_path / "policy"), env.batches[0].mission)
    for action in np.random.default_rng(3).integers(0, 4, (5, env.num_envs)):
        seen, *_ = env.step(action)
        masks = {"action_masks": env.action_masks()} if algorithm is MaskablePPO else {}
        with torch.no_grad():
            tensors = {name: torch.as_tensor(each) for name, each in seen.items()}
            expected = model.policy.get_distribution(tensors, **masks).distribution.probs.numpy()
        logits = policy.logits(env.batches[0].graphs).reshape(2, 4, 4)
        odds = np.exp(logits - logits.max(axis=2, keepdims=True))
        found = (odds / odds.sum(axis=2, keepdims=True)).reshape(expected.shape)
        np.testing.assert_allclose(found, expected, atol=1e-5)


@pytest.mark.slow
def test_a_stored_actor_flies_from_the_command_line(here, forks):
    model = trained(env=VecMonitor(make_vec_env("stationary", 2, seed=1, **SMALL)))
    save_policy(model, "runs/sb3")
    mission = ("--task", "stationary", "--robots", 4, "--windows", 20)
    done = forks.run(here, "swarm_mj", "fly", "--policy", "runs/sb3", *mission, "--no-record")
    assert (done.returncode, done.stderr) == (0, "")
    many = ("--policy", "runs/sb3", "tdma", "--episodes", 2, "--jobs", 1)
    done = forks.run(here, "swarm_mj", "evaluate", *many, *mission, "--csv", "e.csv")
    assert done.returncode == 0, done.stderr
    assert "runs/sb3" in (here / "e.csv").read_text()
    done = forks.run(here, "swarm_mj", "fly", "--policy", "runs/sb3", "--robots", 5)
    assert done.returncode == 2
    assert "flies teams of 4 robots" in done.stderr


def test_an_actor_that_sees_by_ones_own_features_flies_if_they_are_named(here, forks):
    own = "swarm_mj.policies.gnn.graphs:PaperFeatures"
    model = trained(env=make_vec_env("stationary", 2, seed=1, features=own, **SMALL))
    assert save_policy(model, "own") == Path("own.safetensors")
    fly = ("fly", "--policy", "own", "--task", "stationary", "--robots", 4, "--windows", 5)
    done = forks.run(here, "swarm_mj", *fly, "--no-record")
    assert done.returncode == 2
    assert done.stderr.rstrip().endswith(f"if you trust that code, add --features {own}")
    done = forks.run(here, "swarm_mj", *fly, "--no-record", "--features", own)
    assert (done.returncode, done.stderr) == (0, "")
    with safe_open("own.safetensors", "numpy") as file:
        assert f"--robots 4 --features {own}" in file.metadata()["swarm_mj policy"]


def test_a_model_read_back_is_stored_with_its_environment(tmp_path):
    model = trained(PPO)
    model.save(tmp_path / "model.zip")
    with pytest.raises(ValueError, match=r"load the model with it"):
        save_policy(PPO.load(tmp_path / "model.zip"), tmp_path / "policy")
    # Normalised rewards are no part of a policy.
    env = VecNormalize(make_vec_env("stationary", 1, **SMALL), norm_obs=False)
    save_policy(PPO.load(tmp_path / "model.zip", env=env), tmp_path / "policy")
    assert (tmp_path / "policy.safetensors").exists()


class Halved(CombinedExtractor):
    def forward(self, observations):
        return 0.5 * super().forward(observations)


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (
            lambda: DQN("MultiInputPolicy", make_vec_env(**SMALL), buffer_size=9),
            r"DQN has none; .*Flown\(model\)",
        ),
        (lambda: PPO("MultiInputPolicy", SwarmEnv(**SMALL)), "trained on another environment"),
        (lambda: trained(PPO, make_vec_env(agent="team", **SMALL)), "decides for one robot"),
        (
            lambda: trained(PPO, make_vec_env(with_parents=True, **SMALL)),
            r"sees no parents; .*Flown\(model\)",
        ),
        (
            lambda: trained(PPO, make_vec_env(with_sensors=True, **SCANNERS, **SMALL)),
            "this model sees sensors, too; fly it in its environment, or train without",
        ),
        (
            lambda: trained(PPO, VecNormalize(make_vec_env(**SMALL))),
            r"norm_obs=False\), or .*Flown\(model\)",
        ),
        (
            lambda: trained(PPO, policy_kwargs={"features_extractor_class": Halved}),
            r"own features extractor; .*Flown\(model\)",
        ),
        (lambda: trained(PPO, policy_kwargs={"activation_fn": nn.ELU}), "tanh, relu, not ELU"),
        (
            lambda: trained(RecurrentPPO, policy="MultiInputLstmPolicy"),
            "RecurrentMultiInputActorCriticPolicy's lstm_actor",
        ),
    ],
)
def test_models_that_no_policy_can_be_made_of(tmp_path, model, message):
    with pytest.raises(ValueError, match=message):
        save_policy(model(), tmp_path / "policy")
    assert not list(tmp_path.glob("policy*"))
