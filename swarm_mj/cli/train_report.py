"""What `swarm-mj train` says of the policy it kept: its age beside others', and where it loses."""

from swarm_mj.cli.train_progress import age_of, oracle_missions, reference_ages
from swarm_mj.learning.choice import (
    ORACLE,
    ORACLE_ROBOTS,
    REFERENCES,
    Cost,
    has_stalled,
)
from swarm_mj.learning.run_folder import Progress, Run

CLEAR = 2.0  # standard errors, of a difference that is not for chance
NAMES = {"first": "the policy it began with"}


def report(run: Run, progress: Progress) -> dict[str, str]:
    """Rows for the closing table: what was kept, and what others cost on the same missions."""
    if progress.best is None:
        return {}
    if progress.choice is None:
        return _of_evaluations(run, progress)
    choice = progress.choice
    rows = {"missions": f"{choice.num_missions} of each team size, which chose nothing"}
    rows["policy kept"] = f"{_cost(run, choice.kept)}, after {choice.decisions:,} decisions"
    for name, cost in choice.others.items():
        known = f"; {REFERENCES[name]}" if name in REFERENCES else ""
        rows[NAMES.get(name, name)] = f"{_cost(run, cost)}{known}"
    return rows | _oracle(run, progress)


def verdicts(run: Run, progress: Progress) -> list[str]:
    """What a reader should know beyond the numbers: losses, and how far the choice is fair."""
    said, patience = [], run.limits.patience
    if has_stopped_early(run, progress):
        way_on = " --resume --patience 0 trains on." if progress.has_chosen else ""
        said.append(f"Stopped early: the last {patience} evaluations brought no gain.{way_on}")
    choice = progress.choice
    if choice is None:
        if progress.best is not None:
            said.append(
                "The policy kept is the best of the evaluations, on the same missions: its age "
                "flatters. A run that ends chooses on others."
            )
        return said
    if choice.decisions == 0:
        begun = "the policy given by --init" if run.init else "the untrained policy"
        said.append(f"Training did not help: {begun} did best, and is the one kept.")
    return said + [
        f"The policy kept {_stands(run, name, cost)} on the same missions."
        for name, cost in choice.others.items()
        if cost.behind > 0.0
    ]


def has_stopped_early(run: Run, progress: Progress) -> bool:
    """Whether a run stopped because it no longer learned, and not at its budget."""
    limits = run.limits
    is_left = limits.decisions is None or progress.decisions < limits.decisions
    return is_left and has_stalled(progress.curve, limits.patience)


def _of_evaluations(run: Run, progress: Progress) -> dict[str, str]:
    """Of a run that has not chosen."""
    best, first = progress.best, progress.curve[0]
    assert best is not None
    decisions = "untrained" if best is first else f"after {best['decisions']:,.0f} decisions"
    rows = {"missions": f"{run.training.held_out} of each team size, which chose the policy"}
    rows["policy kept"] = f"{age_of(best)} windows, {decisions}"
    rows[NAMES["first"]] = f"{age_of(first)} windows"
    for name, age in reference_ages(best).items():
        rows[name] = f"{age:.2f} windows; {REFERENCES[name]}"
    return rows | _oracle(run, progress)


def _oracle(run: Run, progress: Progress) -> dict[str, str]:
    """Return the oracle flies missions of the evaluations only, and few of them."""
    age, its_missions = reference_ages(progress.curve[0]).get(ORACLE), oracle_missions(run.training)
    if age is not None:
        told = f"{age:.2f} windows, on {its_missions} of the evaluations; {REFERENCES[ORACLE]}"
        return {ORACLE: told}
    if max(run.training.robots) > ORACLE_ROBOTS:
        return {ORACLE: f"not flown: it would take long with more than {ORACLE_ROBOTS} robots"}
    return {}


def _cost(run: Run, cost: Cost) -> str:
    return _with_error(run, cost.mean, cost.sem)


def _stands(run: Run, name: str, cost: Cost) -> str:
    """How it stands beside another, which costs less."""
    behind = _with_error(run, cost.behind, cost.behind_sem)
    if cost.behind_sem is not None and cost.behind > CLEAR * cost.behind_sem:
        return f"loses to {NAMES.get(name, name)} by {behind}"
    return f"is no better than {NAMES.get(name, name)}, which is ahead by {behind}"


def _with_error(run: Run, value: float, error: float | None) -> str:
    """In the unit of what the run lowers."""
    unit, digits = ("windows", 2) if run.training.cost == "aoi" else ("m²/s²", 4)
    spread = "" if error is None else f" ± {error:.{digits}f}"
    return f"{value:.{digits}f}{spread} {unit}"
