"""What a training run shows while it goes on: a bar, and a line for every evaluation."""

import math
from collections.abc import Callable
from datetime import timedelta
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import Task

from swarm_mj.learning.choice import ORACLE, REFERENCES, column, reference_missions
from swarm_mj.system.progress import WorkBar

if TYPE_CHECKING:
    from swarm_mj.learning.callback import Status
    from swarm_mj.learning.run_folder import Limits, Run
    from swarm_mj.learning.settings import Training

FINISHING = "finishing this rollout, then all is kept; Ctrl-C again breaks off at once"
WHOLE = 1.0  # the bar's total


class Watch(WorkBar):
    """The listener of a run, and its bar: shows where it stands, and passes Ctrl-C on."""

    def __init__(self, console: Console, run: "Run", is_interrupted: Callable[[], bool]) -> None:
        """Prepare the bar; `is_interrupted` says whether Ctrl-C was pressed."""
        super().__init__("Training", WHOLE, console=console, shows_time_left=False)
        self._console, self._limits, self._is_interrupted = console, run.limits, is_interrupted
        self._notes = {ORACLE: f" ({oracle_missions(run.training)})"}
        self._start: Status | None = None  # of this session
        self._num_rows = 0
        self.has_stopped = False  # whether the run was told to stop

    @property
    def has_begun(self) -> bool:
        """Whether there was anything to do."""
        return self._start is not None

    def __call__(self, status: "Status") -> bool:
        """Show a status; returns whether to go on."""
        if self._start is None:
            self._start = status
            self._num_rows = len(status.progress.curve)
        self._print_new_row(status)
        self.what = status.what
        self.text = _text(status, self._start, self._limits)
        self.move_to(share_done(status, self._limits))
        if self._is_interrupted() and not self.has_stopped:
            self.has_stopped = True
            self._console.print(f"Interrupted: {FINISHING}.")
        return not self.has_stopped

    def _shown_what(self, _task: Task) -> str:
        return "Finishing" if self._is_interrupted() else self.what

    def _print_new_row(self, status: "Status") -> None:
        curve = status.progress.curve
        if len(curve) > self._num_rows:
            self._num_rows = len(curve)
            row = curve[-1]
            note = "  best so far" if row is status.progress.best else ""
            others = "".join(
                f"  {name} {age:.2f}{self._notes.get(name, '')}"
                for name, age in reference_ages(row).items()
            )
            self._console.print(
                f"{row['decisions']:>11,.0f} decisions {row['minutes']:7.1f} min   "
                f"held-out age {age_of(row)}{note:13}{others}"
            )


def share_done(status: "Status", limits: "Limits") -> float:
    """How much of a run is done, by the limit that it is nearest to."""
    shares = [0.0]
    if limits.decisions:
        shares.append(status.decisions / limits.decisions)
    if limits.minutes:
        shares.append(status.minutes / limits.minutes)
    return min(WHOLE, max(shares))


def minutes_left(status: "Status", start: "Status", limits: "Limits") -> float | None:
    """Until the first limit, at the speed since `start`; None until there is one."""
    left = []
    if limits.minutes:
        left.append(limits.minutes - status.minutes)
    made = status.decisions - start.decisions
    if limits.decisions and made:
        lasts = (status.minutes - start.minutes) / made  # minutes a decision
        left.append(lasts * (limits.decisions - status.decisions))
    return max(0.0, min(left)) if left else None


def age_of(row: dict[str, float]) -> str:
    """Return a held-out age of information, with its standard error if it has one [windows]."""
    error = f" ± {row['aoi_sem']:.2f}" if "aoi_sem" in row else ""
    return f"{row['aoi']:.2f}{error}"


def reference_ages(row: dict[str, float]) -> dict[str, float]:
    """What hand-written policies cost on the same missions, as far as they were flown [windows]."""
    ages = ((name, row.get(column("aoi", name))) for name in REFERENCES)
    return {name: age for name, age in ages if age is not None}


def oracle_missions(training: "Training") -> str:
    """How many of the evaluations' missions of each team size the oracle has flown."""
    size = reference_missions(training).get(ORACLE, training.held_out)  # a run of old flew all
    return f"{size} of {training.held_out} missions"


def _text(status: "Status", start: "Status", limits: "Limits") -> str:
    parts = [f"{status.decisions:,} decisions"]
    if status.evaluated is not None:
        parts.append(f"missions {status.evaluated:.0%}")
    elif not math.isnan(status.aoi):
        parts.append(f"age {status.aoi:.1f}")
    if status.progress.curve:
        parts.append(f"held out {status.progress.curve[-1]['aoi']:.1f}")
    made, minutes = status.decisions - start.decisions, status.minutes - start.minutes
    if made and minutes:
        parts.append(f"{made / minutes / 60.0:.0f}/s")
    left = minutes_left(status, start, limits)
    if left is not None:
        parts.append(f"{timedelta(seconds=round(60.0 * left))} left")
    return ", ".join(parts)
