"""Proximal policy optimisation (Schulman et al. 2017) with the advantage of both actions known.

A robot transmits or it does not, and the advantage of either follows from the recorded mission
(`counterfactual.py`). So the expectation over its own action is taken exactly, and no value has to
be learned. stable-baselines3 has no place for either: its rewards come with the step, for the
action that was drawn.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn.functional import softplus
from torch.nn.utils import clip_grad_norm_

from residual_gnn.features import Seen
from residual_gnn.recording import TrainingBatch
from residual_gnn.torch_network import ResidualNetwork
from swarm_mj.system.fields import check, setting

CHUNK = 16  # decisions that stay together when they are shuffled
SCALE = 20.0  # of the loss, against which gradients are clipped


@dataclass(frozen=True, kw_only=True)
class PpoSettings:
    """The settings of one improvement."""

    learning_rate: float = setting(7e-4, "of Adam", low=1e-9, high=1.0)
    epochs: int = setting(5, "passes over the decisions", low=1, high=100)
    minibatch: int = setting(6000, "decisions in a minibatch, about", low=CHUNK, high=10**7)
    min_ratio: float = setting(0.7, "of probabilities", low=0.0, high=1.0)
    max_ratio: float = setting(1.5, "of probabilities", low=1.0, high=100.0)
    max_advantage: float = setting(8.0, "of a packet, in standard deviations", low=0.1, high=1e6)
    max_gradient_norm: float = setting(1.0, "of a step", low=1e-9, high=1e9)

    def __post_init__(self) -> None:
        check(self)


def improve(
    network: ResidualNetwork,
    optimiser: torch.optim.Optimizer,
    batches: Sequence[TrainingBatch],
    settings: PpoSettings,
    generator: torch.Generator,
) -> None:
    """Take a few steps on the decisions of some missions, in units of each mission's spread.

    Args:
        network: Changed in place.
        optimiser: Of its weights.
        batches: Of missions that this network flew; worths are in units of each one's own spread.
        settings: Of the steps.
        generator: Shuffles the decisions.
    """
    seen, logit, weight, advantage = _batch(batches, settings)
    num_rows = len(logit)
    first = torch.searchsorted(seen[2], torch.arange(num_rows + 1))
    chunks = torch.arange(-(-num_rows // CHUNK))
    for _ in range(settings.epochs):
        shuffled = chunks[torch.randperm(len(chunks), generator=generator)]
        for part in shuffled.chunk(max(1, num_rows // settings.minibatch)):
            spans = [(CHUNK * c, min(CHUNK * (c + 1), num_rows)) for c in part.tolist()]
            rows = torch.cat([torch.arange(*span) for span in spans])
            edges = torch.cat([torch.arange(int(first[a]), int(first[b])) for a, b in spans])
            place = torch.empty(num_rows, dtype=torch.long)
            place[rows] = torch.arange(len(rows))
            now = network(seen[0][rows], seen[1][edges], place[seen[2][edges]])
            gained = surrogate(now, logit[rows], advantage[rows], settings)
            loss = -(weight[rows] * gained).sum() / weight[rows].sum()
            optimiser.zero_grad()
            (SCALE * loss).backward()
            clip_grad_norm_(network.parameters(), settings.max_gradient_norm)
            optimiser.step()


def surrogate(
    now: Float[Tensor, "R"],
    before: Float[Tensor, "R"],
    advantage: Float[Tensor, "R"],
    settings: PpoSettings,
) -> Float[Tensor, "R"]:
    """Return PPO's clipped objective, in expectation over a robot's own action.

    Args:
        now: Logits of transmitting.
        before: The same when it was decided.
        advantage: Of transmitting rather than not.
        settings: Whose ratios clip.
    """
    p = torch.sigmoid(before)
    gained = torch.zeros_like(now)
    actions = ((-1.0, p, (1.0 - p) * advantage), (1.0, 1.0 - p, -p * advantage))
    for sign, probability, value in actions:
        ratio = torch.exp(softplus(sign * before) - softplus(sign * now))
        clipped = ratio.clamp(settings.min_ratio, settings.max_ratio)
        gained = gained + probability * torch.minimum(ratio * value, clipped * value)
    return gained


def _batch(
    batches: Sequence[TrainingBatch], settings: PpoSettings
) -> tuple[tuple[Tensor, Tensor, Tensor], Tensor, Tensor, Tensor]:
    """All batches in one, with worths in standard deviations of their lesson's."""
    starts = np.cumsum([0, *(len(lesson.logit) for lesson in batches)])
    seen = Seen(
        np.concatenate([lesson.seen.robots for lesson in batches]),
        np.concatenate([lesson.seen.neighbours for lesson in batches]),
        np.concatenate(
            [start + each.seen.owner for start, each in zip(starts, batches, strict=False)]
        ),
    )
    scaled = [lesson.advantage / max(float(np.std(lesson.advantage)), 1e-9) for lesson in batches]
    advantage = np.clip(np.concatenate(scaled), -settings.max_advantage, settings.max_advantage)
    tensors = [torch.from_numpy(each) for each in seen]
    logit = np.concatenate([lesson.logit for lesson in batches])
    weight = np.concatenate([lesson.weight for lesson in batches])
    return (
        (tensors[0], tensors[1], tensors[2]),
        torch.from_numpy(logit),
        torch.from_numpy(weight),
        torch.from_numpy(advantage.astype(np.float32)),
    )
