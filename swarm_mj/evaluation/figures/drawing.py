"""Result figures of the paper: curves with error bars, named at their ends."""

from collections.abc import Collection, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patheffects import withStroke
from matplotlib.ticker import FixedLocator, LogLocator, NullLocator
from scipy.optimize import isotonic_regression

from swarm_mj.evaluation.figures.curves import (
    Curve,
    NoPointsError,
    curves,
    method_of,
    perfect_curve,
    results_of,
)
from swarm_mj.evaluation.figures.style import FAINT, WIDTH_IN, code, look_of, styled, write_caption
from swarm_mj.evaluation.published import MissionField, Panel, ResultFigure
from swarm_mj.evaluation.results import LARGER_PACKETS, Result, carries_more, config_of

# Heights, from the top: the head, each panel, what is between two, and the x axis with the caption.
TOP_IN = 0.86
PANEL_IN = 3.3
GAP_IN = 0.35
BOTTOM_IN = 0.75
CAPTION_IN = 0.14  # more for each further line of the caption
# Of the width: where panels begin and end, and where the curves' names do, to the right of them.
LEFT = 0.085
RIGHT = 0.775
MARGIN = 0.985
# How the head says what is fixed in a figure.
FIXED: dict[MissionField, str] = {
    "num_robots": "{} robots",
    "range_ratio": "range ratio {:g}",
    "velocity_ratio": "velocity ratio {:g}",
}
RING = 1.6  # a published marker's size, of ours
HEADROOM = 0.06  # of the axis, beyond the highest and the lowest curve
PLAIN = "{x:g}"  # a number on an axis
LINE_IN = 0.165  # from one name to the next
MORE = "+"  # after the names of methods whose packets carry more than T, M and P
PLACE = 1.045  # of the axes' width
ASIDE = 0.02  # likewise, from the end of a curve that ends early to its name
PAPERS_BUDGET = "team decisions each, the paper's on 2,000,000 (III-C)"


def draw(figure: ResultFigure, results: Sequence[Result], methods: Collection[str] = ()) -> Figure:
    """Draw our curves and the published ones, above what perfect knowledge would reach.

    Args:
        figure: One of the paper's, such as `RESULT_FIGURES["fig4"]`.
        results: Rows of result files; those of other missions than the figure's are passed over.
        methods: The policies and published methods to draw; empty for all.

    Returns:
        The figure, which `style.save` writes.

    Raises:
        NoPointsError: None of the results, or of the methods, belongs to the figure.
        ValueError: Some results are not comparable, as they differ in more than the figure's x.
    """
    found = results_of(figure, results)
    if methods:
        chosen = [result for result in found if method_of(result) in methods]
        # The caption names results, also where all curves are published ones.
        found = chosen or found[:1]
    costs = []
    for panel in figure.panels:
        shown = curves(figure, panel.cost, found)
        if methods:
            shown = [curve for curve in shown if curve.method in methods]
            if not shown:
                raise NoPointsError(f"{figure.name} has no points of {', '.join(methods)}")
        perfect = perfect_curve(figure, panel, found)
        if perfect is not None:
            shown.insert(0, perfect)  # below the others
        costs.append(shown)
    return draw_curves(figure, found, costs)


def draw_curves(
    figure: ResultFigure, found: Sequence[Result], costs: Sequence[Sequence[Curve]]
) -> Figure:
    """Draw the curves of a figure, with the origin of the results below.

    Args:
        figure: What is drawn: its panels, axes and title.
        found: The results that the curves are from, for the head and the caption.
        costs: The curves of each panel.

    Returns:
        The figure, which `style.save` writes.
    """
    num_panels = len(figure.panels)
    origin = caption(figure, found)
    bottom_in = BOTTOM_IN + origin.count("\n") * CAPTION_IN
    num_names = max(len({curve.method for curve in shown}) for shown in costs)
    panel_in = max(PANEL_IN, num_names * LINE_IN)
    height_in = TOP_IN + num_panels * panel_in + (num_panels - 1) * GAP_IN + bottom_in
    with styled():
        drawing = Figure(figsize=(WIDTH_IN, height_in))
        grid = drawing.subplots(num_panels, sharex=True, squeeze=False)
        drawing.subplots_adjust(
            left=LEFT,
            right=RIGHT,
            top=1.0 - TOP_IN / height_in,
            bottom=bottom_in / height_in,
            hspace=GAP_IN / panel_in,
        )
        for axes, panel, shown in zip(grid[:, 0], figure.panels, costs, strict=True):
            _set_axes(axes, figure, panel, shown)
            for curve in shown:
                _draw_curve(axes, curve)
            axes.autoscale_view()  # or else the names would be placed by the limits before
            name_ends(axes, shown)
        grid[-1, 0].set_xlabel(figure.x_label)
        _head(drawing, figure, found, costs, height_in)
        write_caption(drawing, origin, LEFT, 0.12 / height_in)
    return drawing


def caption(figure: ResultFigure, results: Sequence[Result]) -> str:
    """Return the origin of the numbers, with all commits that made some."""
    result = results[0]
    last = result.seed + result.episodes - 1
    made_by = code(result.version, *(each.commit for each in results))
    lines = [
        f"{figure.name}, preset {result.preset}: {result.episodes} missions, seeds {result.seed} "
        f"to {last}, {result.num_windows} windows each; {made_by}"
    ]
    decisions: list[int] = []
    for each in results:
        budget = config_of(each).get("decisions")
        if budget:
            decisions.append(budget)
    if decisions:  # some were trained
        least = f"{min(decisions):,}"
        most = f"{max(decisions):,}"
        numbers = most if least == most else f"{least} to {most}"
        lines.append(f"our GNNs: trained on {numbers} {PAPERS_BUDGET}")
    if any(each.policy != method_of(each) for each in results):
        lines[-1] += "; bands: from the best to the worst training"
    return "\n".join(lines)


