"""Stable-baselines3's PPO with the run's numbers (III-C), and the rollout buffer of its credits."""

import warnings
from collections.abc import Generator

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import DictRolloutBuffer
from stable_baselines3.common.type_aliases import DictRolloutBufferSamples
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from swarm_mj.learning.actor_critic import GnnActorCritic
from swarm_mj.learning.graph_vec_env import GraphVecEnv
from swarm_mj.learning.settings import PpoSettings, Training

SILENT_SHARE = 0.1  # of the silent rows that are learned from


def make_model(training: Training) -> PPO:
    """Make PPO over fresh missions (III-C).

    Raises ValueError if the missions or the minibatches cannot be made of these settings.
    """
    torch.set_num_threads(training.threads)
    ppo, drops = training.ppo, training.drops_silence
    env: VecEnv = GraphVecEnv(training, np.random.default_rng(training.seed))
    if training.reward == "velocity-variance":  # as in the authors' code
        env = VecNormalize(env, norm_obs=False, norm_reward=True, gamma=ppo.discount)
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
            policy_kwargs={"training": training, "optimizer_kwargs": {"eps": ppo.adam_epsilon}},
        )
    # By optimiser steps, not by PPO's share of a budget, which a resumed run may raise.
    model.lr_schedule = lambda _: decayed_rate(ppo, model._n_updates)
    return model


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


class ActiveRolloutBuffer(DictRolloutBuffer):
    """Yields the rows that transmitted, and a share of the silent ones.

    Without discount a robot's advantage is its credit, and a silent robot's is 0: its row adds
    nothing to the policy's gradient. So most of the rows, which cost as much as the others, can be
    left out; some stay for the entropy. Credits are not normalised, for their zero means something.

    What PPO logs of its passes (value, clipping, divergence) is over the rows kept, among which
    transmissions are more frequent than in the rollout. Values, which nothing reads without
    discount, are learned from these rows, too.
    """

    def compute_returns_and_advantage(self, last_values: object, dones: np.ndarray) -> None:
        """Advantages and returns are the rewards; what comes later is worth nothing."""
        del last_values, dones
        self.advantages[...] = self.rewards
        self.returns[...] = self.rewards

    def get(self, batch_size: int | None = None) -> Generator[DictRolloutBufferSamples, None, None]:
        """One pass over the rows kept, shuffled, in minibatches.

        Were no row left out, they would be of the given size; they become smaller in proportion.
        """
        num_rows = self.buffer_size * self.n_envs
        if not self.generator_ready:
            # Window by window, where they lie: most of them are never looked at.
            for name, rows in self.observations.items():
                self.observations[name] = rows.reshape(num_rows, *rows.shape[2:])
            for name in ("actions", "values", "log_probs", "advantages", "returns"):
                setattr(self, name, getattr(self, name).reshape(num_rows, 1))
            self.generator_ready = True
        is_active = self.actions[:, 0] != self.observations["owner"][:, 0]
        is_kept = is_active | (np.random.random(num_rows) < SILENT_SHARE)  # noqa: NPY002 - as SB3
        kept = np.random.permutation(np.flatnonzero(is_kept))  # noqa: NPY002
        num_batches = max(1, round(num_rows / (batch_size or num_rows)))
        for rows in np.array_split(kept, num_batches):
            if len(rows):
                yield self._get_samples(rows)
