"""The bar of a training run, and its report: the policy kept, and others."""

import math
from collections.abc import Callable, Iterator

from rich.console import Console

from swarm_mj.learning import selection
from swarm_mj.learning.run_folder import Limits, TrainingRun
from swarm_mj.learning.selection import (
    ORACLE,
    ORACLES,
    REFERENCES,
    Choice,
    Cost,
    CurveRow,
    Progress,
    Status,
)
from swarm_mj.protocol.mission_costs import AOI, MissionCost
from swarm_mj.system.terminal import WorkBar

FINISHING = "finishing this {}, then all is kept; Ctrl-C again breaks off at once"
CLEAR = 2.0  # standard errors of a difference that is not due to chance
NAMES = {"first": "the policy it began with"}


class Watch(WorkBar):
    """The listener of a run: a bar, and a line for every evaluation; it passes Ctrl-C on."""

    def __init__(
        self, console: Console, run: TrainingRun, is_interrupted: Callable[[], bool]
    ) -> None:
        """Prepare the bar; `is_interrupted` says whether Ctrl-C was pressed."""
        super().__init__("Training", 1.0, console=console)
        self._console = console
        self._run = run
        self._is_interrupted = is_interrupted
        self._num_rows = 0  # of the curve that were shown, in this session or before
        self.has_begun = False  # whether there was anything to do
        self.has_stopped = False  # whether the run was asked to stop

    def __call__(self, status: Status) -> bool:
        """Show a status; return whether to go on."""
        progress = status.progress
        if self.has_begun and len(progress.curve) > self._num_rows:
            self._console.print(_row(progress))
        self.has_begun = True
        self._num_rows = len(progress.curve)
        self.what = status.what
        self.text = _text(status)
        self.move_to(share_done(progress, self._run.limits))
        if self._is_interrupted() and not self.has_stopped:
            self.has_stopped = True
            step = self._run.training.way.step
            self._console.print(f"Interrupted: {FINISHING.format(step)}.")
        return not self.has_stopped

    @property
    def shown_what(self) -> str:
        """The words before the bar, as they are drawn now."""
        # Asked at every redrawing, so Ctrl-C shows before the run reports again.
        return "Finishing" if self._is_interrupted() else self.what


def share_done(progress: Progress, limits: Limits) -> float:
    """Return the share of a run that is done, by the limit that it is nearest to."""
    share = 0.0
    if limits.decisions:
        share = progress.decisions / limits.decisions
    if limits.minutes:
        share = max(share, progress.minutes / limits.minutes)
    return min(1.0, share)


def report(run: TrainingRun, progress: Progress) -> dict[str, str]:
    """Return rows for the closing table: the policy kept, and others on the same missions."""
    if progress.best is None:
        return {}
    training = run.training
    is_chosen = progress.choice is not None
    choice = progress.choice or _best_so_far(run, progress, progress.best)
    cost = training.cost if is_chosen else AOI  # evaluations tell the error of the age alone
    use = "not used to select the policy" if is_chosen else "which selected the policy"
    kind = "kind" if training.other_missions else "team size"
    rows = {
        "missions": f"{choice.num_missions} of each {kind}, {use}",
        "policy kept": f"{_amount(choice.kept, cost)}, after {choice.decisions:,} decisions",
    }
    for name, each in choice.others.items():
        shown = _amount(each, cost)
        if name in REFERENCES:
            shown += f"; {REFERENCES[name]}"
        if name in selection.reference_ages(progress.curve[0].references):
            shown += f"; {_when_reached(progress, name)}"
        rows[NAMES.get(name, name)] = shown
    if ORACLE not in choice.others and training.most_robots > selection.ORACLE_ROBOTS:
        too_many = f"more than {selection.ORACLE_ROBOTS} robots"
        rows[ORACLE] = f"not flown: it would take long with {too_many}"
    return rows


def _when_reached(progress: Progress, name: str) -> str:
    """Return in words when the held-out age was first at most that of a reference."""
    row = selection.reached(progress.curve, name)
    if row is None:
        return "not reached on held-out missions"
    if row.decisions == 0:
        return "reached on held-out missions before training"
    return f"reached on held-out missions in {row.minutes:.1f} min, {row.decisions:,} decisions"


def _best_so_far(run: TrainingRun, progress: Progress, best: CurveRow) -> Choice:
    """Return the choice that a run which has made none would make now: its best evaluation."""
    return Choice(
        decisions=best.decisions,
        run_decisions=progress.decisions,
        num_finalists=1,
        num_missions=run.training.held_out,
        kept=_age(best),
        others={"first": _age(progress.curve[0])} | _reference_ages(best),
    )


