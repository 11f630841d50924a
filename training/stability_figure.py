"""Learning curves of several seeds, trained on the age or on the task's own cost, as a figure.

    python training/stability_figure.py

Draws what `training/reproduce.py` left of the trainings in flocks: assets/figures/stability.svg and
.png.
"""

import sys
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.style import WIDTH_IN, save, styled, write_caption
from swarm_mj.evaluation.published import AOI, VARIANCE
from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_json, read_rows
from swarm_mj.system.writing import Output, check_outputs

ROOT = Path(__file__).resolve().parent.parent
MOST_BYTES = 10_000_000
# What a colour is for, by the first part of the trainings' names.
KINDS = {
    "age": ("trained on the age of information", "#0072b2"),
    "variance": ("trained on the velocity variance", "#d55e00"),
}
PANELS = (AOI, VARIANCE)  # a cost's name is also a column
HEIGHT_IN = 3.5
PALE, BAND = 0.45, 0.15  # of a seed's line, of the band from the lowest to the highest

Curves = Mapping[str, Sequence[Mapping[str, Float[np.ndarray, "evaluations"]]]]


@dataclass(frozen=True, kw_only=True)
class StabilityFigure:
    """Where the figure goes, and where its numbers are."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "stability",
        "the files, without their endings",
        shown="assets/figures/stability",
    )
    trained: Path = setting(
        ROOT / "training" / "reproduce" / "quick" / "stability",
        "where the trainings' tables are",
        metavar="DIR",
        shown="training/reproduce/quick/stability",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        paths = [self.out.with_name(f"{self.out.name}.{kind}") for kind in ("svg", "png")]
        check_outputs(*(Output("figure", path) for path in paths))
        curves = read_curves(self.trained / "curves.csv")
        figure = draw(curves, read_origin(self.trained / "trainings.csv"))
        for path in paths:
            save(figure, path)
        return 0


def read_curves(path: Path) -> Curves:
    """Return the learning curves of each kind of training, one per seed, by column.

    Trainings of other kinds are passed over.

    Raises:
        ValueError: The file cannot be read, has none of a kind, or curves of a kind were not
            evaluated after the same numbers of decisions.
    """
    rows = read_rows(path, "table of curves", MOST_BYTES)
    columns = ("decisions", *(panel.cost for panel in PANELS))
    found: dict[str, list[list[float]]] = defaultdict(list)
    try:
        for _, row in rows:
            found[row["training"]].append([float(row[name]) for name in columns])
    except (KeyError, ValueError) as error:
        raise ValueError(f"{path} is no table with {', '.join(columns)}: {error}") from error
    curves = {kind: [] for kind in KINDS}
    for name, numbers in found.items():
        kind = name.partition("-")[0]
        if kind in curves:
            curves[kind].append(dict(zip(columns, np.array(numbers).T, strict=True)))
    for kind, its in curves.items():
        if not its or {tuple(each["decisions"]) for each in its} != {tuple(its[0]["decisions"])}:
            raise ValueError(
                f"{path}: curves of {kind} need the same decisions, and one seed or more"
            )
    return curves


def read_origin(path: Path) -> str:
    """Return the team size and the commit of a table of trainings, in words.

    Raises:
        ValueError: It cannot be read, or has several commits or team sizes where one is needed.
    """
    rows = read_rows(path, "table of trainings", MOST_BYTES)
    its = [row for _, row in rows if row.get("training", "").partition("-")[0] in KINDS]
    commits = {row.get("commit", "") for row in its}
    sizes = {str(read_json(row.get("settings", ""), dict).get("robots")) for row in its}
    if len(commits) != 1 or len(sizes) != 1:
        raise ValueError(
            f"{path} needs one commit and one team size, not "
            f"{', '.join(sorted(commits | sizes)) or 'none'}"
        )
    return f"teams of {sizes.pop().strip('[]')} robots, shared reward, commit {commits.pop()}"


def draw(curves: Curves, origin: str) -> Figure:
    """Draw both costs over the decisions: seeds pale, their mean, a band from lowest to highest."""
    with styled():
        drawing = Figure(figsize=(WIDTH_IN, HEIGHT_IN))
        drawing.subplots_adjust(left=0.075, right=0.97, top=0.76, bottom=0.24, wspace=0.18)
        for axes, panel in zip(drawing.subplots(1, len(PANELS)), PANELS, strict=True):
            for kind, its in curves.items():
                _draw_kind(axes, kind, panel.cost, its)
            axes.set_title(panel.label, loc="left")
            axes.set_xlabel("team decisions")
            axes.set_ylim(bottom=0.0)
            axes.xaxis.set_major_formatter("{x:,.0f}")
        drawing.text(0.075, 0.93, "Training stability", fontsize=12, fontweight="bold")
        drawing.legend(
            *drawing.axes[0].get_legend_handles_labels(),
            loc="upper left",
            bbox_to_anchor=(0.075, 0.91),
            ncols=len(KINDS),
            frameon=False,
            fontsize=8,
            borderpad=0.0,
            borderaxespad=0.0,
        )
        seeds = ", ".join(f"{len(its)} of {kind}" for kind, its in curves.items())
        caption = f"Held-out missions; seeds: {seeds}; each and their mean; {origin}"
        write_caption(drawing, caption, 0.075, 0.03)
    return drawing


def _draw_kind(
    axes: Axes, kind: str, cost: str, its: Sequence[Mapping[str, Float[np.ndarray, "E"]]]
) -> None:
    """Draw one kind of training in one pair of axes."""
    (label, colour), x = KINDS[kind], its[0]["decisions"]
    costs = np.array([each[cost] for each in its])
    for each in costs:
        axes.plot(x, each, color=colour, alpha=PALE, linewidth=0.8)
    axes.plot(x, costs.mean(axis=0), color=colour, label=label)
    low, high = costs.min(axis=0), costs.max(axis=0)
    axes.fill_between(x, low, high, color=colour, alpha=BAND, linewidth=0.0)


if __name__ == "__main__":
    sys.exit(script(StabilityFigure, StabilityFigure.__call__))
