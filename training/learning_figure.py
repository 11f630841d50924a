"""The learning curve of the shipped policy as a figure.

    python training/learning_figure.py

Writes assets/figures/learning.svg and .png.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

import numpy as np

from swarm_mj.api.charts import draw_learning
from swarm_mj.cli import script
from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.evaluation.figures.style import save
from swarm_mj.evaluation.results import read_results
from swarm_mj.learning.run_folder import read_curve
from swarm_mj.system.fields import setting
from swarm_mj.system.writing import Output, check_outputs

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "training" / "results" / "learning"
SCHEDULES = ("tdma", "spatial-tdma")
LABEL = "the shipped gnn, mean over teams of 20, 40 and 80 robots at rest"
SAID = (
    "Curve: 12 held-out missions a size, mean ± SEM. Levels: 8 missions a size from seed 3000. "
    "training/shipped_gnn.py, seed 1, commit e15dd2968009"
)


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
        "where the experiment left them",
        metavar="DIR",
        shown="training/results/learning",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        paths = [self.out.with_name(f"{self.out.name}.{kind}") for kind in ("svg", "png")]
        check_outputs(*(Output("figure", path) for path in paths))
        quiet_matplotlib()
        rows = read_curve(self.results / "rest-curve.csv")
        age, error = (np.array([row[name] for row in rows]) for name in ("aoi", "aoi_sem"))
        decisions = np.array([row["decisions"] for row in rows])
        lines = {LABEL: np.array([decisions, age, age - error, age + error])}
        figure = draw_learning(lines, self._levels(), SAID)
        for path in paths:
            save(figure, path)
        return 0

    def _levels(self) -> dict[str, float]:
        """Return the schedules' ages, means over the same team sizes [windows]."""
        results = read_results(self.results / "candidates-rest.csv")
        return {
            name: mean(result.aoi_mean for result in results if result.policy == name)
            for name in SCHEDULES
        }


if __name__ == "__main__":
    sys.exit(script(LearningFigure, LearningFigure.__call__))
