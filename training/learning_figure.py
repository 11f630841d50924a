"""The learning curves under training/results/learning as one figure.

    python training/learning_figure.py

Writes assets/figures/learning.svg and .png.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from learning import RESULTS

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.learning import LearningCurve, LearningPanel, Level, draw_learning
from swarm_mj.evaluation.figures.style import save
from swarm_mj.evaluation.results import read_results
from swarm_mj.fields import setting

PURPLE, ORANGE, BLUE = "#aa3377", "#d55e00", "#0072b2"
PUBLISHED_GNN = 34.8  # Fig. 4 at range ratio 0.25, in the authors' simulator [windows]


@dataclass(frozen=True, kw_only=True)
class LearningFigure:
    """Where the figure goes, where its numbers are, and how its panels are headed."""

    out: Path = setting(Path("assets/figures/learning"), "the files, without their endings")
    results: Path = setting(RESULTS, "where the experiments left theirs", metavar="DIR")
    robot_title: str = "40 stationary robots, preset paper, credit per robot: lines are seeds"
    arms_title: str = "10 stationary robots, preset reference, credit per robot and per team"

    def __call__(self) -> int:
        """Draws it."""
        robot_40 = self._levels("robot-40", ("tdma", "spatial-tdma"))
        both = self._levels("both-arms-10", ("tdma", "mst"))
        panels = [
            LearningPanel(
                title=self.robot_title,
                x="minutes",
                curves=(
                    self._curve("with turns", PURPLE, "robot-40-extended-seed*"),
                    self._curve("without turns (local)", ORANGE, "robot-40-local-seed*"),
                ),
                levels=(*robot_40, Level(policy="GNN", label="published GNN", aoi=PUBLISHED_GNN)),
            ),
            LearningPanel(
                title=self.arms_title,
                x="decisions",
                curves=(
                    self._curve("per robot", PURPLE, "robot-10-reference-seed*"),
                    self._curve(
                        "per robot, authors' features", ORANGE, "robot-seven-10-reference-seed*"
                    ),
                    self._curve("per team", BLUE, "team-10-reference-seed*"),
                ),
                levels=both,
            ),
        ]
        caption = "Held-out missions, mean ± SEM over 12; training/robot_arm.py, both_arms.py"
        figure = draw_learning(panels, caption)
        for kind in ("svg", "png"):
            save(figure, self.out.with_suffix(f".{kind}"))
        return 0

    def _curve(self, label: str, colour: str, pattern: str) -> LearningCurve:
        files = tuple(sorted(self.results.glob(f"{pattern}-curve.csv")))
        return LearningCurve(label=label, colour=colour, files=files)

    def _levels(self, name: str, policies: tuple[str, ...]) -> tuple[Level, ...]:
        costs = {each.policy: each.aoi_mean for each in read_results(self.results / f"{name}.csv")}
        return tuple(Level(policy=policy, aoi=costs[policy]) for policy in policies)


if __name__ == "__main__":
    sys.exit(script(LearningFigure, LearningFigure.__call__))
