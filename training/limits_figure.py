"""Teams at rest between what no policy can go below and what a search has found (Fig. 4).

    python training/limits_figure.py

Draws assets/figures/policies/fig4.svg and .png from `training/results/`: the package's policies,
the floor of `bounds.py`, proven for every policy, and the schedules of `ceiling.py`. Also makes the
tables of `docs/bounds.md`, from the same results.
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
from swarm_mj.evaluation.figures.style import draw_to
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.evaluation.missions_table import read_missions
from swarm_mj.evaluation.published import RESULT_FIGURES
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.evaluation.samples import standard_error
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_rows

ROOT = Path(__file__).resolve().parent.parent
SEARCHED, PLANNER = "training.ceiling:Annealed", "planner --payload none"
FIGURE = RESULT_FIGURES["fig4"]
METHODS = (
    *("planner", "planner --payload none", "gnn", "spatial-tdma", "tdma", "gossip", "aloha"),
    *("random-flooding", "sotdma", "index-csma", "age-gain-csma"),
)


LOOKAHEAD, GREEDY = "lookahead-oracle", "greedy-oracle"


@dataclass(frozen=True, kw_only=True)
class Compared:
    """Missions on which both oracles have flown."""

    head: str
    results: str  # without an ending
    where: dict[str, float | str]  # of the missions that these files have


COMPARED = (
    Compared(
        head="40 at rest, range ratio 0.25",
        results="paper-stationary",
        where={"task": "stationary", "range_ratio": 0.25},
    ),
    Compared(
        head="40 walking",
        results="paper-random-walk",
        where={"task": "random-walk", "num_robots": 40},
    ),
    Compared(
        head="80 walking",
        results="paper-random-walk",
        where={"task": "random-walk", "num_robots": 80},
    ),
    Compared(
        head="40 flocking, velocity ratio 0.15",
        results="paper-flocking",
        where={"task": "flocking", "velocity_ratio": 0.15},
    ),
    Compared(
        head="20 at rest among `blocks`",
        results="lookahead-blocks",
        where={"task": "stationary", "num_robots": 20},
    ),
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
        draw_to(self.out, self._draw)
        return DONE

    def _draw(self) -> Figure:
        return draw_limits(
            read_results(self.results / "paper-stationary.csv"),
            read_results(self.results / "ceiling.csv"),
            *read_floor(self.results / "floor.csv"),
        )


def read_floor(path: Path) -> tuple[Curve, str]:
    """Return the mean floor by range ratio, and its commit.

    Raises ValueError if the file cannot be read, or is not of one commit.
    """
    rows = [row for _, row in read_rows(path, "table of floors")]
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
    head = ["range ratio", *(f"{ratio:g}" for ratio in ratios)]
    rows = [
        ["proven floor", *(f"{age:.2f}" for age in floor.mean)],
        ["searched schedule, steady state", *map(_age, searched)],
        [f"`{PLANNER}`, steady state", *map(_age, planner)],
        [
            "floor / searched schedule",
            *(f"{low / its.mean:.2f}" for low, its in zip(floor.mean, searched, strict=True)),
        ],
        ["searched schedule / planner", *(f"{its.mean / ours.mean:.2f}" for its, ours in both)],
    ]
    return markdown_table(head, rows)


def oracles_table(folder: Path) -> str:
    """Return both oracles' costs and their differences, as Markdown for docs/bounds.md.

    Raises ValueError if they have not flown the same missions.
    """
    costs = (("age", "aoi", 2), ("velocity variance", "velocity_variance", 4))
    heads = []
    for label, _, _ in costs:
        heads += [f"{label}, `{LOOKAHEAD}`", f"`{GREEDY}`", "difference"]
    rows: list[list[str]] = []
    for compared in COMPARED:
        row = [compared.head]
        for _, column, digits in costs:
            if column == "aoi" or compared.where["task"] == "flocking":
                row += _both(compared, folder, column, digits)
            else:
                row += [""] * 3
        rows.append(row)
    return markdown_table(["missions", *heads], rows)


def _both(compared: Compared, folder: Path, column: str, digits: int) -> list[str]:
    """Return both oracles' costs and the difference, pair by pair, with standard errors."""
    path = folder / f"{compared.results}.parquet"
    ahead = _by_seed(path, LOOKAHEAD, compared, column)
    greedy = _by_seed(path, GREEDY, compared, column)
    if not ahead or ahead.keys() != greedy.keys():
        raise ValueError(f"both oracles must have flown the same missions of {compared.head}")
    pairs = [(ahead[seed], greedy[seed]) for seed in ahead]
    both = np.array(pairs)
    cells: list[str] = []
    for costs in (both[:, 0], both[:, 1], both[:, 0] - both[:, 1]):
        sem = standard_error(costs)
        cells.append(f"{np.mean(costs):.{digits}f} ± {math.nan if sem is None else sem:.{digits}f}")
    return cells


def _by_seed(path: Path, policy: str, compared: Compared, column: str) -> dict[int, float]:
    """Return a policy's costs by the missions' seeds."""
    rows = read_missions(path)
    rows = rows[rows["policy"] == policy]
    for name, value in compared.where.items():
        rows = rows[rows[name] == value]
    costs = dict(zip(rows["seed"].tolist(), rows[column].tolist(), strict=True))
    if len(costs) < len(rows):
        raise ValueError(f"{path} has several kinds of missions that are {compared.head}")
    return costs


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
    teams = [row for _, row in read_rows(folder / "exact.csv", "table of optima")]
    head = ["team, a packet reaching 250 m", "floor [windows]", "optimum [windows]"]
    head.append("floor / optimum")
    rows: list[list[str]] = []
    for team in teams:
        floor = float(team["floor_windows"])
        optimum = float(team["optimum_windows"])
        ratio = float(team["ratio"])
        rows.append([team["team"], f"{floor:.3f}", f"{optimum:.3f}", f"{ratio:.2f}"])
    commits = " and ".join(sorted({team["commit"] for team in teams}))
    again = "`make results STUDIES=floor` computes them again."
    return f"{markdown_table(head, rows)}\n\n*From `exact`; commit {commits}. {again}*"


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
