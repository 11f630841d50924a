"""A session of a training run, whatever it trains: evaluations, the policy kept, limits, time."""

import math
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from stable_baselines3.common.logger import Logger as TensorBoard

from swarm_mj.learning import held_out, run_folder, selection
from swarm_mj.learning.held_out import Acting
from swarm_mj.learning.live import LiveTraining
from swarm_mj.learning.loggers import Guarded, Logger
from swarm_mj.learning.run_folder import CURVE, REPLAYS, TrainingRun
from swarm_mj.learning.selection import (
    Accumulator,
    Choice,
    CurveRow,
    HeldOutCosts,
    Listener,
    Progress,
)
from swarm_mj.policies.stored import POLICY
from swarm_mj.system.packages import commit, version


class Stopped(Exception):  # noqa: N818 - nothing went wrong
    """Ends an evaluation that the listener does not wait for."""


def record_evaluation(logger: TensorBoard, columns: dict[str, float], decisions: int) -> None:
    """Write an evaluation for TensorBoard, by the names of its columns."""
    for name, value in columns.items():
        logger.record(name if "/" in name else f"held_out/{name}", value)
    logger.dump(decisions)


class Session(ABC):
    """One session of a run; a subclass learns, and says what acts, how it is stored and resumed.

    Attributes:
        progress: Where the run stands.
    """

    progress: Progress

    def __init__(
        self,
        run: TrainingRun,
        folder: Path,
        listener: Listener,
        logger: Guarded[Logger],
        live: Guarded[LiveTraining],
    ) -> None:
        """Take what `train` was given; nothing has been read yet."""
        self._run = run
        self._training = run.training
        self._folder = folder
        self._listener = listener
        self._own_logger = logger
        self._live = live
        self._aoi = math.nan
        self._goes_on = True
        self.progress = Progress()
        self._kept: dict[int, Acting] = {}  # what may be chosen, by the decisions behind it
        self._counted_s = time.monotonic()  # until when time is in the progress
        self._is_in_step = False
        self._saved_s = -math.inf

    def learn(self) -> None:
        """Take step after step until a limit or the listener ends it."""
        progress = self.progress
        patience = self._run.limits.patience
        if progress.curve:  # what the run that is resumed has come to, if only to look at it
            self._show(lambda _share: None)
        while True:
            self._count_time()
            is_last = self._is_over() or not self._goes_on
            # Less --patience may end a run between evaluations: what acts last is judged first.
            self._between_steps(is_last=is_last or progress.has_stalled(patience))
            if is_last or not self._goes_on or progress.has_stalled(patience):
                return
            self._count_time()
            self._is_in_step = True
            self._take_step()
            self._count_time()
            self._is_in_step = False

    @abstractmethod
    def _take_step(self) -> None:
        """Fly missions, and learn from them."""

    @abstractmethod
    def close(self) -> None:
        """Close files that are still open."""

    @abstractmethod
    def _acting(self) -> Acting:
        """Return a copy of what acts now."""

    @abstractmethod
    def _write_checkpoint(self) -> None:
        """Write all that the run needs to go on from here."""

    @abstractmethod
    def _store(self, path: Path, acting: Acting, origin: dict[str, Any]) -> None:
        """Write a policy, with its `training`, `evaluation`, `commit` and `version`."""

    @abstractmethod
    def _record(self, columns: dict[str, float], decisions: int) -> None:
        """Let TensorBoard know of an evaluation, by the names of its columns."""

    def _begin(self) -> None:
        """Write the settings, once all that is read has been checked."""
        run_folder.write_run(self._folder, self._run)
        if self.progress.curve:
            self.progress.write_curve(self._folder / CURVE)  # it may be ahead of the checkpoint
        self._counted_s = time.monotonic()

    def _is_over(self) -> bool:
        """Return whether a limit is met; of the minutes, the selection will take some."""
        progress = self.progress
        limits = self._run.limits
        if progress.decisions >= (limits.decisions or math.inf):
            return True
        if limits.minutes is None:
            return False
        reserved = selection.reserved_minutes(self._training, progress, limits.minutes)
        return progress.minutes + reserved >= limits.minutes

    def _report(self, what: str = "Training", flown: float | None = None) -> None:
        """Call the listener; raise Stopped if it does not wait for the share of a flight to fly."""
        self._count_time()
        status = selection.Status(progress=self.progress, aoi=self._aoi, evaluated=flown, what=what)
        self._goes_on = self._listener(status) and self._goes_on
        if flown is not None and not self._goes_on:
            raise Stopped

    def _count_time(self) -> None:
        """Move the time since the last call into the progress."""
        now_s = time.monotonic()
        passed_s = now_s - self._counted_s
        self._counted_s = now_s
        self.progress.minutes += passed_s / 60.0
        if self._is_in_step:  # evaluations, files and pictures are no part of what decisions take
            self.progress.since_evaluation.seconds += passed_s

    def _between_steps(self, *, is_last: bool) -> None:
        """Evaluate, record a replay and keep a checkpoint, each if it is due."""
        progress = self.progress
        decisions = progress.decisions
        is_new = not progress.curve or progress.curve[-1].decisions < decisions
        is_due = is_new and (is_last or progress.is_due(self._training.evaluate_every))
        if is_due:
            if not progress.curve:
                self._save()  # from the first evaluation on, a run without one has lost it
            self._evaluate()
        every = self._run.limits.replay_every
        if every and decisions >= progress.next_replay and self._goes_on:
            replays = self._folder / REPLAYS
            held_out.record_replay(self._training, self._acting(), decisions, replays)
            progress.next_replay = decisions - decisions % every + every
        is_old = time.monotonic() - self._saved_s >= self._run.limits.checkpoint_every_s
        if is_old or is_due or is_last or not self._goes_on:
            self._save()

    def _save(self) -> None:
        self._count_time()
        self._write_checkpoint()
        self._saved_s = time.monotonic()

    def _evaluate(self) -> None:
        """Fly the held-out missions, log, and keep the policy if it is the best."""
        progress = self.progress
        training = self._training
        decisions = progress.decisions
        acting = self._acting()
        try:
            if not progress.curve and not progress.references:
                on_window = partial(self._report, "Flying others")
                progress.references = held_out.fly_references(training, on_window)
            self._count_time()
            means = progress.since_evaluation.means()
            begun = progress.minutes
            on_window = partial(self._report, "Evaluating")
            references = progress.references
            costs, behind = held_out.evaluate(training, acting, references, on_window)
        except Stopped:
            return
        self._count_time()
        progress.evaluation_minutes = progress.minutes - begun
        progress.since_evaluation = Accumulator()
        others = held_out.reference_columns(references)
        if not others and progress.curve:
            others = progress.curve[0].references  # of a run that 1.0.0 began
        evaluation = CurveRow(
            decisions=decisions,
            minutes=progress.minutes,
            costs=costs,
            references=others | behind,
            training=means | progress.optimiser,
        )
        progress.curve.append(evaluation)
        self._record(evaluation.columns(), decisions)
        self._own_logger.do(lambda logger: logger.log(evaluation.columns(), decisions))
        progress.write_curve(self._folder / CURVE)
        self._kept[decisions] = acting
        kept = {row.decisions for row in selection.candidates(progress.curve)}
        for dropped in self._kept.keys() - kept:
            del self._kept[dropped]
        if progress.best is evaluation:
            progress.choice = None
            self._keep(decisions, costs, None)
        self._report()
        self._show(partial(self._report, "Showing"))

    def _show(self, on_window: held_out.OnWindow) -> None:
        """Show how the policy under training flies, and the curve, if there is a viewer."""
        if not self._live.is_there:
            return
        progress = self.progress
        acting = self._acting()
        try:
            flown = held_out.record_first(self._training, acting, on_window)
        except Stopped:
            return
        self._live.do(
            lambda live: live.show(self._training, flown, progress.decisions, progress.curve)
        )

    def choose(self) -> None:
        """Choose the policy that is kept, once nothing is left to train and if none is chosen."""
        progress = self.progress
        if not (self._goes_on and progress.curve) or progress.has_chosen:
            return
        report = partial(self._report, "Choosing")
        try:
            choice, costs = held_out.choose(self._training, progress.curve, self._kept, report)
        except Stopped:
            return
        self._keep(choice.decisions, costs, choice)
        progress.choice = choice
        self._save()

    def _keep(self, decisions: int, costs: HeldOutCosts, choice: Choice | None) -> None:
        """Store the policy of the evaluation after this many decisions, with its costs."""
        training = self._training
        row = _row_at(self.progress.curve, decisions)
        made = {
            "command": self._run.command,
            "decisions": decisions,
            "minutes": row.minutes,
        }
        self._store(
            self._folder / POLICY,
            self._kept[decisions],
            {
                "training": asdict(training) | made,
                "evaluation": asdict(costs) | held_out.notes_of(training, choice),
                "commit": commit(),
                "version": version(),
            },
        )


def _row_at(curve: Iterable[CurveRow], decisions: int) -> CurveRow:
    """Return the evaluation after this many decisions."""
    for row in curve:
        if row.decisions == decisions:
            return row
    raise LookupError(f"the curve has no evaluation after {decisions} decisions")
