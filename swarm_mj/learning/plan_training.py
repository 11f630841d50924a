"""Trains what a planner weighs news by: imitation of a rule, then an evolution strategy.

The network begins by imitating `RuleOfThumb`, by gradient descent. CMA-ES (Hansen 2016, arXiv
1604.00772) then changes its weights to what makes plans flown on paper youngest (`plan_practice`).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import cma
import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from swarm_mj.learning.plan_practice import EXERCISES, Team, draw_teams, mean_age
from swarm_mj.policies.greedy import Links
from swarm_mj.policies.worth import RuleOfThumb
from swarm_mj.policies.worth_network import (
    SHAPES,
    TeamFeatures,
    WorthNetwork,
    forward,
    num_weights,
    team_features,
    unpacked,
)
from swarm_mj.whole_file import whole_file

IMITATION_STEPS, IMITATION_RATE = 3000, 0.01
IMITATED_TEAMS = 3  # draws of all exercises
RULE_UNIT = 8.0  # the imitated weights are the rule's over this, which makes them of order 1
SHARE_LOSS = 3.0  # weight of the share's error beside that of the weights
HELD_OUT_SEED = 500_000  # of the teams that the progress is measured on
POPULATION = 24  # candidates a generation


@dataclass(frozen=True, kw_only=True)
class Progress:
    """Where the training is after a generation; ages are relative to the rule's."""

    generation: int
    candidates: float  # median over the candidates, on this generation's teams
    held_out: float  # of the distribution's mean, on teams never trained on; NaN: not measured
    step_size: float


class PlanTraining:
    """An evolution that can be continued from its file: it replays what it found."""

    def __init__(self, path: Path, *, seed: int, step_size: float, measure_every: int = 10) -> None:
        """Begins, or continues what the file holds.

        Args:
            path: A `.npz` file, written after each generation.
            seed: Of the imitation, the teams and the candidates.
            step_size: Standard deviation of the first candidates.
            measure_every: Generations between two measurements on held-out teams.

        Raises:
            ValueError: The file is of another seed or step size, or no such file at all.
        """
        self._path = path
        self._seed = seed
        self._measure_every = measure_every
        self._losses: list[np.ndarray] = []  # of the candidates, one array a generation
        self._found: list[np.ndarray] = []  # the candidates
        stored = _stored(path, seed, step_size)
        self._step_size = step_size
        self._start = stored["start"] if stored else imitated(seed)
        options = {"popsize": POPULATION, "seed": seed + 1, "verbose": -9}
        self._evolution = cma.CMAEvolutionStrategy(self._start, step_size, options)
        for found, losses in zip(stored.get("found", ()), stored.get("losses", ()), strict=True):
            self._evolution.ask()
            self._tell(found, losses)
        self._held_out = draw_teams(
            EXERCISES, np.random.default_rng([HELD_OUT_SEED, HELD_OUT_SEED])
        )

    @property
    def mean(self) -> dict[str, Float[np.ndarray, "..."]]:
        """The weights in the middle of the candidates."""
        return dict(unpacked(np.asarray(self._evolution.mean)))

    def generations(self) -> Iterator[Progress]:
        """Evolves, without end."""
        while True:
            number = len(self._losses) + 1
            rng = np.random.default_rng([self._seed, number])
            teams = draw_teams(EXERCISES, rng)
            rule = ages(teams, RuleOfThumb())
            candidates = np.stack(self._evolution.ask())
            losses = np.array([relative(teams, rule, _network(unpacked(c))) for c in candidates])
            self._tell(candidates, losses)
            self._store()
            is_measured = number % self._measure_every == 0
            yield Progress(
                generation=number,
                candidates=float(np.median(losses)),
                held_out=self.measure() if is_measured else float("nan"),
                step_size=float(self._evolution.sigma),
            )

    def measure(self) -> float:
        """The age that the mean's plans leave on held-out teams, relative to the rule's."""
        return relative(self._held_out, self._held_out_rule, _network(self.mean))

    @cached_property
    def _held_out_rule(self) -> Float[np.ndarray, "K"]:
        """The rule's ages on the held-out teams, which never change."""
        return ages(self._held_out, RuleOfThumb())

    def _tell(self, candidates: Float[np.ndarray, "P S"], losses: Float[np.ndarray, "P"]) -> None:
        self._evolution.tell(list(candidates), list(losses))
        self._found.append(candidates)
        self._losses.append(losses)

    def _store(self) -> None:
        with whole_file(self._path) as part, part.open("wb") as file:
            np.savez(
                file,
                start=self._start,
                settings=np.array([self._seed, self._step_size]),
                found=np.stack(self._found),
                losses=np.stack(self._losses),
            )


