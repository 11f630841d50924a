"""Teams at rest between what no policy can go below and what a search has found (Fig. 4).

    python training/limits_figure.py

Draws assets/figures/policies/fig4.svg and .png from `training/results/`: the package's policies,
the floor of `bounds.py`, proven for every policy, and the schedules of `ceiling.py`. Also makes the
tables of `docs/bounds.md` from the same results.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.figure import Figure

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.curves import Curve, curves, results_of
from swarm_mj.evaluation.figures.drawing import draw_curves
from swarm_mj.evaluation.figures.style import save
from swarm_mj.evaluation.published import RESULT_FIGURES
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_rows
from swarm_mj.system.writing import Output, check_outputs

ROOT = Path(__file__).resolve().parent.parent
MOST_BYTES = 10_000_000
SEARCHED, PLANNER = "training.ceiling:Annealed", "planner --payload none"
FIGURE = RESULT_FIGURES["fig4"]
METHODS = (
    *("planner", "planner --payload none", "gnn", "spatial-tdma", "tdma", "gossip", "aloha"),
    *("random-flooding", "sotdma", "age-gain-csma"),
)


@dataclass(frozen=True, kw_only=True)
class LimitsFigure:
    """Where the figure goes, and where its numbers are."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "policies" / "fig4",
        "the files, without their endings",
        shown="assets/figures/policies/fig4",
    )
    results: Path = setting(
        ROOT / "training" / "results", "where they are", metavar="DIR", shown="training/results"
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        paths = [self.out.with_name(f"{self.out.name}.{kind}") for kind in ("svg", "png")]
        check_outputs(*(Output("figure", path) for path in paths))
        figure = draw_limits(
            read_results(self.results / "paper-stationary.csv"),
            read_results(self.results / "ceiling.csv"),
            *read_floor(self.results / "floor.csv"),
        )
        for path in paths:
            save(figure, path)
        return 0


def read_floor(path: Path) -> tuple[Curve, str]:
    """Return the mean floor by range ratio, and its commit.

    Raises ValueError if the file cannot be read, or is not of one commit.
    """
    rows = [row for _, row in read_rows(path, "table of floors", MOST_BYTES)]
    found: dict[float, list[float]] = {}
    for row in rows:
        found.setdefault(float(row["range_ratio"]), []).append(float(row["floor_windows"]))
    made_by, *others = {row["commit"] for row in rows}
    if others:
        raise ValueError(f"{path} must be of one commit, not {', '.join([made_by, *others])}")
    x = np.array(sorted(found))
    return Curve(
        method="floor",
        x=x,
        mean=np.array([np.mean(found[ratio]) for ratio in x]),
        sem=np.array([np.std(found[r], ddof=1) / math.sqrt(len(found[r])) for r in x]),
    ), made_by


def table(folder: Path) -> str:
    """Return floor, searched schedule and planner by range ratio, as Markdown for docs/bounds.md.

    Raises ValueError if a table lacks a range ratio that the floor has.
    """
    floor, _ = read_floor(folder / "floor.csv")
    ratios = floor.x.tolist()
    searched = _steady(folder / "ceiling.csv", SEARCHED, ratios)
    planner = _steady(folder / "paper-stationary.csv", PLANNER, ratios)
    both = list(zip(searched, planner, strict=True))
    rows = [
        ["range ratio", *(f"{ratio:g}" for ratio in ratios)],
        ["---"] * (len(ratios) + 1),
        ["proven floor", *(f"{age:.2f}" for age in floor.mean)],
        ["searched schedule, steady state", *map(_age, searched)],
        [f"`{PLANNER}`, steady state", *map(_age, planner)],
        [
            "floor / searched schedule",
            *(f"{low / its.mean:.2f}" for low, its in zip(floor.mean, searched, strict=True)),
        ],
        ["searched schedule / planner", *(f"{its.mean / ours.mean:.2f}" for its, ours in both)],
    ]
    return _markdown(rows)


class _Age(NamedTuple):
    mean: float
    sem: float


def _steady(path: Path, policy: str, ratios: Sequence[float]) -> list[_Age]:
    """Return a policy's age in the second half of the missions, by range ratio."""
    found = {
        result.range_ratio: _Age(result.aoi_steady_mean, result.aoi_steady_sem or math.nan)
        for result in read_results(path)
        if result.policy == policy
    }
    if missing := [f"{ratio:g}" for ratio in ratios if ratio not in found]:
        raise ValueError(f"{path} has no {policy} at range ratio {', '.join(missing)}")
    return [found[ratio] for ratio in ratios]


def _age(age: _Age) -> str:
    return f"{age.mean:.2f} ± {age.sem:.2f}"


def exact_table(folder: Path) -> str:
    """Return floor and optimum of small teams, as Markdown for docs/bounds.md."""
    teams = [row for _, row in read_rows(folder / "exact.csv", "table of optima", MOST_BYTES)]
    rows = [
        ["team, a packet reaching 250 m", "floor [windows]", "optimum [windows]", "floor / optimum"]
    ]
    rows.append(["---"] * len(rows[0]))
    for team in teams:
        floor, optimum, ratio = (
            float(team[name]) for name in ("floor_windows", "optimum_windows", "ratio")
        )
        rows.append([team["team"], f"{floor:.3f}", f"{optimum:.3f}", f"{ratio:.2f}"])
    commits = " and ".join(sorted({team["commit"] for team in teams}))
    return (
        f"{_markdown(rows)}\n\n*From `exact`; commit {commits}. `make results STUDIES=floor` "
        "computes them again.*"
    )


def _markdown(rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def draw_limits(
    results: Sequence[Result], searched: Sequence[Result], floor: Curve, made_by: str
) -> Figure:
    """Draw the policies' curves between the searched schedule and the floor, of fewer missions.

    The floor's commit stands below with theirs.
    """
    found = [result for result in results_of(FIGURE, results) if result.policy in METHODS]
    (panel,) = FIGURE.panels
    shown = [curve for curve in curves(FIGURE, panel.cost, found) if curve.method in METHODS]
    ceiling = curves(FIGURE, panel.cost, results_of(FIGURE, searched))
    shown += [curve for curve in ceiling if curve.method == SEARCHED]
    return draw_curves(FIGURE, [*found, replace(found[0], commit=made_by)], [[*shown, floor]])


if __name__ == "__main__":
    sys.exit(script(LimitsFigure, LimitsFigure.__call__))