def verdicts(run: TrainingRun, progress: Progress) -> Iterator[str]:
    """Yield what a reader should know beyond the numbers: losses, and how fair the choice is."""
    choice = progress.choice
    if has_stopped_early(run, progress):
        way_on = " --resume --patience 0 trains on." if progress.has_chosen else ""
        yield f"Stopped early: the last {run.limits.patience} evaluations brought no gain.{way_on}"
    if choice is None:
        if progress.best is not None:
            best = "the best of the evaluations, on the same missions: so its age is biased"
            yield f"The policy kept is {best}. A run that ends selects on fresh missions."
        return
    if choice.decisions == 0:
        begun = "the policy given by --init" if run.init else "the untrained policy"
        yield f"Training did not help: {begun} did best, and is the one kept."
    for name, cost in choice.others.items():
        yield from _comparison(run, NAMES.get(name, name), cost)


def _comparison(run: TrainingRun, other: str, cost: Cost) -> Iterator[str]:
    """Yield a sentence about another policy.

    Nothing is said where the policy kept clearly beats it, or leads in a single mission.
    """
    if other in ORACLES:  # which know everything: nobody expects it to reach them
        return
    is_unclear = cost.behind_sem is not None and not is_clear(cost)
    if cost.behind <= 0.0 and not is_unclear:
        return
    yield f"The policy kept {difference(other, cost, run.training.cost)} on the same missions."


def difference(other: str, cost: Cost, kind: MissionCost) -> str:
    """Return in words how a policy compares with another one on the same missions."""
    signed = _amount(Cost(mean=cost.behind, sem=cost.behind_sem), kind)
    size = _amount(Cost(mean=abs(cost.behind), sem=cost.behind_sem), kind)
    clear = is_clear(cost)
    if clear is None:
        return f"differs from {other} by {signed}, in a single mission"
    if not clear:
        return f"shows no significant difference from {other} ({signed})"
    return f"loses to {other} by {size}" if cost.behind > 0.0 else f"beats {other} by {size}"


def is_clear(cost: Cost) -> bool | None:
    """Return whether a difference is beyond its error; None without one, of a single mission."""
    if cost.behind_sem is None:
        return None
    return abs(cost.behind) > CLEAR * cost.behind_sem


def has_stopped_early(run: TrainingRun, progress: Progress) -> bool:
    """Return whether a run stopped because it no longer learned, and not at its budget."""
    limits = run.limits
    is_left = limits.decisions is None or progress.decisions < limits.decisions
    return is_left and progress.has_stalled(limits.patience)


def _row(progress: Progress) -> str:
    row = progress.curve[-1]
    note = "  best so far" if row is progress.best else ""
    compared = selection.differences(row.references)
    others = ""
    for name, age in selection.reference_ages(row.references).items():
        others += f"  {name} {age:.2f}"
        if name in compared:
            error = compared[name].behind_sem
            spread = "" if error is None else f" ± {error:.2f}"
            others += f" ({compared[name].behind:+.2f}{spread})"
    when = f"{row.decisions:>11,} decisions {row.minutes:7.1f} min"
    age = _amount(_age(row), AOI).removesuffix(f" {AOI.unit}")
    return f"{when}   held-out age {age}{note:13}{others}"


def _text(status: Status) -> str:
    progress = status.progress
    parts = [f"{progress.decisions:,} decisions"]
    if status.evaluated is not None:
        parts.append(f"missions {status.evaluated:.0%}")
    elif not math.isnan(status.aoi):
        parts.append(f"age {status.aoi:.1f}")
    if progress.curve:
        parts.append(f"held out {progress.curve[-1].costs.aoi:.1f}")
    return ", ".join(parts)


def _age(row: CurveRow) -> Cost:
    return Cost(mean=row.costs.aoi, sem=row.costs.aoi_sem)


def _reference_ages(row: CurveRow) -> dict[str, Cost]:
    """Return the ages of reference policies that were flown on the same missions [windows]."""
    ages: dict[str, Cost] = {}
    for name, age in selection.reference_ages(row.references).items():
        ages[name] = Cost(mean=age, sem=None)
    return ages


def _amount(cost: Cost, kind: MissionCost) -> str:
    """Return how much of a kind of cost it was, with its standard error and its unit."""
    digits = kind.digits
    spread = "" if cost.sem is None else f" ± {cost.sem:.{digits}f}"
    return f"{cost.mean:.{digits}f}{spread} {kind.unit}"