def _draw_curve(axes: Axes, curve: Curve) -> None:
    """Draw a line with error bars, or a level with a band; published markers are rings.

    A band shows several trainings, or a level's error.
    """
    look = look_of(curve.method)
    is_published = curve.is_published
    line = {
        "label": name_of(curve) + (", published" if is_published else ""),
        "color": look.colour,
        "linestyle": "--" if is_published else "-",
        "linewidth": look.line_width,
    }
    if not curve.is_level:
        marker = {
            "marker": look.marker,
            "markersize": RING * look.marker_size if is_published else look.marker_size,
            "markerfacecolor": "white" if is_published else look.colour,
        }
        bars = {"yerr": curve.sem, "elinewidth": 0.9, "capsize": 2.0}
        axes.errorbar(curve.x, curve.mean, **bars, **line, **marker)
    else:
        axes.plot(curve.x, curve.mean, **line)
    band = curve.band
    if band is None and curve.is_level and not is_published:
        band = curve.mean - curve.sem, curve.mean + curve.sem
    if band is not None:
        low, high = band
        axes.fill_between(curve.x, low, high, color=look.colour, alpha=0.2, linewidth=0.0)


def _set_axes(axes: Axes, figure: ResultFigure, panel: Panel, shown: Sequence[Curve]) -> None:
    """Set scales, margins and ticks, which the names of curves depend on."""
    axes.set(xscale=figure.x_scale, yscale=panel.scale)
    axes.margins(0.03, HEADROOM)
    x = np.concatenate([curve.x for curve in shown])
    axes.xaxis.set_major_locator(FixedLocator(np.unique(x).tolist()))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(PLAIN)
    if panel.scale == "log":
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(PLAIN)
    axes.set_title(panel.cost.label)


def _head(
    drawing: Figure,
    figure: ResultFigure,
    results: Sequence[Result],
    costs: Sequence[Sequence[Curve]],
    height_in: float,
) -> None:
    """Write what the figure shows and what is fixed in it, and the key of lines and markers."""
    fixed = [FIXED[name].format(getattr(results[0], name)) for name in figure.fixed]
    regime = ", ".join([figure.task.replace("-", " "), *fixed])
    line = 1.0 - 0.28 / height_in
    drawing.text(LEFT, line, figure.title, fontsize=12, fontweight="bold", va="baseline")
    drawing.text(MARGIN, line, regime, color=FAINT, va="baseline", ha="right")
    ours = Line2D([], [], color=FAINT, marker="o", markersize=4.5)
    theirs = Line2D([], [], color=FAINT, marker="o", markersize=4.5 * RING)
    theirs.set(linestyle="--", linewidth=1.2, markerfacecolor="white")
    handles = {"this package, mean ± SEM": ours}
    if any(curve.is_published for shown in costs for curve in shown):
        handles["published, mean ± SEM"] = theirs
    if any(map(carries_more, results)):
        handles[f"{MORE}: {LARGER_PACKETS}"] = Line2D([], [], linestyle="")
    drawing.legend(
        handles=list(handles.values()),
        labels=list(handles),
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


def name_ends(axes: Axes, shown: Sequence[Curve]) -> None:
    """Write each method's name next to the axes, as close to the end of its curve as possible.

    Curves that end earlier are named there. Names of methods that only the paper has are slanted.
    The limits of the axes must be set.
    """
    named = {curve.method: curve for curve in shown}.values()  # ours come last
    last = max(curve.x[-1] for curve in shown)
    for x in {curve.x[-1] for curve in named}:
        curves_here = [curve for curve in named if curve.x[-1] == x]
        ends = [(x, curve.mean[-1]) for curve in curves_here]
        fraction = axes.transAxes.inverted().transform(axes.transData.transform(ends))
        across = PLACE if x == last else fraction[0, 0] + ASIDE
        places = keep_apart(fraction[:, 1], LINE_IN / (axes.bbox.height / axes.figure.dpi))
        for curve, end, place in zip(curves_here, ends, places, strict=True):
            _name(axes, curve, end, (across, place))


def _name(axes: Axes, curve: Curve, end: tuple[float, float], place: tuple[float, float]) -> None:
    look = look_of(curve.method)
    # A line from the name's left edge to the end of its curve.
    arrow = {
        "arrowstyle": "-",
        "color": look.colour,
        "linestyle": "--" if curve.is_published else "-",
        "linewidth": 0.6,
        "shrinkA": 1.0,
        "shrinkB": 4.0,
        "relpos": (0.0, 0.5),
    }
    axes.annotate(
        name_of(curve),
        xy=end,
        xytext=place,
        textcoords="axes fraction",
        color=[0.7 * share for share in to_rgb(look.colour)],  # darker, for type is thin
        fontsize=8,
        fontstyle="italic" if curve.is_published else "normal",
        va="center",
        annotation_clip=False,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],  # over other curves
        arrowprops=arrow,
    )


def name_of(curve: Curve) -> str:
    """Return a method's name, marked where its packets carry more than T, M and P."""
    label = look_of(curve.method).label
    return f"{label} {MORE}" if curve.carries_more else label


def keep_apart(wanted: Float[np.ndarray, "L"], gap: float) -> Float[np.ndarray, "L"]:
    """Return the nearest places, in least squares, in their order, a gap apart, from 0 to 1."""
    order = np.argsort(wanted, kind="stable")
    steps = gap * np.arange(len(wanted))
    base = isotonic_regression(wanted[order] - steps).x
    places = np.empty(len(wanted))
    places[order] = np.clip(base, 0.0, max(0.0, 1.0 - steps[-1])) + steps
    return places
