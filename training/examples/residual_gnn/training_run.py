"""The training of a residual policy: fly, compute advantages, improve, repeat.

A run's folder holds `checkpoint.pt`, written after each improvement and each evaluation, from which
it goes on as if it had never stopped, and `curve.csv`, one row an evaluation.
"""

import io
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch

from residual_gnn.factory import check_stationary, reads_packets
from residual_gnn.network import Weights
from residual_gnn.policy import ResidualPolicy
from residual_gnn.ppo import PpoSettings, improve
from residual_gnn.recording import Recorder, TrainingBatch, collect_batch
from residual_gnn.rule import RestingRule
from residual_gnn.torch_network import ResidualNetwork
from swarm_mj.learning.checkpoint import read_torch
from swarm_mj.learning.settings import CHOICE_SEED, HELD_OUT_SEED
from swarm_mj.mission import Mission
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.fields import check, setting
from swarm_mj.system.writing import write_bytes, write_csv

CHECKPOINT, CURVE = "checkpoint.pt", "curve.csv"
FIRST_PLACE = 30_000  # seeds of the places where training flies
DEFAULT_PPO = PpoSettings()
NUM_BEST = 3  # that are chosen among, with the untrained one


@dataclass(frozen=True, kw_only=True)
class ResidualTraining:
    """The settings of a training: the same make the same policy on the same machine."""

    missions: dict[str, Mission]  # that are flown in turn, by their names
    width: int = setting(32, "of the network's layers", low=1, high=256)
    prior_logit: float = setting(
        5.0, "what the rule's choice adds to the logit of transmitting", low=0.0, high=50.0
    )
    corrects_turns: bool = setting(
        False, "let the network decide before everyone's plan is in force, too"
    )
    ppo: PpoSettings = DEFAULT_PPO
    together: int = setting(4, "missions of each kind, between two improvements", low=1, high=1000)
    places: int = setting(40, "where robots may stand, of each kind", low=1, high=10_000)
    share: float = setting(
        0.1,
        "of the decisions that are learned from, where the rule was hardly doubted",
        low=1e-3,
        high=1.0,
    )
    horizon: int = setting(120, "slots over which an advantage is counted", low=1, high=10_000)
    seed: int = setting(0, "of all that is drawn", low=0, high=2**31)
    held_out: int = setting(8, "missions of each kind in an evaluation", low=1, high=1000)
    evaluate_every: int = setting(15, "improvements", low=1, high=10_000)

    def __post_init__(self) -> None:
        check(self)
        for name, mission in self.missions.items():
            check_stationary(mission)
            if not reads_packets(mission):
                raise ValueError(
                    f"a packet of {name} does not say all that its sender knew before, so "
                    "there is too little to learn from; take the preset paper and no bit rate"
                )
        if self.together > self.places:
            raise ValueError(
                f"together must be up to places, {self.places}, not {self.together}: missions that "
                "fly together begin in different places"
            )
        shortest = SLOTS_PER_WINDOW * min(each.num_windows for each in self.missions.values())
        if self.horizon // 2 >= shortest:
            raise ValueError(
                f"horizon must be below twice the slots of a mission, {2 * shortest}, not "
                f"{self.horizon}"
            )


@dataclass(kw_only=True)
class Progress:
    """The progress of a run."""

    improvements: int = 0
    seconds: float = 0.0
    curve: list[dict[str, int | float]] = field(default_factory=list)  # an evaluation each
    best: dict[int, dict[str, Any]] = field(default_factory=dict)  # weights by improvements


