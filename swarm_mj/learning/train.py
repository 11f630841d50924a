"""The PPO run (III-C): stable-baselines3's loop, from empty folder to stored policy.

A run's folder holds `settings.json`, `checkpoint.pt`, `curve.csv` (one row an evaluation),
`tensorboard/`, `policy.safetensors` (the one that is kept), `init.safetensors` (the one it began
with, if any) and, on request, `replays/`.
"""

import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import DictRolloutBuffer
from stable_baselines3.common.logger import configure
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from swarm_mj.learning import checkpoint
from swarm_mj.learning.active_rollout_buffer import ActiveRolloutBuffer
from swarm_mj.learning.actor_critic import GnnActorCritic
from swarm_mj.learning.callback import Stopped, TrainingCallback
from swarm_mj.learning.graph_vec_env import GraphVecEnv, env_of
from swarm_mj.learning.run_folder import (
    CHECKPOINT,
    CURVE,
    INIT,
    SETTINGS,
    TENSORBOARD,
    Limits,
    Listener,
    Progress,
    TrainingRun,
    check_begun,
    check_new,
    write_curve,
    write_run,
)
from swarm_mj.learning.settings import PpoSettings, Training
from swarm_mj.policies.stored import read_policy, save_policy
from swarm_mj.system.outputs import owned

NO_BUDGET = 10**15  # team decisions


def make_model(training: Training) -> tuple[PPO, np.random.Generator]:
    """Make PPO over fresh missions (III-C), and the generator that draws their seeds.

    Raises:
        ValueError: The missions or the minibatches cannot be made of these settings.
    """
    torch.set_num_threads(training.threads)
    rng, ppo = np.random.default_rng(training.seed), training.ppo
    inner = GraphVecEnv(training, rng)
    env: VecEnv = inner
    if training.reward == "velocity-variance":  # as in the authors' code
        env = VecNormalize(inner, norm_obs=False, norm_reward=True, gamma=ppo.discount)
    drops = training.drops_silence
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "You have specified a mini-batch size")  # one is smaller
        model = PPO(
            GnnActorCritic,
            env,
            learning_rate=ppo.learning_rate,
            n_steps=ppo.num_steps,
            batch_size=_batch_size(training, env.num_envs),
            n_epochs=ppo.num_epochs,
            gamma=ppo.discount,
            gae_lambda=ppo.gae_lambda,
            clip_range=ppo.clip,
            clip_range_vf=ppo.clip if ppo.clips_value else None,
            ent_coef=ppo.entropy,
            vf_coef=ppo.value,
            max_grad_norm=ppo.max_gradient_norm,
            seed=training.seed % 2**32,
            normalize_advantage=not drops,  # a credit's zero means something
            rollout_buffer_class=ActiveRolloutBuffer if drops else DictRolloutBuffer,
            policy_kwargs={
                "shape": training.network,
                "shares_trunk": training.shares_trunk,
                "silence_logit": training.silence_logit,
                "sums_nodes": training.sums_nodes,
                "optimizer_kwargs": {"eps": ppo.adam_epsilon},
            },
        )
    # By optimiser steps, not by PPO's share of a budget, which a resumed run may raise.
    model.lr_schedule = lambda _: decayed_rate(ppo, model._n_updates)
    return model, rng


def _batch_size(training: Training, num_envs: int) -> int:
    """Return the rows of a minibatch, at least 2: of one row, advantages have no spread."""
    num_rows, num_minibatches = num_envs * training.ppo.num_steps, training.ppo.num_minibatches
    if num_rows < 2 * num_minibatches:
        raise ValueError(
            f"a rollout of {num_rows} rows is too small for {num_minibatches} minibatches; train "
            f"on {-(-2 * num_minibatches // training.ppo.num_steps)} or more missions"
        )
    return -(-num_rows // num_minibatches)


def decayed_rate(ppo: PpoSettings, num_epochs: int) -> float:
    """Return the learning rate after some passes: it falls in steps of the optimiser (III-C)."""
    share = ppo.decay ** (num_epochs * ppo.num_minibatches // ppo.decay_steps)
    return ppo.learning_rate * max(share, ppo.least_share)


def train(
    run: TrainingRun, folder: Path, *, listener: Listener, is_resumed: bool = False
) -> Progress:
    """Train until a limit, or until the listener returns False; return where the run stands.

    Args:
        run: The request; the policy that it begins with has the settings' network.
        folder: The run's; made if it is not there.
        listener: Called with a status after every window.
        is_resumed: Go on from the folder's checkpoint, or start over if it did not get that far.

    Raises:
        ValueError: The missions cannot be made, the folder is another's, the checkpoint is damaged
            or foreign, or training has diverged.
        OSError: The folder cannot be written.
    """
    check_folder = check_begun if is_resumed else check_new
    check_folder(folder)
    with owned(folder / SETTINGS):
        check_folder(folder)  # a run may have begun, or come further, meanwhile
        model, rng = make_model(run.training)
        progress, networks = _begun(folder, run, model, rng)
        model.set_logger(configure(str(folder / TENSORBOARD), ["tensorboard"]))
        callback = TrainingCallback(model, run, folder, progress, networks, rng, listener)
        try:
            with suppress(Stopped):
                _learn(model, run.limits, callback)
            callback.choose()
        finally:
            model.logger.close()
    return progress


def _learn(model: PPO, limits: Limits, callback: TrainingCallback) -> None:
    env = env_of(model)
    wanted = -(-(limits.decisions or NO_BUDGET) // env.num_teams) * env.num_envs
    if wanted > model.num_timesteps:
        model.learn(
            wanted - model.num_timesteps,
            callback=callback,
            log_interval=NO_BUDGET,  # the callback dumps, with team decisions on the axis
            reset_num_timesteps=model.num_timesteps == 0,
        )
    callback.init_callback(model)
    callback.between_rollouts(is_last=True)


def _begun(
    folder: Path, run: TrainingRun, model: PPO, rng: np.random.Generator
) -> tuple[Progress, checkpoint.Networks]:
    """Take a run to its last checkpoint, or else to its beginning; then it can be resumed.

    Nothing is written before all that is read has been checked.
    """
    kept, own, progress, init = folder / CHECKPOINT, folder / INIT, Progress(), None
    networks: checkpoint.Networks = {}
    if kept.exists():
        progress, networks = checkpoint.load(kept, run.training, model, rng)
    elif run.init is not None:
        path = own if own.exists() else run.init
        init = read_policy(path)
        if init[1].network != run.training.network:
            raise ValueError(f"policy {path} has another network than the run that begins with it")
    write_run(folder, run)
    if progress.curve:
        write_curve(folder / CURVE, progress.curve)  # it may be ahead of the checkpoint
    if init is not None:
        assert isinstance(model.policy, GnnActorCritic)
        model.policy.take_acting_network(init[0])
        if not own.exists():
            save_policy(own, *init)
    return progress, networks
