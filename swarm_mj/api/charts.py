"""Charts: one mission over time, policies below each other, and learning curves."""

import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import LogLocator, MaxNLocator

from swarm_mj.control.motion import Flocking
from swarm_mj.evaluation.figures import style
from swarm_mj.evaluation.figures.style import look_of
from swarm_mj.evaluation.results import (
    LARGER_PACKETS,
    Result,
    carries_more,
    is_flock,
    statistics_of,
)
from swarm_mj.evaluation.table import missions_title
from swarm_mj.protocol.agreement import AGREED
from swarm_mj.protocol.costs import CostName
from swarm_mj.protocol.mission_costs import AOI, VELOCITY_VARIANCE, MissionCost

OneCourse = Float[np.ndarray, "T"]

PANEL_IN = 2.1  # of a cost over time
ROW_IN = 0.32  # of a policy
HEAD_IN = 1.1  # of title and axis
LINE_IN = 0.16  # of a title
CHARACTERS = 92  # of a line of a title
FOOT_IN = 0.2
LEGEND_CHARACTERS = 26  # of a line of a legend beside the axes
LEGEND_ROW_IN = 0.2  # of such a line
UNHEARD = "#eef0f4"  # behind the windows before everyone has heard of everyone
MIN_SHARE = 1e-6  # of the largest velocity variance that is drawn


def draw_flight(
    columns: Mapping[str, OneCourse],
    title: str,
    policy: str,
    window_s: float,
    own_cost: CostName | None,
    agreed_window: int | None = None,
) -> Figure:
    """Chart a mission's costs over its windows, the age above the task's own cost.

    Args:
        columns: As `Run.columns` returns them, each [T].
        title: What was flown, in a line.
        policy: By which curves have their colour.
        window_s: How long a window is [s].
        own_cost: The name and the unit of the task's cost; None if it has none.
        agreed_window: The first from which on a flock had agreed; None if it had not.

    Returns:
        The figure, 7.5 inches wide.
    """
    colour = look_of(policy).colour
    number = 2 if own_cost else 1  # of panels
    with style.styled():
        figure, axes = style.panels(title, rows=number, height_in=HEAD_IN + number * PANEL_IN)
        for each in axes:
            each.margins(x=0.01)
        _draw_age(axes[0], columns, colour)
        if own_cost:
            name, unit = own_cost
            axes[1].plot(columns["window"], columns["task_cost"], color=colour)
            axes[1].set_ylabel(_two_lines(name, unit))
            axes[1].set_ylim(bottom=0.0)
            if name == Flocking.cost_name:
                _draw_agreement(axes[1], columns, agreed_window)
        axes[-1].set_xlabel(f"window of {window_s:g} s")
    return style.kept(figure)


def draw_evaluation(results: Sequence[Result]) -> Figure:
    """Return a chart of policies, the lowest age first; flocks have variances, too.

    Args:
        results: Of any missions; policies that flew the same ones stand in one chart.

    Returns:
        The figure: a chart for each kind of missions, with its title, below each other.
    """
    groups: list[list[Result]] = []
    titles: list[list[str]] = []  # in lines
    heights_in: list[float] = []
    for said, alike in groupby(results, missions_title):
        shown = sorted(alike, key=lambda result: result.aoi_mean)
        title = textwrap.wrap(said, CHARACTERS, break_on_hyphens=False)
        groups.append(shown)
        titles.append(title)
        heights_in.append(HEAD_IN + LINE_IN * (len(title) - 1) + ROW_IN * len(shown))
    with style.styled():
        size_in = style.WIDTH_IN, sum(heights_in) + FOOT_IN
        figure = plt.figure(figsize=size_in, layout="constrained")
        parts = figure.subfigures(len(groups), 1, height_ratios=heights_in, squeeze=False)
        for part, title, shown in zip(parts.flat, titles, groups, strict=True):
            said = style.escape_mathtext("\n".join(title))
            part.suptitle(said, x=0.01, ha="left", fontsize=style.TITLE_PT)
            _draw_policies(part, shown)
        style.write_caption(figure, _origin(results))
    return style.kept(figure)


@dataclass(frozen=True, kw_only=True, eq=False)
class LearningCurve:
    """The age of information while policies learned, with a band around it."""

    decisions: Float[np.ndarray, "X"]  # of teams
    age: Float[np.ndarray, "X"]  # [windows]
    low: Float[np.ndarray, "X"]  # the band's lower end [windows]
    high: Float[np.ndarray, "X"]  # and its upper end [windows]


def draw_learning(
    lines: Mapping[str, LearningCurve], levels: Mapping[str, float], origin: str
) -> Figure:
    """Return a chart of learning curves, and policies' ages as levels, on the same missions.

    Args:
        lines: The curves by their labels.
        levels: The ages of policies by their names [windows].
        origin: Where the numbers are from, for the caption.

    Returns:
        The figure: ages, on a logarithmic axis, over team decisions.
    """
    labels = [textwrap.fill(style.escape_mathtext(label), LEGEND_CHARACTERS) for label in lines]
    num_rows = len(levels) + sum(label.count("\n") + 1 for label in labels)
    with style.styled():
        height_in = max(HEAD_IN + PANEL_IN, HEAD_IN + LEGEND_ROW_IN * num_rows)
        figure, (axes,) = style.panels("Learning curves", rows=1, height_in=height_in)
        looks = _looks_beside([look_of(policy).colour for policy in levels])
        for label, curve in zip(labels, lines.values(), strict=True):
            colour, line_style = next(looks)
            axes.plot(curve.decisions, curve.age, color=colour, linestyle=line_style, label=label)
            axes.fill_between(curve.decisions, curve.low, curve.high, color=colour, alpha=0.2)
        for policy, age in levels.items():
            look = look_of(policy)
            axes.axhline(age, color=look.colour, linestyle=":", label=f"{look.label} {age:.1f}")
        axes.set(xlabel="team decisions", ylabel=_two_lines(AOI.title, AOI.unit), yscale="log")
        axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter("")
        axes.xaxis.set_major_locator(MaxNLocator(nbins=5))  # numbers of six digits are wide
        axes.xaxis.set_major_formatter("{x:,.0f}")
        # Beside the axes, where it covers no line.
        axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        style.write_caption(figure, origin)
    return style.kept(figure)


