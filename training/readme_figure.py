"""The README's chart: the age of walking teams by their size, of the policies in its table.

    python training/readme_figure.py

Writes assets/figures/readme.svg and .png. The paper trained two GNNs for this figure; the chart,
like the table, has the better one at each team size.
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
from swarm_mj.evaluation.figures.style import BETTER, draw_to
from swarm_mj.evaluation.published import TEAM_SIZE
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting

ROOT = Path(__file__).resolve().parent.parent
POLICIES = ("planner", "sotdma", "index-csma", "gnn", "tdma", "random-flooding")
PUBLISHED = ("GNN trained at each size", "GNN generalized from 40")


@dataclass(frozen=True, kw_only=True)
class ReadmeFigure:
    """Where the figure goes, and where its numbers are."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "readme",
        "the files, without their endings",
        shown="assets/figures/readme",
    )
    results: Path = setting(
        ROOT / "training" / "results" / "paper-random-walk.csv",
        "the results",
        metavar="FILE",
        shown="training/results/paper-random-walk.csv",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        draw_to(self.out, self._draw)
        return DONE

    def _draw(self) -> Figure:
        return draw(read_results(self.results))


def draw(results: Sequence[Result]) -> Figure:
    """Draw the curves of the table; raise ValueError if the results are not of walking teams."""
    chosen = [result for result in results if result.policy in POLICIES]
    found = results_of(TEAM_SIZE, chosen)
    [panel] = TEAM_SIZE.panels
    every = curves(TEAM_SIZE, panel.cost, found)
    ours = [curve for curve in every if not curve.is_published]
    theirs = [curve for curve in every if curve.is_published and curve.method in PUBLISHED]
    return draw_curves(TEAM_SIZE, found, [[better(theirs), *ours]])


def better(theirs: Sequence[Curve]) -> Curve:
    """Return the lowest of curves over the same x at each, as one."""
    mean = np.stack([curve.mean for curve in theirs])
    sem = np.stack([curve.sem for curve in theirs])
    lowest = np.argmin(mean, axis=0)
    at = np.arange(len(lowest))
    return replace(theirs[0], method=BETTER, mean=mean[lowest, at], sem=sem[lowest, at])


if __name__ == "__main__":
    sys.exit(script(ReadmeFigure, ReadmeFigure.__call__))
