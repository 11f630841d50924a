"""The bar of a training run, and its report: the policy kept, and others."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from rich.console import Console

from swarm_mj.learning import selection
from swarm_mj.learning.run_folder import Limits, TrainingRun
from swarm_mj.learning.selection import ORACLE, REFERENCES, Cost, Progress, Row, Status
from swarm_mj.system.terminal import WorkBar

FINISHING = "finishing this rollout, then all is kept; Ctrl-C again breaks off at once"
CLEAR = 2.0  # standard errors of a difference that is not due to chance
NAMES = {"first": "the policy it began with"}


class Watch(WorkBar):
    """The listener of a run: a bar, and a line for every evaluation; it passes Ctrl-C on."""

    def __init__(
        self, console: Console, run: TrainingRun, is_interrupted: Callable[[], bool]
    ) -> None:
        """Prepare the bar; `is_interrupted` says whether Ctrl-C was pressed."""
        super().__init__("Training", 1.0, console=console)
        self._console, self._run, self._is_interrupted = console, run, is_interrupted
        self.start: Progress | None = None  # of this session, once there was anything to do
        self._num_rows = 0
        self.has_stopped = False  # whether the run was asked to stop

    def __call__(self, status: Status) -> bool:
        """Show a status; return whether to go on."""
        progress, limits = status.progress, self._run.limits
        if self.start is None:
            self.start, self._num_rows = replace(progress), len(progress.curve)
        if len(progress.curve) > self._num_rows:
            self._num_rows = len(progress.curve)
            self._console.print(_row(self._run, progress))
        self.what = status.what
        self.text = _text(status, self.start)
        self.move_to(share_done(progress, limits))
        if self._is_interrupted() and not self.has_stopped:
            self.has_stopped = True
            self._console.print(f"Interrupted: {FINISHING}.")
        return not self.has_stopped

    @property
    def shown_what(self) -> str:
        """The words before the bar, as they are drawn now."""
        # Asked at every redrawing, so Ctrl-C shows before the run reports again.
        return "Finishing" if self._is_interrupted() else self.what


def share_done(progress: Progress, limits: Limits) -> float:
    """Return the share of a run that is done, by the limit that it is nearest to."""
    pairs = ((progress.decisions, limits.decisions), (progress.minutes, limits.minutes))
    return min(1.0, max((done / limit for done, limit in pairs if limit), default=0.0))


def report(run: TrainingRun, progress: Progress) -> dict[str, str]:
    """Return rows for the closing table: the policy kept, and others on the same missions."""
    training, best, choice = run.training, progress.best, progress.choice
    if best is None:
        return {}
    first, cost = progress.curve[0], training.reward
    if choice is None:  # of the best evaluation, the age is shown whatever the cost
        cost, missions = "aoi", f"{training.held_out} of each team size, which chose the policy"
        when = "untrained" if best is first else f"after {best['decisions']:,.0f} decisions"
        kept, others = _age(best), {"first": _age(first)} | _reference_ages(best)
    else:
        missions = f"{choice.num_missions} of each team size, which chose nothing"
        when = f"after {choice.decisions:,} decisions"
        kept, others = choice.kept, choice.others
    rows = {"missions": missions, "policy kept": f"{_amount(kept, cost)}, {when}"}
    for name, each in others.items():
        known = f"; {REFERENCES[name]}" if name in REFERENCES else ""
        rows[NAMES.get(name, name)] = _amount(each, cost) + known
    # The oracle flies few missions, those of evaluations only.
    if (age := _reference_ages(first).get(ORACLE)) is not None:
        missions = f"on {_oracle_missions(run)} of the evaluations"
        rows[ORACLE] = f"{_amount(age, 'aoi')}, {missions}; {REFERENCES[ORACLE]}"
    elif max(training.robots) > (most := selection.ORACLE_ROBOTS):
        rows[ORACLE] = f"not flown: it would take long with more than {most} robots"
    return rows


def verdicts(run: TrainingRun, progress: Progress) -> Iterator[str]:
    """Yield what a reader should know beyond the numbers: losses, and how fair the choice is."""
    choice = progress.choice
    if has_stopped_early(run, progress):
        way_on = " --resume --patience 0 trains on." if progress.has_chosen else ""
        yield f"Stopped early: the last {run.limits.patience} evaluations brought no gain.{way_on}"
    if choice is None:
        if progress.best is not None:
            yield (
                "The policy kept is the best of the evaluations, on the same missions: its age "
                "flatters. A run that ends chooses on others."
            )
        return
    if choice.decisions == 0:
        begun = "the policy given by --init" if run.init else "the untrained policy"
        yield f"Training did not help: {begun} did best, and is the one kept."
    for name, cost in choice.others.items():
        if cost.behind > 0.0:
            difference = Cost(mean=cost.behind, sem=cost.behind_sem)
            other, behind = NAMES.get(name, name), _amount(difference, run.training.reward)
            is_clear = cost.behind_sem is not None and cost.behind > CLEAR * cost.behind_sem
            lost, level = f"loses to {other} by", f"is no better than {other}, which is ahead by"
            yield f"The policy kept {lost if is_clear else level} {behind} on the same missions."


def has_stopped_early(run: TrainingRun, progress: Progress) -> bool:
    """Return whether a run stopped because it no longer learned, and not at its budget."""
    limits = run.limits
    is_left = limits.decisions is None or progress.decisions < limits.decisions
    return is_left and progress.has_stalled(limits.patience)


def _row(run: TrainingRun, progress: Progress) -> str:
    row = progress.curve[-1]
    note = "  best so far" if row is progress.best else ""
    flown = {ORACLE: f" ({_oracle_missions(run)})"}
    ages = _reference_ages(row).items()
    others = "".join(f"  {name} {age.mean:.2f}{flown.get(name, '')}" for name, age in ages)
    when = f"{row['decisions']:>11,.0f} decisions {row['minutes']:7.1f} min"
    age = _amount(_age(row), "aoi").removesuffix(" windows")
    return f"{when}   held-out age {age}{note:13}{others}"


def _text(status: Status, start: Progress) -> str:
    progress = status.progress
    parts = [f"{progress.decisions:,} decisions"]
    if status.evaluated is not None:
        parts.append(f"missions {status.evaluated:.0%}")
    elif not math.isnan(status.aoi):
        parts.append(f"age {status.aoi:.1f}")
    if progress.curve:
        parts.append(f"held out {progress.curve[-1]['aoi']:.1f}")
    made, minutes = progress.decisions - start.decisions, progress.minutes - start.minutes
    if made and minutes:
        parts.append(f"{made / minutes / 60.0:.0f}/s")
    return ", ".join(parts)


def _age(row: Row) -> Cost:
    return Cost(mean=row["aoi"], sem=row.get("aoi_sem"))


def _reference_ages(row: Row) -> dict[str, Cost]:
    """Return the ages of reference policies that were flown on the same missions [windows]."""
    ages = {name: row.get(selection.column("aoi", name)) for name in REFERENCES}
    return {name: Cost(mean=age, sem=None) for name, age in ages.items() if age is not None}


def _oracle_missions(run: TrainingRun) -> str:
    """Return how many of the evaluations' missions of each team size the oracle has flown."""
    held_out = run.training.held_out
    number = selection.reference_missions(run.training).get(ORACLE, held_out)  # an old run flew all
    return f"{number} of {held_out} missions"


def _amount(cost: Cost, kind: str) -> str:
    """Return a cost with its standard error, in the unit of its kind."""
    unit, digits = ("windows", 2) if kind == "aoi" else ("m²/s²", 4)
    spread = "" if cost.sem is None else f" ± {cost.sem:.{digits}f}"
    return f"{cost.mean:.{digits}f}{spread} {unit}"
