"""Models of stable-baselines3 as policies: they fly as they decide in their environment."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from sb3_contrib import QRDQN, MaskablePPO, RecurrentPPO
from sb3_contrib.common.maskable.evaluation import evaluate_policy
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecNormalize
from torch import nn

import swarm_mj
from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.sb3 import Flown, make_vec_env
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

torch.set_num_threads(1)
SMALL = {"num_robots": 4, "num_windows": 8, "range_ratio": 0.4}
# Not from another file of the tests: where a stored model is loaded, this one is imported alone.
SCANNERS = {
    "robot": str(Path(__file__).parents[2] / "training" / "examples" / "scanner.xml"),
    "pilot": "training.examples.scanning:Scanning",
}


class Rows(BaseFeaturesExtractor):
    """An extractor of a user's own: the rows of all robots, and one's own by its first feature."""

    def __init__(self, space):
        num_robots, width = space["observation"].shape
        super().__init__(space, features_dim=num_robots)
        self.net = nn.Linear(2 * width, 1)

    def forward(self, seen):
        rows = seen["observation"]
        own = rows[torch.arange(len(rows)), rows[..., 0].argmax(dim=1)][:, None].expand_as(rows)
        return self.net(torch.cat([rows, own], dim=2))[..., 0]


def team(num_missions=2, **options):
    return make_vec_env("flocking", num_missions, seed=1, **{**SMALL, **options})


def own_extractor(env):
    kwargs = {"features_extractor_class": Rows, "net_arch": []}
    return MaskablePPO("MultiInputPolicy", env, n_steps=8, seed=1, policy_kwargs=kwargs)


def trained(env, algorithm=MaskablePPO):
    if algorithm is MaskablePPO:
        return own_extractor(env).learn(100)
    return algorithm("MultiInputPolicy", env, n_steps=8, seed=1).learn(100)


def by_environment(env, decide):
    """The mean age of each of the environment's missions, under what `decide` says."""
    ages = []
    seen = env.reset()
    for _ in range(SMALL["num_windows"]):
        seen, _, _, infos = env.step(decide(seen))
        ages.append([info["age_windows"] for info in infos[:: SMALL["num_robots"]]])
    return np.mean(ages, axis=0)


def by_flight(policy, seeds):
    return summarise(rollout(Swarm(policy.mission, seeds), policy)).aoi_mean


@pytest.mark.parametrize("features", ["extended", "paper"])
@pytest.mark.parametrize("normalises", [False, True])
def test_a_flight_is_the_environments_to_the_last_digit(features, normalises):
    """With an extractor of one's own, and averages that only the training knew."""
    env = team(features=features)
    model = trained(VecNormalize(env) if normalises else env)
    unseen = team(3, features=features)
    unseen.seed(3000)
    if normalises:
        unseen = VecNormalize(unseen, training=False, norm_reward=False)
        unseen.obs_rms = model.get_env().obs_rms

    def decide(seen):
        masks = unseen.unwrapped.action_masks()
        return model.predict(seen, action_masks=masks, deterministic=True)[0]

    policy = Flown(model, is_deterministic=True)
    ages = by_environment(unseen, decide)
    np.testing.assert_allclose(by_flight(policy, [3000, 3001, 3002]), ages, rtol=1e-12)
    if normalises:  # the averages matter, so they were used
        plain = Flown(model, is_deterministic=True, normalize=VecNormalize(team(features=features)))
        assert plain.parameters["digest"] != policy.parameters["digest"]


@pytest.mark.parametrize("algorithm", [MaskablePPO, PPO, A2C])
def test_odds_are_those_of_the_model(algorithm):
    model = trained(team(with_parents=algorithm is PPO), algorithm)
    env = team(range_ratio=0.15, num_windows=60, with_parents=algorithm is PPO)
    seen = env.reset()
    policy = Flown(model, env.batches[0].mission)
    num_masked = 0
    for action in np.random.default_rng(3).integers(0, 4, (60, env.num_envs)):
        masks = {"action_masks": env.action_masks()} if algorithm is MaskablePPO else {}
        with torch.no_grad():
            tensors, _ = model.policy.obs_to_tensor(seen)
            expected = model.policy.get_distribution(tensors, **masks).distribution.probs.numpy()
        logits = policy.logits(env.batches[0].graphs)
        np.testing.assert_allclose(np.exp(logits), expected, atol=1e-5)
        num_masked += np.count_nonzero(~env.action_masks())
        seen, *_ = env.step(action)
    assert num_masked > 0


