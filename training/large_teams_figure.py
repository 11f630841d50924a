"""A chart of the age of walking teams by their size, from 10 to 1000 robots.

    make results STUDIES="large-teams large-teams-small"
    python training/large_teams_figure.py

Writes assets/figures/large-teams.svg and .png from `large-teams-small.csv` (10 to 80 robots) and
`large-teams.csv` (200 to 1000). `table` has the same numbers, and the exponents of age over size.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.curves import Curve, curves, results_of
from swarm_mj.evaluation.figures.drawing import draw_curves
from swarm_mj.evaluation.figures.style import FAINT, draw_to
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.evaluation.published import TEAM_SIZE
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.protocol.mission_costs import AOI
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting

ROOT = Path(__file__).resolve().parent.parent
FILES = ("large-teams-small.csv", "large-teams.csv")
FIGURE = replace(TEAM_SIZE, title="From 10 to 1000 robots", x_scale="log")
LARGE = 200  # robots, from which the exponents are fitted
AT_10 = 4.0  # windows of age: where the line of the diameter begins


@dataclass(frozen=True, kw_only=True)
class LargeTeamsFigure:
    """Where the figure goes."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "large-teams",
        "the files, without their endings",
        shown="assets/figures/large-teams",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        draw_to(self.out, lambda: draw(read(ROOT / "training" / "results")))
        return DONE


def read(folder: Path) -> list[Result]:
    """Return the results of teams of all sizes."""
    return [result for name in FILES for result in read_results(folder / name)]


def table(folder: Path) -> str:
    """Return Markdown: ages by size, and exponents; the lowest at the largest shared size first."""
    found = {(r.policy, r.num_robots): r for r in read(folder)}
    policies = list(dict.fromkeys(policy for policy, _ in found))
    sizes = sorted({size for _, size in found})
    shared = max(n for n in sizes if all((policy, n) in found for policy in policies))
    head = ["policy", f"{sizes[0]} robots", *map(str, sizes[1:]), "exponent"]
    rows: list[list[str]] = []
    for policy in sorted(policies, key=lambda policy: found[policy, shared].aoi_mean):
        its = {n: found[policy, n] for n in sizes if (policy, n) in found}
        ages = np.array([each.aoi_mean for each in its.values()])
        power = f"{exponent(np.array([*its], float), ages):.2f}" if max(its) > LARGE else ""
        cells = (f"{its[n].aoi_mean:.1f} ± {its[n].aoi_sem:.1f}" if n in its else "" for n in sizes)
        rows.append([f"`{policy}`", *cells, power])
    return markdown_table(head, rows)


def own_curves(found: Sequence[Result]) -> list[Curve]:
    """Return the policies' curves without the published ones."""
    every = curves(FIGURE, AOI, results_of(FIGURE, found))
    return [curve for curve in every if not curve.is_published]


def exponent(sizes: Float[np.ndarray, "X"], ages: Float[np.ndarray, "X"]) -> float:
    """Return p of c N^p, the least squares in logarithms over large teams."""
    is_large = sizes >= LARGE
    return float(np.polyfit(np.log(sizes[is_large]), np.log(ages[is_large]), 1)[0])


def draw(found: Sequence[Result]) -> Figure:
    """Draw the curves, and how the diameter of a team grows, with the root of its size."""
    figure = draw_curves(FIGURE, results_of(FIGURE, found), [own_curves(found)])
    (axes,) = figure.axes
    ends = np.array([10.0, 1000.0])
    axes.plot(ends, AT_10 * np.sqrt(ends / ends[0]), ":", color=FAINT)
    axes.annotate("grows as the diameter", (300.0, 18.0), color=FAINT, fontsize=8)
    return figure


if __name__ == "__main__":
    sys.exit(script(LargeTeamsFigure, LargeTeamsFigure.__call__))
