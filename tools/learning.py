"""The learning curves of `docs/training.md` as a table, of the runs that `reproduce.py` kept."""

import json
from pathlib import Path

from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.system.reading import read_rows

ROOT = Path(__file__).resolve().parent.parent
TRAINED = ROOT / "training" / "reproduce" / "quick" / "tutorial"
RUNS = {"turns-1": "with turns", "local-1": "without turns"}


def table(_results: Path, trained: Path = TRAINED) -> str:
    """Return the held-out ages of both runs as Markdown, with the origin of the numbers below.

    Raises ValueError if a run is missing, or the runs differ in their commit or held-out missions.
    """
    ages = {name: _ages(trained / "curves.csv", name) for name in RUNS}
    first, *_ = ages.values()
    lines: list[list[str]] = []
    for decisions, (minutes, _) in first.items():
        shown_ages = [each.get(decisions, ("", ""))[1] for each in ages.values()]
        lines.append([f"{decisions:,}", minutes, *shown_ages])
    shown = markdown_table(["team decisions", "minutes", *RUNS.values()], lines)
    return f"{shown}\n\n{_origin(trained / 'trainings.csv')}"


def _ages(path: Path, run: str) -> dict[int, tuple[str, str]]:
    """Return a run's minutes and ages [windows] by its team decisions."""
    rows = [row for _, row in read_rows(path, "learning curves")]
    found = {
        int(float(row["decisions"])): (
            f"{float(row['minutes']):.1f}",
            f"{float(row['aoi']):.1f} ± {float(row['aoi_sem']):.1f}",
        )
        for row in rows
        if row["training"] == run
    }
    if not found:
        raise ValueError(f"{path} has no run {run}")
    return found


def _origin(path: Path) -> str:
    """Return who made the numbers, and how to make them again."""
    rows = [row for _, row in read_rows(path, "trainings") if row["training"] in RUNS]
    held_out = {json.loads(row["settings"])["held_out"] for row in rows}
    commits = {row["commit"] for row in rows}
    if len(held_out) != 1 or len(commits) != 1:
        raise ValueError(f"the runs of {path} must be of one commit and one number of missions")
    return (
        f"*Age of information [windows] in {held_out.pop()} held-out missions, mean ± standard "
        f"error; commit {commits.pop()}. `python training/reproduce.py --figures tutorial --force` "
        "trains them again.*"
    )