class Run:
    """A training under way."""

    def __init__(self, training: ResidualTraining, folder: Path) -> None:
        """Begin with an evaluation of the rule alone, or resume the folder's checkpoint.

        Args:
            training: What is trained.
            folder: The run's; made if it is missing.

        Raises:
            ValueError: The checkpoint is damaged, or of other settings.
            OSError: The folder cannot be read or written.
        """
        self.training, self._folder = training, folder
        torch.manual_seed(training.seed)
        self._shuffle = torch.Generator().manual_seed(training.seed)
        self._rng = np.random.default_rng(training.seed)
        self._network = ResidualNetwork(training.width, training.prior_logit)
        self._optimiser = torch.optim.Adam(
            self._network.parameters(), lr=training.ppo.learning_rate
        )
        radios = {radio_of(mission) for mission in training.missions.values()}
        self._rules = {radio: RestingRule(radio) for radio in radios}  # each keeps its plans
        self.progress = Progress()
        if (folder / CHECKPOINT).exists():
            self._load()
        else:
            self.evaluate()

    def improve(self) -> dict[str, float]:
        """Fly and learn once, and write the checkpoint.

        Returns:
            The mean age of each kind of mission [windows].

        Raises:
            ValueError: There was no decision to learn from.
            OSError: The checkpoint cannot be written.
        """
        start, training = time.monotonic(), self.training
        weights = self._weights(self._network)
        batches: list[TrainingBatch] = []
        ages = {}
        for name, mission in training.missions.items():
            places = self._rng.choice(training.places, training.together, replace=False)
            swarm = Swarm(mission, (FIRST_PLACE + places).tolist())
            policy = Recorder(weights, self._rules[radio_of(mission)], radio_of(mission))
            rng = self._rng.spawn(1)[0]
            learned, ages[name] = collect_batch(
                swarm, policy, rng, share=training.share, horizon=training.horizon
            )
            if len(learned.logit):
                batches.append(learned)
        if not batches:
            raise ValueError(
                "no robot had a plan to correct: missions are too short for teams to agree on one; "
                "fly longer ones, or smaller teams"
            )
        improve(self._network, self._optimiser, batches, training.ppo, self._shuffle)
        self.progress.improvements += 1
        self.progress.seconds += time.monotonic() - start
        self._save()
        return ages

    def evaluate(self) -> dict[str, float]:
        """Fly missions that training never sees; keep the weights if they are among the best.

        Returns:
            The mean age of each kind of mission [windows], and as `ratio` the mean of what they are
            over those of the rule alone.
        """
        weights, progress = self._weights(self._network), self.progress
        is_untrained = progress.improvements == 0  # then, without draws, it is the rule
        ages = self.ages(
            weights, HELD_OUT_SEED, self.training.held_out, is_deterministic=is_untrained
        )
        row = ages | {"ratio": self._ratio(ages)}
        done = {"improvements": progress.improvements, "minutes": progress.seconds / 60}
        progress.curve.append(done | row)
        progress.best[progress.improvements] = self._network.state_dict_copy()
        by_ratio = sorted(progress.curve, key=lambda each: each["ratio"])
        keep = {0, *(int(each["improvements"]) for each in by_ratio[:NUM_BEST])}
        progress.best = {at: kept for at, kept in progress.best.items() if at in keep}
        self._save()
        return row

    def choose(self) -> tuple[int, Weights, dict[int, float]]:
        """Return which of the best is the best on missions that have judged none of them so far.

        Returns:
            After how many improvements it was made, its weights, and the ratio of each of the best;
            0 is the rule alone, whose weights, still untrained, must not be flown by draws.
        """
        ratios, all_weights = {}, {}
        for at, state in self.progress.best.items():
            network = ResidualNetwork(self.training.width, self.training.prior_logit)
            network.load_state_dict(state)
            all_weights[at] = self._weights(network)
        num_missions = self.training.held_out
        rule = self.ages(all_weights[0], CHOICE_SEED, num_missions, is_deterministic=True)
        for at, weights in all_weights.items():
            ages = self.ages(weights, CHOICE_SEED, num_missions) if at else rule
            ratios[at] = float(np.mean([ages[name] / rule[name] for name in ages]))
        best = min(ratios, key=lambda at: ratios[at])
        return best, all_weights[best], ratios

    def ages(
        self,
        weights: Weights,
        first_seed: int,
        num_missions: int,
        *,
        is_deterministic: bool = False,
    ) -> dict[str, float]:
        """Return the mean age of each kind of mission [windows]."""
        seeds, ages = range(first_seed, first_seed + num_missions), {}
        for name, mission in self.training.missions.items():
            radio = radio_of(mission)
            policy = ResidualPolicy(
                weights, self._rules[radio], radio, is_deterministic=is_deterministic
            )
            windows = rollout(Swarm(mission, seeds), policy)
            ages[name] = float(np.mean([window.costs.age_windows for window in windows]))
        return ages

    def _weights(self, network: ResidualNetwork) -> Weights:
        return network.weights(corrects_turns=self.training.corrects_turns)

    def _ratio(self, ages: dict[str, float]) -> float:
        """Return the ratio to the cost of the rule alone, from the first evaluation."""
        first = self.progress.curve[0] if self.progress.curve else ages
        return float(np.mean([ages[name] / first[name] for name in ages]))

    def _save(self) -> None:
        state = {
            "settings": repr(self.training),
            "progress": asdict(self.progress),
            "network": self._network.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "shuffle": self._shuffle.get_state(),
            "rng": self._rng.bit_generator.state,
            "spawned": self._rng.bit_generator.seed_seq.n_children_spawned,  # type: ignore[attr-defined]
        }
        content = io.BytesIO()
        torch.save(state, content)
        write_bytes(self._folder / CHECKPOINT, content.getbuffer())
        curve = self.progress.curve
        write_csv(self._folder / CURVE, list(curve[0]), curve)

    def _load(self) -> None:
        path = self._folder / CHECKPOINT
        state: Any = read_torch(path)
        try:
            if state["settings"] != repr(self.training):
                raise ValueError("it was made with other settings")
            self._network.load_state_dict(state["network"])
            self._optimiser.load_state_dict(state["optimiser"])
            self._shuffle.set_state(state["shuffle"])
            self.progress = Progress(**state["progress"])
            sequence = np.random.SeedSequence(
                self.training.seed, n_children_spawned=state["spawned"]
            )
            self._rng = np.random.Generator(np.random.PCG64(sequence))
            self._rng.bit_generator.state = state["rng"]
        except Exception as error:  # torch and generators of random numbers take what they please
            reason = str(error).partition("\n")[0]
            raise ValueError(
                f"checkpoint {path} is not this run's ({reason:.200}); begin a new run with "
                "another --out"
            ) from error


def train(run: Run, minutes: float, said: Callable[[str], None]) -> None:
    """Improve until the run has trained for a number of minutes, and report the progress.

    Args:
        run: That begins or goes on; minutes that it has trained already count, evaluations do not.
        minutes: After which it stops, once the improvement under way is done and evaluated.
        said: Is given each line.
    """
    progress = run.progress
    while True:
        is_over = progress.seconds >= 60.0 * minutes
        is_due = is_over or progress.improvements % run.training.evaluate_every == 0
        if is_due and progress.curve[-1]["improvements"] < progress.improvements:
            row = run.evaluate()
            ages = _listed({name: row[name] for name in run.training.missions})
            said(f"      held out: {row['ratio']:.3f} of the rule's age; {ages}")
        if is_over:
            return
        ages = _listed(run.improve())
        said(f"{progress.improvements:5d} improvements, {progress.seconds / 60:.1f} min: {ages}")


def _listed(ages: dict[str, float]) -> str:
    return ", ".join(f"{name} {age:.2f}" for name, age in ages.items()) + " windows"