def test_draws_score_what_sb3_finds_on_the_same_missions():
    env = team(40)
    model = own_extractor(env)
    env.seed(3000)
    missions = 40 * SMALL["num_robots"]
    score, _ = evaluate_policy(model, env, missions, deterministic=False, warn=False)
    found = by_flight(Flown(model), range(3000, 3040)).mean()
    silent = SMALL["num_robots"] - 1
    assert found == pytest.approx(-score / SMALL["num_windows"], rel=0.05)
    assert found < 0.9 * silent / SMALL["num_robots"] * (SMALL["num_windows"] + 1) / 2


def test_the_same_seed_is_the_same_mission_whatever_flies_beside_it():
    policy = Flown(trained(team()))
    together = by_flight(policy, [5, 6, 7])
    torch.rand(3)  # draws of others change nothing
    np.testing.assert_array_equal(by_flight(policy, [6])[0], together[1])
    run = swarm_mj.fly(policy.mission, policy=policy, seed=6)
    assert run.summary.aoi_mean == together[1]
    assert len(set(together)) == 3


def test_a_model_that_was_read_back_needs_its_mission(tmp_path):
    model = trained(team(features="paper"))
    model.save(tmp_path / "model.zip")
    read = MaskablePPO.load(tmp_path / "model.zip")
    with pytest.raises(ValueError, match="give the mission"):
        Flown(read)
    mission = Flown(model).mission
    with pytest.raises(ValueError, match=r"sees 8 numbers of each robot, .* extended are 18"):
        Flown(read, mission)
    again = Flown(read, mission, features="paper")
    assert again.parameters["digest"] == Flown(model).parameters["digest"]
    np.testing.assert_array_equal(by_flight(again, [3]), by_flight(Flown(model), [3]))


@pytest.mark.slow
def test_it_flies_by_a_name_of_ones_own_from_the_command_line(here, forks):
    trained(team()).save("model.zip")
    (here / "own.py").write_text(
        "from sb3_contrib import MaskablePPO\n"
        "from swarm_mj.envs.sb3 import Flown\n"
        "def mine(mission):\n"
        "    return Flown(MaskablePPO.load('model.zip'), mission)\n"
    )
    mission = ("--task", "flocking", "--robots", 4, "--windows", 5)
    done = forks.run(here, "swarm_mj", "fly", "--policy", "own:mine", *mission)
    assert (done.returncode, done.stderr) == (0, "")
    many = ("evaluate", "--policy", "own:mine", "tdma", "--episodes", 2, "--jobs", 1)
    done = forks.run(here, "swarm_mj", *many, *mission)
    assert done.returncode == 0, done.stderr
    done = forks.run(here, "swarm_mj", "fly", "--policy", "own:mine", "--robots", 5)
    assert done.returncode == 2
    assert "flies teams of 4 robots, for which it was trained, not 5" in done.stderr


def test_features_of_a_users_own_are_named():
    own = "swarm_mj.policies.gnn.graphs:PaperFeatures"
    policy = Flown(trained(team(features=own)))
    assert policy.parameters["features"] == own
    assert by_flight(policy, [1]).shape == (1,)


def test_dqn_takes_its_best_recipient():
    env = team()
    model = DQN("MultiInputPolicy", env, buffer_size=99)
    policy = Flown(model)
    seen = env.reset()
    best, _ = model.predict(seen, deterministic=True)
    Swarm(policy.mission, [1, 2]).start(policy)
    np.testing.assert_array_equal(policy.recipients(env.batches[0].flown.views).ravel(), best)


def test_it_changes_as_its_model_learns():
    model = trained(team())
    policy = Flown(model)
    before = policy.parameters["digest"]
    model.learn(100)
    assert policy.parameters["digest"] != before


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PPO("MultiInputPolicy", SwarmEnv(**SMALL)), "trained on another environment"),
        (lambda: PPO("MlpPolicy", "CartPole-v1"), "trained on another environment"),
        (lambda: PPO("MultiInputPolicy", team(agent="team")), "decides for one robot"),
        (lambda: PPO("MultiInputPolicy", team(with_sensors=True, **SCANNERS)), "sees sensors, too"),
        (lambda: RecurrentPPO("MultiInputLstmPolicy", team()), "RecurrentPPO remembers what it"),
        (lambda: QRDQN("MultiInputPolicy", team(), buffer_size=9), "QRDQN has neither"),
    ],
)
def test_models_that_cannot_fly(make, message):
    with pytest.raises(ValueError, match=message):
        Flown(make(), swarm_mj.paper("flocking", num_robots=4))


def test_another_team_is_refused():
    policy = Flown(trained(team()))
    larger = replace(policy.mission, num_robots=5)
    with pytest.raises(ValueError, match="choose num_robots=4"):
        Swarm(larger, [1]).start(policy)
    with pytest.raises(ValueError, match="choose num_robots=4"):
        Flown(trained(team()), larger)