def _stored(path: Path, seed: int, step_size: float) -> dict[str, np.ndarray]:
    """What a training's file holds; nothing if there is none."""
    if not path.exists():
        return {}
    try:
        stored = dict(np.load(path))
        settings = stored["settings"].tolist()
    except (OSError, ValueError, KeyError, EOFError) as error:
        raise ValueError(f"{path} is no training's file ({error}); remove it") from error
    if settings != [seed, step_size]:
        raise ValueError(
            f"{path} was begun with seed {settings[0]:g} and step size {settings[1]:g}, not "
            f"{seed} and {step_size:g}; give these, or remove it"
        )
    return stored


def ages(teams: list[Team], scorer: RuleOfThumb | WorthNetwork) -> Float[np.ndarray, "K"]:
    """Each team's mean age by a scorer's plans [windows]."""
    return np.array([mean_age(team, scorer) for team in teams])


def relative(
    teams: list[Team], rule: Float[np.ndarray, "K"], network: RuleOfThumb | WorthNetwork
) -> float:
    """The age by a network's plans over that by the rule's: the mean over exercises."""
    ratio = ages(teams, network) / rule
    names = [team.exercise for team in teams]
    means = [np.mean(ratio[[n == name for n in names]]) for name in dict.fromkeys(names)]
    return float(np.mean(means))


def imitated(seed: int) -> Float[np.ndarray, "S"]:
    """Weights that imitate the rule, from random ones."""
    rng = np.random.default_rng(seed)
    lessons = [
        _lesson(links)
        for _ in range(IMITATED_TEAMS)
        for team in draw_teams(EXERCISES, rng)
        for links in team.believed[:1]
    ]
    flat = torch.tensor(0.3 * rng.standard_normal(num_weights()), requires_grad=True)
    adam = torch.optim.Adam([flat], lr=IMITATION_RATE)
    decay = torch.optim.lr_scheduler.CosineAnnealingLR(adam, IMITATION_STEPS)
    for _ in range(IMITATION_STEPS):
        features, squared, share = lessons[rng.integers(len(lessons))]
        weights, own_share = forward(_tensors(flat), features, torch.tanh)
        target = torch.stack([0.0 * squared, squared, 0.0 * squared], 2)
        error = torch.mean((weights - target) ** 2 / (target + 0.05))
        adam.zero_grad()
        (error + SHARE_LOSS * (own_share - share) ** 2).backward()
        adam.step()
        decay.step()
    return flat.detach().numpy()


def _lesson(links: Links) -> tuple[TeamFeatures, Tensor, float]:
    """What the network sees, and what the rule says."""
    features, worth = team_features(links), RuleOfThumb()(links)
    tensors = {name: torch.from_numpy(array) for name, array in vars(features).items()}
    squared = torch.from_numpy(worth.squared.astype(np.float64)) / RULE_UNIT
    return TeamFeatures(**tensors), squared, worth.least_share


def _tensors(flat: Tensor) -> Mapping[str, Tensor]:
    """Tensors of `SHAPES` from one vector."""
    sizes = [int(np.prod(shape)) for shape in SHAPES.values()]
    parts = torch.split(flat, sizes)
    return {n: p.reshape(s) for (n, s), p in zip(SHAPES.items(), parts, strict=True)}


def _network(parameters: Mapping[str, Float[np.ndarray, "..."]]) -> WorthNetwork:
    return WorthNetwork(parameters, digest="")
