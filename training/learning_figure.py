"""The learning curve of the shipped policy as a figure.

    python training/learning_figure.py

Writes assets/figures/learning.svg and .png.
"""

import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.style import CAPTION, FAINT, WIDTH_IN, look_of, save, styled
from swarm_mj.evaluation.results import read_results
from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_rows
from swarm_mj.system.writing import Output, check_outputs

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "training" / "results" / "learning"
MOST_BYTES = 10_000_000
SCHEDULES = ("tdma", "spatial-tdma")
TITLE = "Training the shipped gnn: mean over teams of 20, 40 and 80 robots at rest"
SAID = (
    "Curve: 12 held-out missions a size, mean ± SEM. Levels: 8 missions a size from seed 3000. "
    "training/shipped_gnn.py, seed 1, commit e15dd2968009"
)
HEIGHT_IN = 3.1 + 0.45  # of the axes, of the caption below
PALE, BAND = 0.85, 0.15  # of the line, of its standard error
HEADROOM = 1.05  # the axis ends above the highest age, by so much
COLUMNS = ("minutes", "aoi", "aoi_sem")


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
        figure = draw(read_curve(self.results / "rest-curve.csv"), self._levels())
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


def read_curve(path: Path) -> dict[str, np.ndarray]:
    """Return the columns of a learning curve that are drawn, by their names.

    Raises:
        ValueError: It cannot be read, or is no learning curve.
    """
    _, rows = read_rows(path, "learning curve", MOST_BYTES)
    try:
        curve = {name: np.array([float(row[name]) for _, row in rows]) for name in COLUMNS}
    except (KeyError, ValueError) as error:
        raise ValueError(f"{path} is no learning curve with {', '.join(COLUMNS)}") from error
    if not rows or not all(np.all(np.isfinite(numbers)) for numbers in curve.values()):
        raise ValueError(f"{path} is no learning curve: it needs finite numbers, a row or more")
    return curve


def draw(curve: Mapping[str, np.ndarray], levels: Mapping[str, float]) -> Figure:
    """Draw the curve over the minutes of training, and the levels of other policies."""
    with styled():
        drawing = Figure(figsize=(WIDTH_IN, HEIGHT_IN), layout="constrained")
        axes = drawing.subplots()
        age, sem = curve["aoi"], curve["aoi_sem"]
        colour = look_of("gnn").colour
        axes.plot(curve["minutes"], age, color=colour, alpha=PALE, label="gnn (T, M, P only)")
        band = {"color": colour, "alpha": BAND, "linewidth": 0.0}
        axes.fill_between(curve["minutes"], age - sem, age + sem, **band)
        for policy, level in levels.items():
            _draw_level(axes, policy, level)
        axes.set_title(TITLE, loc="left")
        axes.set_xlabel("minutes of training")
        axes.set_ylabel("age of information [windows]")
        axes.set_ylim(0.0, HEADROOM * max(*age, *levels.values()))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.legend(loc="upper right", frameon=False, fontsize=8)
        drawing.supxlabel(SAID, x=0.01, ha="left", fontsize=7, color=FAINT, gid=CAPTION)
    return drawing


def _draw_level(axes: Axes, policy: str, level: float) -> None:
    """Draw a dotted line, named with its cost beside the axes."""
    look = look_of(policy)
    axes.axhline(level, color=look.colour, linewidth=0.9, linestyle=(0, (1, 1.5)))
    axes.annotate(
        f"{look.label} {level:.1f}",
        (1.01, level),
        xycoords=("axes fraction", "data"),
        color=look.ink,
        fontsize=8,
        va="center",
        annotation_clip=False,
    )


if __name__ == "__main__":
    sys.exit(script(LearningFigure, LearningFigure.__call__))
