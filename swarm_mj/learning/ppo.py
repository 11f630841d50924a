"""Stable-baselines3's PPO with the run's numbers (III-C), its networks and its rollout buffer."""

import math
import warnings
from collections.abc import Callable, Generator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from stable_baselines3 import PPO
from stable_baselines3.common.buffers import DictRolloutBuffer
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.type_aliases import DictRolloutBufferSamples, PyTorchObs, Schedule
from stable_baselines3.common.vec_env import VecEnv, VecNormalize
from torch import Tensor
from torch.optim.swa_utils import AveragedModel

from swarm_mj.learning.graph_vec_env import GraphVecEnv, RowCredits
from swarm_mj.learning.settings import Device, PpoSettings, Training
from swarm_mj.policies.gnn.decisions import evaluated, recipient_logits
from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.gnn.network import Network
from swarm_mj.policies.gnn.own_networks import check_one_by_one, empty_network, make_network
from swarm_mj.policies.learned import IMPOSSIBLE, sample

CPU = torch.device("cpu")


class DevicePpo(PPO):
    """PPO whose rollouts are on the CPU, and whose passes over them are on a device."""

    # Missions fly on the CPU, so a network on a device would wait for a copy in every window.
    optimises_on = CPU

    def train(self) -> None:
        """Learn from the rollout, and return to the CPU."""
        self._move(self.optimises_on)
        try:
            super().train()
            networks_of(self).take_average()
        finally:
            self._move(CPU)

    def _move(self, device: torch.device) -> None:
        if self.optimises_on != CPU:
            self.policy.to(device)
            self.rollout_buffer.device = device
            optimizer = self.policy.optimizer
            optimizer.load_state_dict(optimizer.state_dict())  # Adam's moments follow the weights


def mean_entropy(model: PPO) -> float:
    """Return the entropy of the decisions of a rollout, a mean over all of its rows [nats].

    A decision's negative log-probability has the entropy for its mean.
    """
    buffer = model.rollout_buffer
    is_of_speech = isinstance(buffer, SpeechRolloutBuffer)
    return -float((buffer.done_log_probs if is_of_speech else buffer.log_probs).mean())


def optimising_device(device: Device) -> torch.device:
    """Return where networks are optimised; raise ValueError if this machine has no such device."""
    has_cuda = torch.cuda.is_available()
    if device == "cuda" and not has_cuda:
        raise ValueError("torch finds no CUDA device on this machine; choose device cpu, or auto")
    return torch.device("cuda") if has_cuda and device != "cpu" else CPU


def make_model(training: Training, device: Device = "cpu") -> PPO:
    """Make PPO over fresh missions (III-C).

    Raises ValueError if the missions or the minibatches cannot be made of these settings, an own
    network mixes robots, or this machine lacks the device, which optimises the networks.
    """
    torch.set_num_threads(training.threads)  # sums that are divided among them round differently
    ppo = training.ppo
    graphs = GraphVecEnv(training, np.random.default_rng(training.seed))
    env: VecEnv = graphs
    if training.reward == "velocity-variance":  # as in the authors' code
        env = VecNormalize(env, norm_obs=False, norm_reward=True, gamma=ppo.discount)
    buffer_class = SpeechRolloutBuffer if training.considers_speech else DictRolloutBuffer
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "You have specified a mini-batch size")  # one is smaller
        model = DevicePpo(
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
            seed=training.seed % 2**32,  # NumPy's global generator takes no larger one
            device=CPU,
            normalize_advantage=not training.considers_speech,  # a credit's zero means something
            rollout_buffer_class=buffer_class,
            policy_kwargs={"training": training, "optimizer_kwargs": {"eps": ppo.adam_epsilon}},
        )
    if training.own_network:
        check_one_by_one(networks_of(model).network, training.own_network)
    if graphs.memory is not None:
        graphs.recalls = networks_of(model).recalled
    if training.considers_speech:
        assert isinstance(model.rollout_buffer, SpeechRolloutBuffer)
        graphs.considered_recipient = networks_of(model).considered_recipient
        model.rollout_buffer.considered = networks_of(model).considered
        model.rollout_buffer.takes_credits = partial(graphs.take_credits, ppo.horizon)
    model.optimises_on = optimising_device(device)
    # By optimiser steps, not by PPO's share of a budget, which a resumed run may raise.
    model.lr_schedule = lambda _: decayed_rate(ppo, model._n_updates)
    return model


def networks_of(model: PPO) -> "GnnActorCritic":
    """Return a model's networks."""
    assert isinstance(model.policy, GnnActorCritic)
    return model.policy


