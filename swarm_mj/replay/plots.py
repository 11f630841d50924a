"""The plots of a replay: curves of ages, packets, links and the task's cost over the windows."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Int

from swarm_mj.protocol.agreement import agreed_window
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.protocol.mission_costs import VELOCITY_VARIANCE
from swarm_mj.replay import layers, palette
from swarm_mj.replay.layer_kinds import Entity, View
from swarm_mj.replay.links import PacketPaths, Phases, by_kind, fates, is_other
from swarm_mj.replay.log import Log
from swarm_mj.replay.palette import Colour, Fate
from swarm_mj.replay.rerun_log import RerunLog

RATE_WINDOWS = 10  # that packets are counted over


class PlotCurve(NamedTuple):
    """One curve of a plot."""

    entity: Entity
    name: str
    colour: Colour
    values: np.ndarray
    std: np.ndarray | float = 0.0  # the half width of a band around it
    window: np.ndarray | None = None  # of each value; None: all of the log's
    is_hidden: bool = False  # it would dwarf the others; the viewer can show it


class Plot(NamedTuple):
    """Curves over the windows, on common axes."""

    title: str  # which says what the curves are: legends hide some
    view: View
    curves: list[PlotCurve]


def plots(log: Log) -> list[Plot]:
    """Return the plots that apply to a mission."""
    found = [_age_plot(log), _packet_plot(log)]
    if log.is_compared:
        found.append(_link_plot(log))
    cost = log.task_cost
    if cost is None and log.facts.mission.flocks:
        variance = log.velocity_variance_m2ps2
        cost = TaskCost(name=VELOCITY_VARIANCE.title, unit=VELOCITY_VARIANCE.unit, value=variance)
    if cost is not None:
        plot = _cost_plot(cost)
        if shows_agreement(log):
            plot = plot._replace(title=f"{plot.title}; a line: the flock has agreed")
        found.append(plot)
    return found


def _age_plot(log: Log) -> Plot:
    own = f"r{log.ego}"
    view = layers.AGE_PLOT
    mean = PlotCurve(
        layers.MEAN_AGE, "team, mean ± std", palette.MEAN_AGE, log.age_mean, std=log.age_std
    )
    worst = PlotCurve(
        layers.WORST_AGE, "worst pair", palette.WORST_AGE, log.age_max, is_hidden=True
    )
    ego_age = np.mean(log.ego_age, axis=1)
    ego = PlotCurve(view.below("ego"), f"{own}, mean", palette.EGO, ego_age)
    title = f"Age of information [windows]: team ± std (green), {own} (white)"
    return Plot(title=title, view=view, curves=[mean, worst, ego])


def _packet_plot(log: Log) -> Plot:
    before = [each[-RATE_WINDOWS + 1 :] for each in log.lead]
    now = [log.position_m, log.recipient, log.heard]
    position_m, recipient, heard = (np.concatenate(pair) for pair in zip(before, now, strict=True))
    if log.facts.is_broadcast:
        sent = "sent (grey), heard by anyone (blue)"
        counts = _broadcast_counts(recipient, heard)
    else:
        sent = "delivered (green), lost (orange), answered (blue)"
        packets = fates(recipient, heard, position_m, is_broadcast=False)
        counts = _addressed_counts(packets, len(recipient))
    view = layers.PACKET_PLOT
    curves = []
    for name, (colour, count) in counts.items():
        # Over several windows, for the counts of single ones would hide the trend.
        recent = np.convolve(count, np.ones(RATE_WINDOWS))[: len(count)]
        recent = recent[-len(log.window) :]  # not those before this piece
        is_hidden = name == "overheard"
        curves.append(PlotCurve(view.below(name), name, colour, recent, is_hidden=is_hidden))
    return Plot(title=f"Packets in {RATE_WINDOWS} windows: {sent}", view=view, curves=curves)


Counts = dict[str, tuple[Colour, Int[np.ndarray, "T"]]]  # of packets in each window, by their names


def _broadcast_counts(recipient: Phases, heard: Phases) -> Counts:
    sent = np.sum(is_other(recipient), axis=(1, 2))
    row, phase, hearer = np.nonzero(is_other(heard))
    # A packet that several robots heard counts once.
    heard_row, _, _ = np.unique([row, phase, heard[row, phase, hearer]], axis=1)
    num_heard = np.bincount(heard_row, minlength=len(heard))
    return {"sent": (palette.SENT, sent), "heard": (palette.BROADCAST, num_heard)}


def _addressed_counts(packets: Mapping[Fate, PacketPaths], num_windows: int) -> Counts:
    counts: Counts = {}
    for fate, colour in palette.COUNTED.items():
        counts[fate] = (colour, np.bincount(packets[fate].row, minlength=num_windows))
    return counts


def _link_plot(log: Log) -> Plot:
    window = log.mismatch.window
    num_snapshots = len(window)
    links = by_kind(log.mismatch.links)
    num_too_weak = np.bincount(links["too_weak"]["row"], minlength=num_snapshots)
    num_unbelieved = np.bincount(links["unbelieved"]["row"], minlength=num_snapshots)
    view = layers.LINK_PLOT
    too_weak = PlotCurve(
        view.below("believed,_too_weak"),
        "believed, too weak",
        palette.TOO_WEAK,
        100.0 * (num_too_weak / np.maximum(1, log.num_believed)),
        window=window,
    )
    unbelieved = PlotCurve(
        view.below("works,_unbelieved"),
        "works, unbelieved",
        palette.UNBELIEVED,
        100.0 * (num_unbelieved / np.maximum(1, log.num_working)),
        window=window,
    )
    cut_off = PlotCurve(
        view.below(f"cut_off_from_r{log.ego}"),
        f"cut off from r{log.ego}",
        palette.EGO,
        100.0 * log.cut_off_share[window - log.window[0]],
        window=window,
    )
    named = "predicted but dead (red), alive but not predicted (green); cut off (white)"
    return Plot(
        title=f"Link model errors [%]: {named}", view=view, curves=[too_weak, unbelieved, cut_off]
    )


def _cost_plot(cost: TaskCost) -> Plot:
    title = f"{cost.name[:1].upper()}{cost.name[1:]} [{cost.unit}]"
    view = layers.COST_PLOT
    curve = PlotCurve(view.below("cost"), cost.name, palette.VARIANCE, cost.value)
    return Plot(title=title, view=view, curves=[curve])


def draw_plots(out: RerunLog) -> None:
    """Draw the curves of all plots."""
    tops = out.drawn.tops
    for plot in plots(out.log):
        for curve in plot.curves:
            _draw_curve(out, curve)
            if not curve.is_hidden:
                highest = float(np.max(curve.values + curve.std))
                tops[plot.view.path] = max(tops.get(plot.view.path, 0.0), highest)
    if shows_agreement(out.log):
        out.drawn.variance_m2ps2.append(out.log.velocity_variance_m2ps2)


def shows_agreement(log: Log) -> bool:
    """Tell whether a plot has the velocity variance, by which flocks agree."""
    is_plotted = log.task_cost is None or log.task_cost.name == VELOCITY_VARIANCE.title
    return is_plotted and log.facts.mission.flocks


def agreed(out: RerunLog) -> int | None:
    """Return the window from which on the flock has agreed, to the last one drawn, if it has."""
    if not shows_agreement(out.log):
        return None
    variance = np.concatenate(out.drawn.variance_m2ps2)
    (since,) = agreed_window(variance[:, None])
    return None if np.isnan(since) else int(since)


def draw_agreement(out: RerunLog) -> None:
    """Draw a line up the plot of the velocity variance where the flock has agreed for good.

    That is known in the end only: as long as more windows follow, it may agree later.
    """
    since = agreed(out)
    if since is None:
        return
    # Without aggregation: the viewer would draw the mean of both ends.
    look = rr.SeriesLines(
        widths=[1.6],
        colors=[palette.AGREED],
        names=["the flock has agreed"],
        aggregation_policy=rr.components.AggregationPolicy.Off,
    )
    out.fixed(layers.AGREED, look)
    top = palette.nice_top(out.drawn.tops[layers.COST_PLOT.path])
    both_ends = rr.Scalars.columns(scalars=[0.0, top])
    out.timed(layers.AGREED, both_ends, np.array([since, since]))


def _draw_curve(out: RerunLog, curve: PlotCurve) -> None:
    colours = [curve.colour]
    names = [curve.name]
    if isinstance(curve.std, float):
        line = rr.SeriesLines(widths=[1.6], colors=colours, names=names)
        columns = rr.Scalars.columns(scalars=curve.values)
    else:
        line = rr.Measurements.from_fields(widths=[2.0], colors=colours, names=names)
        columns = rr.Measurements.columns(values=curve.values, variances=curve.std**2)
    out.look(curve.entity, line)
    out.timed(curve.entity, columns, curve.window)