def _looks_beside(others: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield colours and styles of lines, three styles of each colour that is none of the others'.

    More lines than that begin again.
    """
    cycle: list[str] = plt.rcParams["axes.prop_cycle"].by_key()["color"]
    taken = {to_hex(colour) for colour in others}
    free = [colour for colour in cycle if to_hex(colour) not in taken]
    while True:
        for line_style in ("-", "--", "-."):
            for colour in free:
                yield colour, line_style


def _draw_policies(part: SubFigure, shown: Sequence[Result]) -> None:
    """Draw policies below each other, a panel for each cost, from the first at the top."""
    costs = [AOI, VELOCITY_VARIANCE] if is_flock(shown[0]) else [AOI]
    axes = list(part.subplots(1, len(costs), sharey="row", squeeze=False).flat)
    for each, cost in zip(axes, costs, strict=True):
        for place, result in enumerate(shown):
            _draw_mean(each, place, result, cost)
        each.set_xlabel(cost.label)
        each.grid(visible=False, axis="y")
        each.set_xlim(left=0.0)
    axes[0].set_yticks(range(len(shown)), [_name_of(each) for each in shown])
    axes[0].set_ylim(len(shown) - 0.5, -0.5)


def _name_of(result: Result) -> str:
    """Return a policy's name, marked where its packets are larger."""
    label = look_of(result.policy).label
    return f"{label} +" if carries_more(result) else label


def _origin(results: Sequence[Result]) -> str:
    """Return what is drawn, and what code it is from."""
    first = results[0]
    said = "mean over missions"
    if first.aoi_ci_low is not None:
        said += ", and its 95 % interval"
    if any(map(carries_more, results)):
        said += f"; +: {LARGER_PACKETS}"
    return f"{said}; {style.code(first.version, first.commit)}"


def _draw_age(axes: Axes, columns: Mapping[str, OneCourse], colour: str) -> None:
    """Draw the mean age and the worst pair's, shaded until everyone has heard of everyone."""
    if "aoi_worst" in columns:
        worst = columns["aoi_worst"]
        axes.plot(columns["window"], worst, color=style.FAINT, linewidth=0.8, label="worst pair")
    axes.plot(columns["window"], columns["aoi"], color=colour, label="mean over all pairs")
    axes.set_ylabel(_two_lines(AOI.title, AOI.unit))
    axes.set_ylim(bottom=0.0)
    complete = np.flatnonzero(columns["is_complete"])
    first_complete = complete[0] if len(complete) > 0 else -1  # -1: never, so up to the end
    end = columns["window"][first_complete]
    if end > columns["window"][0]:
        label = "not everyone has heard of everyone yet"
        axes.axvspan(columns["window"][0], end, color=UNHEARD, linewidth=0.0, label=label, zorder=0)
    axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)


def _draw_agreement(
    axes: Axes, columns: Mapping[str, OneCourse], agreed_window: int | None
) -> None:
    """Show a flock's velocity variance on a logarithmic axis, and when the flock had agreed."""
    variance = columns["task_cost"]
    first = float(variance[0])
    axes.set_yscale("log")
    # Far below its largest value the variance of a converged flock is rounding noise.
    least = MIN_SHARE * float(np.max(variance))
    is_clipped = float(np.min(variance)) < least
    axes.set_ylim(bottom=max(float(np.min(variance)), least) / 2.0)
    if first > 0.0:
        label = f"{AGREED:.0%} of the first variance"
        axes.axhline(AGREED * first, color=style.FAINT, linewidth=0.8, label=label)
    if agreed_window is not None:
        label = f"agreed from window {agreed_window} on"
        axes.axvline(agreed_window, color=style.FAINT, linewidth=0.8, linestyle=":", label=label)
    if is_clipped:
        said = f"below {MIN_SHARE:g} of the largest: not shown"
        axes.text(0.99, 0.04, said, transform=axes.transAxes, ha="right", color=style.FAINT)
    if axes.get_legend_handles_labels()[0]:
        axes.legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2)


def _draw_mean(axes: Axes, place: int, result: Result, cost: MissionCost) -> None:
    """Draw a policy's mean with its 95 % interval, if there is one, at a height on the axes."""
    look = look_of(result.policy)
    found = statistics_of(result, cost)
    if found.ci_low is not None and found.ci_high is not None:
        ends = found.ci_low, found.ci_high
        axes.hlines(place, *ends, color=look.colour, linewidth=3.0, alpha=0.45)
    size = look.marker_size + 2.0  # a lone marker must be found, where a curve's need not
    axes.plot(found.mean, place, color=look.colour, marker=look.marker, markersize=size)


def _two_lines(title: str, unit: str) -> str:
    """Return a cost's title and unit for a low panel, beside which one line would not fit."""
    return f"{title}\n[{unit}]"
