"""Advantages across the ends of missions: nothing leaks, and cut missions are bootstrapped."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import small_training
from stable_baselines3.common.callbacks import BaseCallback

from swarm_mj.learning.graph_vec_env import env_of
from swarm_mj.learning.train import make_model

DISCOUNT, GAE_LAMBDA, STEPS = 0.9, 0.7, 26  # missions are of 20 windows, cut at 5, 10 and 15


class Watch(BaseCallback):
    """Notes what every window of a rollout brought."""

    def __init__(self):
        super().__init__()
        self.rewards, self.dones, self.infos = [], [], []

    def _on_step(self):
        self.rewards.append(self.locals["rewards"].copy())
        self.dones.append(self.locals["dones"].copy())
        self.infos.append(self.locals["infos"])
        return True


def one_rollout(credit, monkeypatch):
    """A model after one rollout and before any optimiser step, and what happened in it."""
    training = small_training(credit)
    ppo = replace(training.ppo, num_steps=STEPS, discount=DISCOUNT, gae_lambda=GAE_LAMBDA)
    training = replace(training, ppo=ppo, silence_logit=0.0)
    model, _ = make_model(training)
    monkeypatch.setattr(model, "train", lambda: None)
    watch = Watch()
    model.learn(STEPS * model.n_envs, watch)
    return model, watch


def value_of(model, observation):
    """The value of one environment's observation."""
    one = {name: torch.as_tensor(rows)[None] for name, rows in observation.items()}
    return model.policy.predict_values(one).item()


def episodes_of(watch, e):
    """First and last window of each episode of an environment; the last one may be under way."""
    ends = [t for t in range(STEPS) if watch.dones[t][e]]
    if not ends or ends[-1] != STEPS - 1:
        ends.append(STEPS - 1)
    return list(zip([0, *(t + 1 for t in ends[:-1])], ends, strict=True))


def advantages_by_hand(model, watch, e):
    """Generalised advantages, episode by episode, from the values that the rollout noted."""
    value = model.rollout_buffer.values[:, e]
    expected = np.zeros(STEPS)
    for first, last in episodes_of(watch, e):
        reward = [float(watch.rewards[t][e]) for t in range(first, last + 1)]
        info = watch.infos[last][e]
        if not watch.dones[last][e]:
            after = value_of(model, {n: rows[e] for n, rows in model._last_obs.items()})
        elif "terminal_observation" in info:
            after = value_of(model, info["terminal_observation"])
        else:
            after = 0.0  # the mission is over: nothing more is earned
        values = [*value[first : last + 1], after]
        errors = [r + DISCOUNT * values[n + 1] - values[n] for n, r in enumerate(reward)]
        for n in range(len(errors)):
            decay = [(DISCOUNT * GAE_LAMBDA) ** k for k in range(len(errors) - n)]
            expected[first + n] = np.dot(decay, errors[n:])
    return expected


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_nothing_leaks_over_the_end_of_a_mission(credit, monkeypatch):
    model, watch = one_rollout(credit, monkeypatch)
    buffer, num_cut, num_over = model.rollout_buffer, 0, 0
    for e in range(model.n_envs):
        np.testing.assert_allclose(
            buffer.advantages[:, e], advantages_by_hand(model, watch, e), rtol=1e-4, atol=1e-5
        )
        for t in range(STEPS):
            num_cut += "terminal_observation" in watch.infos[t][e]
            num_over += watch.dones[t][e] and "terminal_observation" not in watch.infos[t][e]
    rows = model.n_envs // len(env_of(model).batches)
    assert num_cut == 3 * rows
    assert num_over == 2 * rows  # of the batch that is not cut, and of the first one once more
    np.testing.assert_allclose(buffer.returns, buffer.advantages + buffer.values, rtol=1e-5)


def test_without_discount_an_advantage_is_the_credit_itself(monkeypatch):
    training = small_training("robot")
    assert training.drops_silence
    model, _ = make_model(training)
    monkeypatch.setattr(model, "train", lambda: None)
    watch = Watch()
    model.learn(8 * model.n_envs, watch)
    np.testing.assert_array_equal(model.rollout_buffer.advantages, np.array(watch.rewards))
