"""The training of an index: generations of candidates that fly the same missions side by side."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from stable_baselines3.common.logger import configure

from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED, LAST_TRAINING_SEED
from swarm_mj.learning import evolution, index_checkpoint, run_folder
from swarm_mj.learning.held_out import Acting
from swarm_mj.learning.live import LiveTraining
from swarm_mj.learning.loggers import Guarded, Logger
from swarm_mj.learning.run_folder import CHECKPOINT, TrainingRun
from swarm_mj.learning.selection import Listener
from swarm_mj.learning.session import Session, record_evaluation
from swarm_mj.learning.settings import Training
from swarm_mj.policies.index.policy import IndexCsma
from swarm_mj.policies.index.weights import (
    NUMBERS,
    START,
    STEPS,
    Weights,
    as_tensors,
    flat,
    from_flat,
    from_tensors,
)
from swarm_mj.policies.policy_config import IndexConfig
from swarm_mj.policies.stored import save_weights
from swarm_mj.simulation.swarm import Swarm


class IndexSession(Session):
    """One session of a run that searches the numbers of `index-csma` by evolution."""

    def __init__(
        self,
        run: TrainingRun,
        folder: Path,
        listener: Listener,
        logger: Guarded[Logger],
        live: Guarded[LiveTraining],
    ) -> None:
        """Take a run to its last checkpoint, or else to its beginning; then it can be resumed."""
        super().__init__(run, folder, listener, logger, live)
        training = run.training
        self._rng = np.random.default_rng(training.seed)
        self._search = evolution.begin(NUMBERS, training.evolution.first_step)
        self._swarms: dict[tuple[int, int], Swarm] = {}  # by the kind and number of missions
        kept = folder / CHECKPOINT
        if kept.exists():
            found = index_checkpoint.load(kept, training, self._rng)
            self.progress = found.progress
            self._search = found.search
            self._kept.update(found.kept)
        self._begin()
        self._tensorboard = configure(str(folder / run_folder.TENSORBOARD), ["tensorboard"])

    def _take_step(self) -> None:
        """Let all candidates of a generation fly the same new missions, and learn who did best."""
        training = self._training
        num = training.evolution.candidates
        candidates = evolution.ask(self._search, num, self._rng)
        weights = weights_at(candidates)
        windows = self._rng.integers(training.least_windows, training.most_windows + 1)
        total = np.zeros(num)
        for kind, times in enumerate(kinds_drawn(training, self._rng).tolist()):
            if times > 0:
                seeds = self._rng.integers(FIRST_TRAINING_SEED, LAST_TRAINING_SEED, times)
                ages = self._fly(kind, seeds.tolist(), weights, int(windows))
                # Ages of large teams and of small ones count alike by their ratios.
                total += np.log(ages).sum(axis=1)
        evolution.tell(self._search, candidates, total / training.missions)
        self.progress.optimiser = {
            "train/generation": float(self._search.generation),
            "train/step": self._search.sigma,
        }

    def _fly(
        self, kind: int, seeds: list[int], weights: Weights, num_windows: int
    ) -> Float[np.ndarray, "C S"]:
        """Return the mean ages of candidates in the missions of these seeds [windows]."""
        num = len(weights.first)
        mission = self._training.kinds[kind]
        all_seeds = seeds * num  # candidate by candidate
        swarm = self._swarms.get((kind, len(seeds)))
        if swarm is None:
            swarm = Swarm(mission, all_seeds, **self._training.components.given)
            self._swarms[kind, len(seeds)] = swarm
        else:
            swarm.restart(all_seeds)
        swarm.start(IndexCsma(mission, weights))
        ages = np.zeros(len(all_seeds))
        for _ in range(num_windows):
            costs = swarm.step()
            ages += costs.age_windows
            self.progress.decisions += len(all_seeds)
            self.progress.since_evaluation.add([costs])
            self._aoi = float(costs.age_windows.mean())
            self._report()
        return ages.reshape(num, len(seeds)) / num_windows

    def close(self) -> None:
        """Close TensorBoard's file."""
        self._tensorboard.close()

    def _acting(self) -> Weights:
        # As it is stored, so that what was evaluated is what flies.
        return from_tensors(as_tensors(weights_at(self._search.mean[None])))

    def _write_checkpoint(self) -> None:
        kept = {at: its for at, its in self._kept.items() if isinstance(its, Weights)}
        state = index_checkpoint.State(progress=self.progress, search=self._search, kept=kept)
        index_checkpoint.save(self._folder / CHECKPOINT, self._training, state, self._rng)

    def _store(self, path: Path, acting: Acting, origin: dict[str, Any]) -> None:
        assert isinstance(acting, Weights)
        save_weights(path, as_tensors(acting), IndexConfig(**origin))

    def _record(self, columns: dict[str, float], decisions: int) -> None:
        record_evaluation(self._tensorboard, columns, decisions)


def weights_at(places: Float[np.ndarray, "C D"]) -> Weights:
    """Return the numbers at places of the search, which begins at 0 and has steps of about 1."""
    return from_flat(flat(START) + flat(STEPS) * places)


def kinds_drawn(training: Training, rng: np.random.Generator) -> Int[np.ndarray, "K"]:
    """Return how many missions of each kind a candidate flies: as many of all, but for a rest.

    The rest are of kinds that are drawn, so that there may be more kinds than missions.
    """
    num_kinds = len(training.kinds)
    times, rest = divmod(training.missions, num_kinds)
    drawn = np.full(num_kinds, times)
    drawn[rng.permutation(num_kinds)[:rest]] += 1
    return drawn
