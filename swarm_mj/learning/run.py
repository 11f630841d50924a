"""A training run (III-C): stable-baselines3's PPO, from empty folder to stored policy.

A run's folder holds `settings.json`, `checkpoint.pt`, `curve.csv` (one row an evaluation),
`tensorboard/`, `policy/` (the best so far) and, on request, `replays/`.
"""

import json
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import DictRolloutBuffer
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from swarm_mj.gnn import AggregationGnn
from swarm_mj.learning import checkpoint
from swarm_mj.learning.actor_critic import GnnActorCritic, TeamActorCritic
from swarm_mj.learning.checkpoint import Progress, missions_of
from swarm_mj.learning.missions import make_groups
from swarm_mj.learning.robot_env import RobotEnv
from swarm_mj.learning.session import CHECKPOINT, SETTINGS, Limits, Listener, Session, Stopped
from swarm_mj.learning.settings import Training
from swarm_mj.learning.speakers import SpeakersBuffer
from swarm_mj.learning.team_env import TeamEnv
from swarm_mj.whole_file import whole_file

TENSORBOARD = "tensorboard"
NO_BUDGET = 10**15  # team decisions


def make_model(training: Training) -> tuple[PPO, np.random.Generator]:
    """PPO over fresh missions, and the generator that draws their seeds.

    Raises:
        ValueError: The missions cannot be made of these settings.
    """
    torch.set_num_threads(training.threads)
    rng = np.random.default_rng(training.seed)
    groups = make_groups(
        training.mission,
        training.robots,
        training.features,
        training.missions,
        training.groups,
        rng,
    )
    ppo = training.ppo
    env: VecEnv = RobotEnv(groups) if training.arm == "robot" else TeamEnv(groups, training.reward)
    num_rows = env.num_envs * ppo.num_steps
    if training.reward == "velocity-variance":  # as in the authors' code
        env = VecNormalize(env, norm_obs=False, norm_reward=True, gamma=ppo.discount)
    decay = StepDecay(training)
    model = PPO(
        GnnActorCritic if training.arm == "robot" else TeamActorCritic,
        env,
        learning_rate=decay,
        n_steps=ppo.num_steps,
        batch_size=-(-num_rows // ppo.num_minibatches),
        n_epochs=ppo.num_epochs,
        gamma=ppo.discount,
        gae_lambda=ppo.gae_lambda,
        clip_range=ppo.clip,
        clip_range_vf=ppo.clip if ppo.clips_value else None,
        ent_coef=ppo.entropy,
        vf_coef=ppo.value,
        max_grad_norm=ppo.max_gradient_norm,
        seed=training.seed % 2**32,
        normalize_advantage=not training.drops_silence,
        rollout_buffer_class=SpeakersBuffer if training.drops_silence else DictRolloutBuffer,
        policy_kwargs={
            "shape": training.network,
            "shares_trunk": training.shares_trunk,
            "silence_logit": training.silence_logit,
            "optimizer_kwargs": {"eps": ppo.adam_epsilon},
            **({} if training.arm == "robot" else {"sums_nodes": training.sums_nodes}),
        },
    )
    decay.model = model
    return model, rng


class StepDecay:
    """The learning rate, falling by a factor in each of so many optimiser steps (III-C)."""

    def __init__(self, training: Training) -> None:
        """Begins at the settings' rate."""
        self._ppo = training.ppo
        self.model: PPO | None = None

    def __call__(self, remaining: float) -> float:  # noqa: ARG002 - the budget does not matter
        """The rate of the coming optimiser steps."""
        num_updates = 0 if self.model is None else self.model._n_updates  # epochs so far
        num_steps = num_updates * self._ppo.num_minibatches
        return self._ppo.learning_rate * self._ppo.decay ** (num_steps // self._ppo.decay_steps)


def train(
    training: Training,
    folder: Path,
    limits: Limits,
    *,
    listener: Listener,
    init: AggregationGnn | None = None,
    is_resumed: bool = False,
    command: str = "",
) -> Progress:
    """Trains until a limit, or until the listener has had enough.

    Args:
        training: The settings.
        folder: The run's folder; made if it is not there.
        limits: When to stop.
        listener: Told how it goes.
        init: A network of the same shape to begin with.
        is_resumed: Go on from the folder's checkpoint, if it got as far as one.
        command: Noted beside the policy.

    Returns:
        Where the run stands.

    Raises:
        ValueError: The missions cannot be made, or the checkpoint is damaged or foreign.
        OSError: The folder cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with whole_file(folder / SETTINGS) as part:
        part.write_text(json.dumps(training.to_json(), indent=2) + "\n", encoding="utf-8")
    model, rng = make_model(training)
    model.set_logger(configure(str(folder / TENSORBOARD), ["tensorboard"]))
    if init is not None:
        assert isinstance(model.policy, GnnActorCritic)
        model.policy.take_acting_network(init)
    kept = folder / CHECKPOINT
    progress = checkpoint.load(kept, model, rng) if is_resumed and kept.exists() else Progress()
    session = Session(training, folder, limits, progress, rng, listener, command)
    num_teams, num_envs = missions_of(model).num_teams, missions_of(model).num_envs
    wanted = -(-(limits.decisions or NO_BUDGET) // num_teams) * num_envs
    try:
        if wanted > model.num_timesteps:
            model.learn(
                wanted - model.num_timesteps,
                callback=session,
                log_interval=NO_BUDGET,  # the session dumps, with team decisions on the axis
                reset_num_timesteps=model.num_timesteps == 0,
            )
            session.finish()
    except Stopped:
        pass
    return progress
