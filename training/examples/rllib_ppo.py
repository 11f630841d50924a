"""PPO by RLlib on the PettingZoo face: train, save, load, decide. RLlib needs Gymnasium 1.2.

    pip install swarm_mj pettingzoo torch "ray[rllib]" gymnasium==1.2.2
    python training/examples/rllib_ppo.py

Prints the mean age of information on missions that are not trained on; lower is better.
"""

import tempfile
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from ray.rllib.algorithms.algorithm import Algorithm
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module import RLModule
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

from swarm_mj.envs.pettingzoo import SwarmParallelEnv, parallel_env

NUM_ROBOTS, NUM_WINDOWS, NUM_ITERATIONS = 5, 100, 20
SHARED = "robot"  # the one network that all robots have


def make_mission(reward: str) -> SwarmParallelEnv:
    """Make a stationary team; `credit` rewards each robot for its own packet."""
    return parallel_env("stationary", num_robots=NUM_ROBOTS, num_windows=NUM_WINDOWS, reward=reward)


class FlatEnv(ParallelPettingZooEnv):
    """An environment that shows what robots know as one row, which RLlib's own networks take."""

    def __init__(self, _config: dict[str, Any]) -> None:
        """Make the missions that are trained on."""
        super().__init__(make_mission("credit"))
        seen = {agent: flat_space(self.par_env, agent) for agent in self.par_env.possible_agents}
        self.observation_space = spaces.Dict(seen)

    def reset(self, **options: Any) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Return what RLlib expects."""
        seen, infos = super().reset(**options)
        return flat(seen), infos

    def step(self, action_dict: dict[str, Any]) -> tuple[dict[str, np.ndarray], Any, Any, Any, Any]:
        """Return what RLlib expects."""
        seen, *others = super().step(action_dict)
        return flat(seen), *others


def flat_space(mission: SwarmParallelEnv, agent: str) -> spaces.Space:
    """Flatten what a robot knows of its teammates."""
    return spaces.flatten_space(mission.observation_space(agent)["observation"])


def flat(seen: dict[str, Any]) -> dict[str, np.ndarray]:
    """Return what a robot knows as `flat_space` has it."""
    return {agent: each["observation"].ravel() for agent, each in seen.items()}


def mean_age(module: RLModule, num_missions: int = 5) -> float:
    """Return the age of information, which is minus the reward `aoi` [windows]."""
    mission, ages = make_mission("aoi"), []
    for seed in range(num_missions):
        seen, _ = mission.reset(seed=seed)
        while mission.agents:
            rows = torch.as_tensor(np.stack(list(flat(seen).values())))
            logits = module.forward_inference({"obs": rows})["action_dist_inputs"]
            chosen = torch.distributions.Categorical(logits=logits).sample().tolist()
            seen, rewards, *_ = mission.step(dict(zip(mission.agents, chosen, strict=True)))
            ages.append(-rewards["robot_0"])
    return float(np.mean(ages))


def main() -> None:
    """Train for about a minute."""
    register_env("swarm", FlatEnv)
    config = (
        PPOConfig()
        .environment("swarm")
        .env_runners(num_env_runners=0)
        .multi_agent(policies={SHARED}, policy_mapping_fn=lambda *_, **__: SHARED)
        .training(gamma=0.0, lr=1e-3, train_batch_size=1000, minibatch_size=500, num_epochs=4)
        .debugging(seed=0)
    )
    algorithm = config.build_algo()
    print(f"before: {mean_age(algorithm.get_module(SHARED)):.1f} windows old")
    for n in range(1, NUM_ITERATIONS + 1):
        algorithm.train()
        if n % 5 == 0:
            print(f"after {n} iterations: {mean_age(algorithm.get_module(SHARED)):.1f} windows old")
    with tempfile.TemporaryDirectory() as folder:
        algorithm.save_to_path(folder)
        algorithm.stop()
        loaded = Algorithm.from_checkpoint(folder)
    print(f"loaded: {mean_age(loaded.get_module(SHARED)):.1f} windows old")
    loaded.stop()


if __name__ == "__main__":
    main()
