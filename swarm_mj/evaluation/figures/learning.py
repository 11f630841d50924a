"""Draws learning curves: held-out cost against team decisions or minutes, beside levels."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Literal

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from swarm_mj.evaluation.figures.style import CAPTION, FAINT, INK, WIDTH_IN, look_of, styled

PANEL_IN, CAPTION_IN = 3.1, 0.45
X_LABELS = {"decisions": "team decisions, thousands", "minutes": "minutes of training"}
X_UNITS = {"decisions": 1000.0, "minutes": 1.0}
PALE, BAND = 0.85, 0.15  # of lines, of their standard errors
LINES = ("-", "--", ":")  # of the seeds of one method
MOST_AGE = 1.25  # the axis ends above the highest level, by so much; curves may begin above it


@dataclass(frozen=True, kw_only=True)
class LearningCurve:
    """One method's runs, one file a seed."""

    label: str
    colour: str
    files: tuple[Path, ...]  # that `swarm-mj train` wrote as curve.csv


@dataclass(frozen=True, kw_only=True)
class Level:
    """What a policy that does not learn costs."""

    policy: str  # a name with a look
    aoi: float  # [windows]
    label: str = ""  # instead of the look's own


@dataclass(frozen=True, kw_only=True)
class LearningPanel:
    """Curves on one pair of axes."""

    title: str
    x: Literal["decisions", "minutes"]
    curves: tuple[LearningCurve, ...]
    levels: tuple[Level, ...]


def draw_learning(panels: Sequence[LearningPanel], caption: str) -> Figure:
    """Learning curves, a panel below the other.

    Args:
        panels: One or more.
        caption: Where the numbers come from.

    Returns:
        The drawing.

    Raises:
        ValueError: A file is no learning curve.
        OSError: A file cannot be read.
    """
    height_in = PANEL_IN * len(panels) + CAPTION_IN
    with styled():
        drawing = Figure(figsize=(WIDTH_IN, height_in), layout="constrained")
        grid = drawing.subplots(len(panels), squeeze=False)
        for axes, panel in zip(grid[:, 0], panels, strict=True):
            _fill(axes, panel)
        drawing.supxlabel(caption, x=0.01, ha="left", fontsize=7, color=FAINT, gid=CAPTION)
    return drawing


def read_curve(path: Path) -> dict[str, list[float]]:
    """A learning curve's columns by name.

    Raises:
        ValueError: It is no learning curve.
        OSError: It cannot be read.
    """
    with path.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    needed = ("decisions", "minutes", "aoi", "aoi_sem")
    try:
        if not rows:
            raise KeyError(needed)
        return {name: [float(row[name]) for row in rows] for name in needed}
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path} is no learning curve with {', '.join(needed)}") from error


def _fill(axes: Axes, panel: LearningPanel) -> None:
    for curve in panel.curves:
        for file, line in zip(curve.files, cycle(LINES), strict=False):
            _draw(axes, curve, read_curve(Path(file)), panel.x, line)
    for level in panel.levels:
        look = look_of(level.policy)
        axes.axhline(level.aoi, color=look.colour, linewidth=0.9, linestyle=(0, (1, 1.5)))
        axes.annotate(
            f"{level.label or look.label} {level.aoi:.1f}",
            (1.01, level.aoi),
            xycoords=("axes fraction", "data"),
            color=look.ink,
            fontsize=8,
            va="center",
            annotation_clip=False,
        )
    axes.set_title(panel.title, loc="left", color=INK)
    axes.set_xlabel(X_LABELS[panel.x])
    axes.set_ylabel("age of information [windows]")
    axes.set_ylim(0.0, MOST_AGE * max(level.aoi for level in panel.levels))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.legend(loc="lower right", frameon=False, fontsize=8, ncols=len(panel.curves))


def _draw(
    axes: Axes, curve: LearningCurve, columns: dict[str, list[float]], x_name: str, line: str
) -> None:
    x = [value / X_UNITS[x_name] for value in columns[x_name]]
    is_first = line == LINES[0]
    axes.plot(
        x,
        columns["aoi"],
        color=curve.colour,
        linestyle=line,
        alpha=PALE,
        label=curve.label if is_first else None,
    )
    low = [mean - sem for mean, sem in zip(columns["aoi"], columns["aoi_sem"], strict=True)]
    high = [mean + sem for mean, sem in zip(columns["aoi"], columns["aoi_sem"], strict=True)]
    axes.fill_between(x, low, high, color=curve.colour, alpha=BAND, linewidth=0.0)
