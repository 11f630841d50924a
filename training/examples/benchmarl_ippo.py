"""Independent PPO by BenchMARL on the PettingZoo face, through TorchRL.

    pip install swarm_mj pettingzoo benchmarl
    python training/examples/benchmarl_ippo.py

Prints the mean age of information in BenchMARL's evaluations; lower is better.
"""

import tempfile
from collections.abc import Callable
from typing import Any

from benchmarl.algorithms import IppoConfig
from benchmarl.environments.pettingzoo.common import PettingZooClass
from benchmarl.experiment import Callback, Experiment, ExperimentConfig
from benchmarl.models.mlp import MlpConfig
from torch import nn
from torchrl.envs import EnvBase, FlattenObservation, PettingZooWrapper, TransformedEnv

from swarm_mj.envs.pettingzoo import parallel_env

NUM_WINDOWS, NUM_ITERATIONS, WINDOWS_PER_BATCH = 100, 11, 500
SEEN = ("robots", "observation", "observation")


class SwarmClass(PettingZooClass):
    """The missions of one config, as options of `parallel_env`."""

    def get_env_fun(
        self, num_envs: int, continuous_actions: bool, seed: int | None, device: str
    ) -> Callable[[], EnvBase]:
        """Return a function that makes an environment, as BenchMARL asks for it."""
        del num_envs, continuous_actions
        options = dict(self.config)

        def make() -> EnvBase:
            mission = parallel_env(**options)
            env = PettingZooWrapper(
                mission,
                categorical_actions=True,
                group_map={"robots": mission.possible_agents},
                seed=seed,
                device=device,
            )
            return TransformedEnv(env, FlattenObservation(-2, -1, in_keys=[SEEN]))

        return make

    def supports_continuous_actions(self) -> bool:
        """Recipients are numbers."""
        return False

    def supports_discrete_actions(self) -> bool:
        """Recipients are numbers."""
        return True

    def has_state(self) -> bool:
        """No agent sees the whole state."""
        return False

    def has_render(self, env: EnvBase) -> bool:  # noqa: ARG002
        """Nothing is rendered."""
        return False

    def max_steps(self, env: EnvBase) -> int:  # noqa: ARG002
        """Return a mission's windows."""
        return self.config["num_windows"]

    @staticmethod
    def env_name() -> str:
        """Return the name under which BenchMARL logs."""
        return "swarm_mj"


class Ages(Callback):
    """Print what evaluations cost."""

    def on_evaluation_end(self, rollouts: list[Any]) -> None:
        """Return the age of information of the missions flown [windows]."""
        ages = [each["next", "robots", "info", "age_windows"].mean().item() for each in rollouts]
        print(f"{sum(ages) / len(ages):.1f} windows old")


def main() -> None:
    """Train for a few minutes; `credit` pays every robot for what its own packet changed."""
    config = {
        "mission": "stationary",
        "num_robots": 5,
        "num_windows": NUM_WINDOWS,
        "reward": "credit",
    }
    experiment = ExperimentConfig.get_from_yaml()
    experiment.gamma, experiment.lr = 0.0, 1e-3
    experiment.max_n_iters = NUM_ITERATIONS
    experiment.on_policy_collected_frames_per_batch = WINDOWS_PER_BATCH
    experiment.on_policy_n_envs_per_worker = 1
    experiment.on_policy_n_minibatch_iters, experiment.on_policy_minibatch_size = 4, 100
    experiment.evaluation_interval = 10 * WINDOWS_PER_BATCH
    experiment.evaluation_episodes, experiment.evaluation_deterministic_actions = 5, False
    experiment.render, experiment.loggers = False, []
    network = MlpConfig(num_cells=[64], layer_class=nn.Linear, activation_class=nn.Tanh)
    with tempfile.TemporaryDirectory() as folder:
        experiment.save_folder = folder
        Experiment(
            task=SwarmClass("STATIONARY", config),
            algorithm_config=IppoConfig.get_from_yaml(),
            model_config=network,
            critic_model_config=network,
            seed=0,
            config=experiment,
            callbacks=[Ages()],
        ).run()


if __name__ == "__main__":
    main()
