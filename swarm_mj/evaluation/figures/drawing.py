"""Draws a figure by its name; result figures are curves with error bars, named at their ends."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FixedLocator, LogLocator, NullLocator

from swarm_mj.evaluation.figures.contents import FLOCK, RESULT_FIGURES, Panel, ResultFigure, Scale
from swarm_mj.evaluation.figures.curves import Curve, budgets, curves, preset_of, results_of
from swarm_mj.evaluation.figures.flock import draw_flock
from swarm_mj.evaluation.figures.labels import MORE, name_ends, name_of
from swarm_mj.evaluation.figures.style import FAINT, INK, WIDTH_IN, look_of, styled, write_caption
from swarm_mj.evaluation.results import CARRIES_MORE, Result, carries_more

TOP_IN, PANEL_IN, GAP_IN, BOTTOM_IN = 0.86, 3.3, 0.35, 0.75
LEFT, RIGHT, MARGIN = 0.085, 0.8, 0.985  # of the width; the curves' names stand on the right
FIXED = {
    "num_robots": "{} robots",
    "range_ratio": "range ratio {:g}",
    "velocity_ratio": "velocity ratio {:g}",
}
RING = 1.6  # a published marker's size, of ours
HEADROOM = 0.06  # of the axis, beyond the highest and the lowest curve
PLAIN = "{x:g}"  # a number on an axis
SHORT = 7  # of a commit's digits
PAPERS_BUDGET = "team decisions each, the paper's on 2,000,000 (III-C)"


def draw_figure(
    name: str, results: Sequence[Result], *, flock_policy: str, flock_seed: int
) -> Figure:
    """Draws a figure.

    Args:
        name: One of `FIGURES`.
        results: One or more, of one preset; other regimes are passed over.
        flock_policy: Who talks to whom in the flock's mission.
        flock_seed: That mission's.

    Raises:
        ValueError: The results hold no point of it or cannot be compared, or no such flock flies.
    """
    if name == FLOCK:
        return draw_flock(preset_of(results), flock_policy, flock_seed)
    return draw(RESULT_FIGURES[name], results)


def draw(figure: ResultFigure, results: Sequence[Result]) -> Figure:
    """A result figure of the paper, ours and the published curves; otherwise as `draw_figure`."""
    found = results_of(figure, results)
    num_panels = len(figure.panels)
    height_in = TOP_IN + num_panels * PANEL_IN + (num_panels - 1) * GAP_IN + BOTTOM_IN
    with styled():
        drawing = Figure(figsize=(WIDTH_IN, height_in))
        grid = drawing.subplots(num_panels, sharex=True, squeeze=False)
        drawing.subplots_adjust(
            left=LEFT,
            right=RIGHT,
            top=1.0 - TOP_IN / height_in,
            bottom=BOTTOM_IN / height_in,
            hspace=GAP_IN / PANEL_IN,
        )
        for axes, panel in zip(grid[:, 0], figure.panels, strict=True):
            its = curves(figure, panel.cost, found)
            _set_axes(axes, figure, panel, its)
            for curve in its:
                _draw_curve(axes, curve)
            name_ends(axes, its)
        grid[-1, 0].set_xlabel(figure.x_label)
        _head(drawing, figure, found, height_in)
        write_caption(drawing, LEFT, 0.12 / height_in, caption(figure, found))
    return drawing


def caption(figure: ResultFigure, results: Sequence[Result]) -> str:
    """Where the numbers come from, with all commits that made some."""
    result = results[0]
    last = result.seed + result.episodes - 1
    commits = list(dict.fromkeys(each.commit[:SHORT] for each in results if each.commit))
    noun = "commit" if len(commits) == 1 else "commits"
    code = f"swarm_mj {result.version}" + (f", {noun} {', '.join(commits)}" if commits else "")
    lines = [
        f"{figure.name}, preset {result.preset}: {result.episodes} missions, seeds {result.seed} "
        f"to {last}, {result.num_windows} windows each; {code}"
    ]
    if its := budgets(results):
        least, most = (f"{number:,}" for number in (its[0], its[-1]))
        numbers = most if least == most else f"{least} to {most}"
        lines.append(f"our GNNs: trained on {numbers} {PAPERS_BUDGET}")
    return "\n".join(lines)


def _draw_curve(axes: Axes, curve: Curve) -> None:
    """A line with error bars, or a level with a band; a published marker is a ring around ours."""
    look, is_published = look_of(curve.method), curve.is_published
    line = {
        "label": name_of(curve) + (", published" if is_published else ""),
        "color": look.colour,
        "linestyle": "--" if is_published else "-",
        "linewidth": look.width,
    }
    if not curve.is_level:
        marker = {
            "marker": look.marker,
            "markersize": RING * look.size if is_published else look.size,
            "markerfacecolor": "white" if is_published else look.colour,
        }
        bars = {"yerr": curve.sem, "elinewidth": 0.9, "capsize": 2.0}
        axes.errorbar(curve.x, curve.mean, **bars, **line, **marker)
        return
    axes.plot(curve.x, curve.mean, **line)
    if not is_published:
        low, high = curve.mean - curve.sem, curve.mean + curve.sem
        axes.fill_between(curve.x, low, high, color=look.colour, alpha=0.2, linewidth=0.0)


def _set_axes(axes: Axes, figure: ResultFigure, panel: Panel, its: Sequence[Curve]) -> None:
    """Scales, limits and ticks, before anything is placed by them."""
    axes.set_xscale(figure.x_scale)
    axes.set_yscale(panel.scale)
    x = np.concatenate([curve.x for curve in its])
    y = np.concatenate([curve.mean + way * curve.sem for curve in its for way in (-1.0, 0.0, 1.0)])
    y = y[(y > 0.0) if panel.scale == "log" else np.isfinite(y)]
    axes.set_xlim(*_widened(x, 0.03, figure.x_scale))
    axes.set_ylim(*_widened(y, HEADROOM, panel.scale))
    axes.xaxis.set_major_locator(FixedLocator(np.unique(x).tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(PLAIN)
    if panel.scale == "log":
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(PLAIN)
    axes.set_title(panel.label, loc="left", color=INK)


def _widened(values: Float[np.ndarray, "V"], share: float, scale: Scale) -> tuple[float, float]:
    """Limits that leave a share of the axis free at either end."""
    low, high = float(np.min(values)), float(np.max(values))
    if scale == "log":
        factor = (high / low) ** share
        return low / factor, high * factor
    return low - share * (high - low), high + share * (high - low)


def _head(
    drawing: Figure, figure: ResultFigure, results: Sequence[Result], height_in: float
) -> None:
    """Return the title, what is the same all over the figure, and what lines and marks mean."""
    fixed = [FIXED[name].format(getattr(results[0], name)) for name in figure.fixed]
    regime = ", ".join([figure.task.replace("-", " "), *fixed])
    line = 1.0 - 0.28 / height_in
    drawing.text(LEFT, line, figure.title, fontsize=12, fontweight="bold", va="baseline")
    drawing.text(MARGIN, line, regime, color=FAINT, va="baseline", ha="right")
    ours = Line2D([], [], color=FAINT, marker="o", markersize=4.5)
    ring = {"marker": "o", "markersize": 4.5 * RING, "markerfacecolor": "white"}
    published = Line2D([], [], color=FAINT, linestyle="--", linewidth=1.2, **ring)
    labels = ["this package, mean ± SEM", "published, mean ± SEM"]
    if any(carries_more(result) for result in results):
        labels.append(f"{MORE}: packets {CARRIES_MORE}")
    drawing.legend(
        handles=[ours, published, Line2D([], [], linestyle="")][: len(labels)],
        labels=labels,
        loc="upper left",
        bbox_to_anchor=(LEFT, 1.0 - 0.4 / height_in),
        ncols=3,
        columnspacing=1.0,
        frameon=False,
        fontsize=8,
        borderpad=0.0,
        borderaxespad=0.0,
        handlelength=2.8,
    )
