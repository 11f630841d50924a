"""A chart of the age of walking teams by their size, from 10 to 1000 robots.

    swarm-mj evaluate --task random-walk --robots 10 20 40 80 --seed 3000 --episodes 8 \
      --policy planner age-gain-csma sotdma gnn spatial-tdma gossip csma tdma random-flooding \
      --csv small.csv
    swarm-mj evaluate --task random-walk --robots 200 400 1000 --seed 3000 --episodes 8 \
      --policy age-gain-csma spatial-tdma gossip csma tdma random-flooding --csv large.csv
    python training/large_teams_figure.py

training/results/large-random-walk.csv holds the rows of both. Writes assets/figures/large-teams.svg
and .png, and prints the exponents of age over size from 200 robots on.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.curves import Curve, curves, results_of
from swarm_mj.evaluation.figures.drawing import draw_curves
from swarm_mj.evaluation.figures.style import FAINT, save
from swarm_mj.evaluation.published import TEAM_SIZE
from swarm_mj.evaluation.results import Result, read_results
from swarm_mj.system.fields import setting
from swarm_mj.system.terminal import plain_console

ROOT = Path(__file__).resolve().parent.parent
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
        """Draw the figure and print exponents; return the exit code."""
        found = read_results(ROOT / "training" / "results" / "large-random-walk.csv")
        for curve in own_curves(found):
            if curve.x[-1] > LARGE:
                plain_console().print(f"{curve.method}: N^{exponent(curve):.2f}")
        for kind in ("svg", "png"):
            save(draw(found), self.out.with_name(f"{self.out.name}.{kind}"))
        return 0


def own_curves(found: Sequence[Result]) -> list[Curve]:
    """Return the policies' curves without the published ones."""
    every = curves(FIGURE, "aoi", results_of(FIGURE, found))
    return [curve for curve in every if not curve.is_published]


def exponent(curve: Curve) -> float:
    """Return p of c N^p, the least squares in logarithms over large teams."""
    is_large = curve.x >= LARGE
    return float(np.polyfit(np.log(curve.x[is_large]), np.log(curve.mean[is_large]), 1)[0])


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