def _batch_size(training: Training, num_envs: int) -> int:
    """Return the rows of a minibatch, at least 2: of one row, advantages have no spread."""
    num_rows = num_envs * training.ppo.num_steps
    num_minibatches = training.ppo.num_minibatches
    if num_rows < 2 * num_minibatches:
        needed = math.ceil(2 * num_minibatches * training.missions / num_rows)
        raise ValueError(
            f"a rollout of {num_rows} rows is too small for {num_minibatches} minibatches; train "
            f"on {needed} or more missions"
        )
    return math.ceil(num_rows / num_minibatches)


def decayed_rate(ppo: PpoSettings, num_epochs: int) -> float:
    """Return the learning rate after some passes: it falls in steps of the optimiser (III-C)."""
    share = ppo.decay ** (num_epochs * ppo.num_minibatches // ppo.decay_steps)
    return ppo.learning_rate * max(share, ppo.least_share)


class Considered(NamedTuple):
    """The packets of a window whose credit is asked for, those of a robot that stays silent, too.

    Without discount the gradient of a robot's expected credit is the sum over recipients of its
    probability's gradient times the credit: of packets sent or not. Few robots speak in a window,
    so several times as many rows teach something as if only packets sent did, and a row costs the
    same. Which of the silent are considered is drawn, in proportion to their odds of speech.
    """

    recipient: Int[Tensor, "E"]  # the one addressed, if the robot speaks; itself: none considered
    weight: Float[Tensor, "E"]  # of its credit, so that rows' chances to be considered cancel
    log_p: Float[Tensor, "E"]  # log-probability of what the robot did in fact


class GnnActorCritic(ActorCriticPolicy):
    """Logits over recipients for every robot, and one value for every environment.

    The two come from separate networks (III-C), or, to save time, from one whose last number per
    node is the value. An environment is a robot, or a team: then log-probability, entropy and value
    are sums over its robots. There is one difference between the presets: the paper's value is one
    scalar per robot, of its own node; the authors' code sums those of all nodes of all graphs.
    """

    def __init__(self, *given: Any, training: Training, **others: Any) -> None:
        self._training = training
        self._shape = training.network
        self._remembered: Tensor | None = None
        self._considered: Considered | None = None
        super().__init__(*given, **others)  # spaces and the rate's schedule come from PPO

    def _build(self, lr_schedule: Schedule) -> None:
        num_outputs = self._shape.num_outputs
        if self._training.shares_trunk:
            num_outputs += 1  # the last one is the value, so the others keep their places
        own = self._training.own_network
        self.network = make_network(replace(self._shape, num_outputs=num_outputs), own)
        if not self._training.shares_trunk:
            self.value_network = FastAggregationGnn(replace(self._shape, num_outputs=1))
        self.optimizer = torch.optim.Adam(
            self.parameters(), lr=lr_schedule(1.0), foreach=True, **self.optimizer_kwargs
        )
        # What flies: the weights of late differ from one rollout to the next more than they learn.
        self.average = AveragedModel(self.network, avg_fn=self._averaged)
        self.average.requires_grad_(False)

    def take_average(self) -> None:
        """Take the network's weights as they now are into the average."""
        self.average.update_parameters(self.network)

    def _averaged(self, average: Tensor, current: Tensor, num_averaged: Tensor | int) -> Tensor:
        # At first a network learns fast, and its weights of long ago are soon worth nothing.
        num = int(num_averaged)
        kept = min(self._training.ppo.kept, (1.0 + num) / (10.0 + num))
        return average.lerp(current, 1.0 - kept)

    def considered(self) -> Considered:
        """Return the packets considered in the last decision."""
        assert self._considered is not None
        return self._considered

    def considered_recipient(self) -> Int[np.ndarray, "E"]:
        """Return whom they are to."""
        return self.considered().recipient.numpy()

    def recalled(self) -> Float[np.ndarray, "E *robots H"]:
        """Return what robots remember since their last decision."""
        assert self._remembered is not None
        return self._remembered.numpy()

    def acting_network(self) -> Network:
        """Return a copy of the average of the network that acts, without what values."""
        network = empty_network(self._shape, self._training.own_network)
        weights: dict[str, Tensor] = {}
        for name, tensor in self.average.module.state_dict().items():
            if name in ("output.weight", "output.bias"):
                tensor = tensor[: self._shape.num_outputs]  # without the value's row, if it has one
            weights[name] = tensor.detach().cpu().clone()
        network.load_state_dict(weights, assign=True)
        return network.requires_grad_(False)

    def take_acting_network(self, given: Network) -> None:
        """Begin with another network's weights; its shape is this one's."""
        for network in (self.network, self.average.module):
            own = network.state_dict()
            with torch.no_grad():
                for name, tensor in given.state_dict().items():
                    own[name][: len(tensor)].copy_(tensor)  # a value's row, the last, stays

    def _robots(
        self, obs: dict[str, Tensor], owner: Int[Tensor, "R"], is_valued: Bool[Tensor, "R N"]
    ) -> tuple[Float[Tensor, "R N"], Float[Tensor, "R N"]]:
        """Logits over recipients, and the values of nodes that count, of every robot's graph."""
        node = obs["node"].flatten(0, -3)
        parent = obs["parent"].long().flatten(0, -2)
        may_address = obs["may_address"].bool().flatten(0, -2)
        memory = obs["memory"].flatten(0, -2) if "memory" in obs else None
        output, memory = evaluated(self.network, node, parent, may_address, owner, memory)
        if memory is not None:
            self._remembered = memory.detach().view(obs["memory"].shape)
        if self._training.shares_trunk:
            # The value is the last number of each node.
            output, value = output.split([self._shape.num_outputs, 1], dim=2)
        else:
            value = self.value_network(node, parent, is_valued)
        values = value.squeeze(2)
        logits = recipient_logits(
            output,
            owner=owner,
            may_address=may_address,
            silence_logit=self._training.silence_logit,
            has_turn=obs["has_turn"].bool().flatten(),
            most_speech=self._training.most_speech,
        )
        return logits, values

    def logits_and_value(
        self, obs: PyTorchObs
    ) -> tuple[Float[Tensor, "E *robots N"], Float[Tensor, "E"]]:
        """Return the logits of each environment's decisions, and its value."""
        assert isinstance(obs, dict)
        num_nodes = obs["may_address"].shape[-1]
        own = torch.eye(num_nodes, dtype=torch.bool, device=obs["may_address"].device)
        if "owner" in obs:
            # Each environment is a robot.
            owner = obs["owner"].long()
            logits, values = self._robots(obs, owner.squeeze(1), own[owner.squeeze(1)])
            return logits, values.gather(1, owner).squeeze(1)
        # Each environment is a team, of which padded robots count for nothing.
        shape = obs["may_address"].shape[:2]
        is_robot = obs["is_robot"].bool()
        counted = is_robot[:, :, None] & is_robot[:, None, :]
        if self._training.mission.preset != "reference":
            counted = counted & own
        owner = torch.arange(num_nodes, device=own.device).repeat(shape[0])
        logits, values = self._robots(obs, owner, counted.flatten(0, 1))
        value = (values.unflatten(0, shape) * counted).flatten(1).sum(1)
        return logits.unflatten(0, shape), value

    def forward(
        self, obs: PyTorchObs, deterministic: bool = False
    ) -> tuple[Int[Tensor, "E *robots"], Float[Tensor, "E"], Float[Tensor, "E"]]:
        """Actions, values and log-probabilities, of the actions or of what is considered."""
        logits, value = self.logits_and_value(obs)
        actions = logits.argmax(-1) if deterministic else draw(logits)
        if self._training.considers_speech:
            assert isinstance(obs, dict)
            own = obs["owner"].long().squeeze(1)
            self._considered = consider(logits, own, actions, self._training.ppo.considered)
            return actions, value, log_probability(logits, self._considered.recipient)
        return actions, value, log_probability(logits, actions)

    def evaluate_actions(
        self, obs: PyTorchObs, actions: Tensor
    ) -> tuple[Float[Tensor, "E"], Float[Tensor, "E"], Float[Tensor, "E"]]:
        """Values, the actions' log-probabilities and entropies."""
        logits, value = self.logits_and_value(obs)
        return value, log_probability(logits, actions.long()), entropy(logits)

    def _predict(
        self, observation: PyTorchObs, deterministic: bool = False
    ) -> Int[Tensor, "E *robots"]:
        return self(observation, deterministic)[0]

    def predict_values(self, obs: PyTorchObs) -> Float[Tensor, "E"]:
        """Return the environments' values."""
        return self.logits_and_value(obs)[1]


def draw(logits: Float[Tensor, "*rows N"]) -> Int[Tensor, "*rows"]:
    """Return a draw from each row's Boltzmann distribution, as `LearnedPolicy` makes it."""
    # In doubles, so that rounding of the weights does not move a draw from one row to the next
    # recipient. Rollouts are on the CPU, so nothing is copied.
    rows = logits.detach().double().flatten(0, -2).numpy()
    uniform = torch.rand(len(rows)).double().numpy()
    return torch.from_numpy(sample(rows, uniform)).view(logits.shape[:-1])


def consider(
    logits: Float[Tensor, "E N"],
    own: Int[Tensor, "E"],
    actions: Int[Tensor, "E"],
    per_packet: float,
) -> Considered:
    """Draw what packets are considered: all that are sent, and some that are not.

    A row is considered with `per_packet` times the probability q of its speech, 1 at most, and
    never less than it speaks. Its recipient is drawn as if it spoke.
    """
    log_p = logits.double().log_softmax(-1)
    silence = log_p.gather(1, own[:, None]).squeeze(1).exp()
    q = 1.0 - silence
    chance = (per_packet * q).clamp(max=1.0)
    # Who speaks is considered anyway; of who is silent, as many as then lack.
    extra = torch.where(silence > 0.0, (chance - q) / silence, 0.0)
    speech = log_p.scatter(1, own[:, None], IMPOSSIBLE)
    is_extra = (torch.rand(len(q)) < extra) & (actions == own)
    recipient = torch.where(is_extra, draw(speech), actions)
    weight = (per_packet * q).clamp(min=1.0)
    done = log_p.gather(1, actions[:, None]).squeeze(1)
    return Considered(recipient=recipient, weight=weight.float(), log_p=done.float())


def log_probability(
    logits: Float[Tensor, "E *robots N"], actions: Int[Tensor, "E *robots"]
) -> Float[Tensor, "E"]:
    """Return the log-probability of each environment's actions, summed over its robots."""
    chosen = logits.log_softmax(-1).gather(-1, actions[..., None])
    return chosen.flatten(1).sum(1)


def entropy(logits: Float[Tensor, "E *robots N"]) -> Float[Tensor, "E"]:
    """Return the entropy of each environment's decisions, summed over its robots [nats]."""
    log_p = logits.log_softmax(-1)
    each = -(log_p.exp() * log_p).sum(-1, keepdim=True)
    return each.flatten(1).sum(1)


class SpeechRolloutBuffer(DictRolloutBuffer):
    """Yields the rows whose speech is considered; their actions are to whom.

    Without discount a robot's advantage is its credit, and silence has none: of the other rows
    nothing is learned, and they cost as much. Credits are not normalised, for their zero means
    something.

    What PPO logs of its passes (value, clipping, divergence) is over the rows kept. Values, which
    nothing reads without discount, are learned from these rows, too.

    Attributes:
        considered: Asks for what is considered in the window that is added.
        takes_credits: Asks for the credits of the rollout's windows.
        weights: Those of credits, by window and row.
        done_log_probs: Log-probabilities of what robots did, likewise.
        is_whole: Whether a row's credit is over the whole horizon, likewise; others teach nothing.
    """

    considered: Callable[[], Considered]
    takes_credits: Callable[[], RowCredits]

    def reset(self) -> None:
        """Begin a rollout."""
        super().reset()
        self.weights = np.ones_like(self.rewards)
        self.done_log_probs = np.zeros_like(self.rewards)
        self.is_whole = np.zeros(self.rewards.shape, np.bool_)

    def add(
        self,
        obs: dict[str, np.ndarray],
        action: np.ndarray,
        reward: np.ndarray,
        episode_start: np.ndarray,
        value: Tensor,
        log_prob: Tensor,
    ) -> None:
        """Add a window, as the base does, with what is considered in place of what was done."""
        considered = self.considered()
        self.weights[self.pos] = considered.weight.numpy()
        self.done_log_probs[self.pos] = considered.log_p.numpy()
        action = considered.recipient.numpy()[:, None]
        super().add(obs, action, reward, episode_start, value, log_prob)

    def compute_returns_and_advantage(self, last_values: object, dones: np.ndarray) -> None:
        """Take credits for returns, and times their weights for advantages; values do not count."""
        del last_values, dones
        found = self.takes_credits()
        self.rewards[...] = found.credit
        self.is_whole[...] = found.is_whole
        self.advantages[...] = self.rewards * self.weights
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
        is_kept = self.actions[:, 0] != self.observations["owner"][:, 0]
        is_kept &= self.is_whole.ravel()
        kept = np.random.permutation(np.flatnonzero(is_kept))  # noqa: NPY002
        num_batches = max(1, round(num_rows / (batch_size or num_rows)))
        for rows in np.array_split(kept, num_batches):
            if len(rows):
                yield self._get_samples(rows)
