"""The learning curves under training/results/learning as one figure.

    python training/learning_figure.py

Writes assets/figures/learning.svg and .png.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

from learning import RESULTS, run

from swarm_mj.evaluation.figures.learning import LearningCurve, LearningPanel, Level, draw_learning
from swarm_mj.evaluation.figures.style import save
from swarm_mj.evaluation.results import read_results

PURPLE, ORANGE, BLUE = "#aa3377", "#d55e00", "#0072b2"
PUBLISHED_GNN = 34.8  # Fig. 4 at range ratio 0.25, in the authors' simulator [windows]


@dataclass(frozen=True, kw_only=True)
class LearningFigure:
    """Where the figure goes, and how its panels are headed."""

    out: Path = Path("assets/figures/learning")
    robot_title: str = "40 stationary robots, preset paper, arm robot: lines are seeds"
    arms_title: str = "10 stationary robots, preset reference, both arms"

    def __call__(self) -> None:
        """Draws it."""
        robot_40 = _levels("robot-40", ("tdma", "spatial-tdma"))
        both = _levels("both-arms-10", ("tdma", "mst"))
        panels = [
            LearningPanel(
                title=self.robot_title,
                x="minutes",
                curves=(
                    _curve("with turns", PURPLE, "robot-40-extended-seed*"),
                    _curve("without turns (local)", ORANGE, "robot-40-local-seed*"),
                ),
                levels=(*robot_40, Level(policy="GNN", label="published GNN", aoi=PUBLISHED_GNN)),
            ),
            LearningPanel(
                title=self.arms_title,
                x="decisions",
                curves=(
                    _curve("arm robot", PURPLE, "robot-10-reference-seed*"),
                    _curve(
                        "arm robot, authors' features", ORANGE, "robot-seven-10-reference-seed*"
                    ),
                    _curve("arm team", BLUE, "team-10-reference-seed*"),
                ),
                levels=both,
            ),
        ]
        caption = "Held-out missions, mean ± SEM over 12; training/robot_arm.py, both_arms.py"
        figure = draw_learning(panels, caption)
        for kind in ("svg", "png"):
            save(figure, self.out.with_suffix(f".{kind}"))


def _curve(label: str, colour: str, pattern: str) -> LearningCurve:
    files = tuple(sorted(RESULTS.glob(f"{pattern}-curve.csv")))
    return LearningCurve(label=label, colour=colour, files=files)


def _levels(name: str, policies: tuple[str, ...]) -> tuple[Level, ...]:
    costs = {each.policy: each.aoi_mean for each in read_results(RESULTS / f"{name}.csv")}
    return tuple(Level(policy=policy, aoi=costs[policy]) for policy in policies)


if __name__ == "__main__":
    sys.exit(run(LearningFigure()))
