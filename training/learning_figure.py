"""The learning curve of the shipped policy as a figure.

    python training/learning_figure.py

Writes assets/figures/learning.svg and .png.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

import numpy as np

from swarm_mj.api.charts import LearningCurve, draw_learning
from swarm_mj.cli import script
from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.evaluation.figures.style import save
from swarm_mj.evaluation.results import Result
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.learning.run_folder import read_curve
from swarm_mj.system.fields import setting
from swarm_mj.system.writing import Output, check_outputs

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "training" / "results"
CURVE = "learning/rest-curve.csv"  # of the shipped weights' training
SCHEDULES = ("tdma", "spatial-tdma")
SIZES = (20, 40, 80)  # of the teams that they were trained on
LABEL = "the shipped gnn, mean over teams of 20, 40 and 80 robots at rest"
TRAINED = "12 held-out missions a size, mean ± SEM, seed 1, commit e15dd2968009"


@dataclass(frozen=True, kw_only=True)
class LearningFigure:
    """Where the figure goes, and where its numbers are."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "learning",
        "the files, without their endings",
        shown="assets/figures/learning",
    )
    results: Path = setting(
        RESULTS,
        "where they are",
        metavar="DIR",
        shown="training/results",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        paths = [self.out.with_name(f"{self.out.name}.{kind}") for kind in ("svg", "png")]
        check_outputs(*(Output("figure", path) for path in paths))
        quiet_matplotlib()
        rows = read_curve(self.results / CURVE)
        age = np.array([row.aoi for row in rows])
        error = np.array([row.aoi_sem for row in rows])
        decisions = np.array([row.decisions for row in rows])
        curve = LearningCurve(decisions=decisions, age=age, low=age - error, high=age + error)
        levels = read_levels(self.results / "shipped-gnn.csv")
        figure = draw_learning({LABEL: curve}, ages(levels), caption(levels))
        for path in paths:
            save(figure, path)
        return 0


def read_levels(path: Path) -> list[Result]:
    """Return the schedules' results in the teams that the policy was trained on.

    Raises ValueError if the file cannot be read, or some of them are missing.
    """
    found = [
        result
        for result in read_results(path)
        if result.policy in SCHEDULES
        and (result.task, result.num_robots in SIZES) == ("stationary", True)
    ]
    if len(found) != len(SCHEDULES) * len(SIZES):
        raise ValueError(f"{path} must have {' and '.join(SCHEDULES)} in teams of {SIZES} at rest")
    return found


def ages(levels: Sequence[Result]) -> dict[str, float]:
    """Return each schedule's age, the mean over the team sizes [windows]."""
    return {
        name: mean(result.aoi_mean for result in levels if result.policy == name)
        for name in SCHEDULES
    }


def caption(levels: Sequence[Result]) -> str:
    """Return the missions and the commits of the curve and of the levels."""
    first = levels[0]
    return (
        f"Curve: {TRAINED}. "
        f"Levels: {first.episodes} missions a size from seed {first.seed}, commit {first.commit}"
    )


if __name__ == "__main__":
    sys.exit(script(LearningFigure, LearningFigure.__call__))
