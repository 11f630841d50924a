"""The learning curve of the shipped policy as a figure.

    python training/learning_figure.py

Writes assets/figures/learning.svg and .png.
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.learning import LearningCurve, LearningPanel, Level, draw_learning
from swarm_mj.evaluation.figures.style import save
from swarm_mj.evaluation.results import read_results
from swarm_mj.fields import setting

RESULTS = Path("training/results/learning")
PURPLE = "#aa3377"
TITLE = "Training the shipped gnn: mean over teams of 20, 40 and 80 robots at rest"
CAPTION = (
    "Curve: 12 held-out missions a size, mean ± SEM. Levels: 8 missions a size from seed 3000. "
    "training/shipped_gnn.py, seed 1, commit e15dd2968009"
)


@dataclass(frozen=True, kw_only=True)
class LearningFigure:
    """Where the figure goes, and where its numbers are."""

    out: Path = setting(Path("assets/figures/learning"), "the files, without their endings")
    results: Path = setting(RESULTS, "where the experiment left them", metavar="DIR")

    def __call__(self) -> int:
        """Draws it."""
        curve = LearningCurve(
            label="gnn (T, M, P only)", colour=PURPLE, files=(self.results / "rest-curve.csv",)
        )
        panel = LearningPanel(title=TITLE, x="minutes", curves=(curve,), levels=self._levels())
        figure = draw_learning([panel], CAPTION)
        for kind in ("svg", "png"):
            save(figure, self.out.with_suffix(f".{kind}"))
        return 0

    def _levels(self) -> tuple[Level, ...]:
        """What the schedules cost, the mean over the same sizes of the team."""
        results = read_results(self.results / "candidates-rest.csv")
        return tuple(
            Level(policy=name, aoi=mean(r.aoi_mean for r in results if r.policy == name))
            for name in ("tdma", "spatial-tdma")
        )


if __name__ == "__main__":
    sys.exit(script(LearningFigure, LearningFigure.__call__))
