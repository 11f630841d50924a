"""Beside the map: the ego robot's tree, the age matrix, the radio's state lanes, and plots."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.protocol.mission_costs import VELOCITY_VARIANCE
from swarm_mj.replay import layers, palette
from swarm_mj.replay.layers import Entity, View
from swarm_mj.replay.links import by_kind, is_other
from swarm_mj.replay.palette import Colour, RadioState
from swarm_mj.replay.recorder import Log, in_matrix
from swarm_mj.replay.rerun_log import RerunLog

# Width and height of views, in units of their own.
TREE_SIZE = (600.0, 400.0)  # and of the matrix
STATES_SIZE = (1400.0, 1000.0)
OLDEST = 255  # shade of an age in the matrix, from 0
NUM_NAMES = 20  # of robots, about, beside the states
NUM_TICKS = 6  # of windows, about, above the states
BESIDE = 0.02  # of the states' width and height: from them to the names
RATE_WINDOWS = 10  # that packets are counted over


def draw_tree(out: RerunLog) -> None:
    """Draw the ego robot's parent tree as a dendrogram, nodes in the colours of their ages."""
    log = out.log
    shown = np.ones_like(log.is_on)  # those off, too: what is known of them may be passed on
    colours = palette.robot_colours(log.known_age, log.facts.full_scale, shown, log.ego)
    place = dendrogram(log.parent, ~np.isnan(log.known_age), log.ego)
    max_hops = max(4.0, float(np.nanmax(place[..., 0])))
    width, height = TREE_SIZE
    place *= (width / max_hops, height)
    across = np.arange(1, int(max_hops) + 1) * (width / int(max_hops))
    hops = [[(x, -10.0), (x, height + 10.0)] for x in across]
    out.fixed(layers.TREE_HOPS, layers.TREE_HOPS.look(strips=hops))
    row, child = np.nonzero(log.has_parent)
    out.lines(layers.TREE_EDGES, place[row, log.parent[row, child]], place[row, child], row)
    row, node = np.nonzero(~np.isnan(place[..., 0]))
    out.points(layers.TREE_NODES, place[row, node], row, colours[row, node])


def dendrogram(
    parent: Int[np.ndarray, "T N"], is_known: Bool[np.ndarray, "T N"], root: int
) -> Float[np.ndarray, "T N 2"]:
    """Place robots by depth [hops] and height, 0 to 1, in the root's tree P; nan if unknown."""
    found = np.full((*parent.shape, 2), np.nan)
    for parents, known, place in zip(parent.tolist(), is_known, found, strict=True):
        others = [k for k in reversed(np.flatnonzero(known).tolist()) if k != root]
        order, children = walk(parents, others, root)
        place[root, 0] = 0.0
        for j in order[1:]:
            place[j, 0] = place[parents[j], 0] + 1.0
        leaves = [j for j in order if j not in children]
        place[leaves, 1] = np.linspace(0.0, 1.0, len(leaves)) if len(leaves) > 1 else 0.5
        for j in reversed(order):  # a parent stands amid its children, which come before it
            if j in children:
                place[j, 1] = np.mean(place[children[j], 1])
    return found


def walk(
    parent: Sequence[int], robots: Iterable[int], root: int
) -> tuple[list[int], dict[int, list[int]]]:
    """Return the root and robots in depth-first order, last children first, and the children."""
    children: dict[int, list[int]] = {}
    for k in robots:
        children.setdefault(parent[k], []).append(k)
    order: list[int] = []
    stack = [root]
    while stack:
        order.append(stack.pop())
        stack.extend(children.get(order[-1], []))
    return order, children


def draw_age_matrix(out: RerunLog) -> None:
    """Draw the ages of all pairs; neighbours, along the start's spanning tree, stand together."""
    log = out.log
    full_scale = log.facts.full_scale
    order = _neighbours_together(log)
    shown = np.ix_(order, order)
    shades = np.empty((len(log.age), len(order), len(order)), dtype=np.uint8)
    for k, age in enumerate(log.age):  # one by one: copies of all would take most of the memory
        shades[k] = np.rint(OLDEST * np.minimum(age[shown] / full_scale, 1.0))
    ages = np.linspace(0.0, full_scale, OLDEST + 1)
    names = [f"{age:.0f} windows" for age in ages[:-1]] + [f"{full_scale:g} windows or more"]
    colours = palette.age_colours(ages, full_scale).tolist()
    _draw_classes(out, layers.AGES, shades[0].shape, names, colours, TREE_SIZE)
    columns = rr.SegmentationImage.columns(buffer=shades.reshape(len(shades), -1))
    out.timed(layers.AGES, columns, log.age_window)


def _neighbours_together(log: Log) -> list[int]:
    """Return the places of the recorded matrix's rows in the order in which they are drawn."""
    parent = spanning_tree(log.position_m[:1])[0].tolist()
    num_robots = len(parent)
    recorded = {robot: place for place, robot in enumerate(in_matrix(num_robots))}
    walked, _ = walk(parent, range(num_robots), ROOT)
    # The tree's root is no robot. Of a large team only every k-th robot was recorded.
    return [recorded[robot] for robot in walked[1:] if robot in recorded]


def draw_states(out: RerunLog) -> None:
    """Draw a row per robot: what it did with the radio in each window; a line marks this one."""
    log = out.log
    colours = palette.BROADCAST_STATES if log.facts.is_broadcast else palette.ADDRESSED_STATES
    state = radio_states(log).T
    names = list(colours)
    _draw_classes(out, layers.STATES, state.shape, names, list(colours.values()), STATES_SIZE)
    shades = np.argmax([state == name for name in names], axis=0).astype(np.uint8)
    image = rr.SegmentationImage.from_fields(buffer=shades.tobytes())
    out.fixed(layers.STATES, image)
    num_robots, num_windows = state.shape
    rows = np.arange(num_windows)
    top = np.stack([rows + 0.5, np.zeros(num_windows)], axis=1)
    bottom = np.stack([rows + 0.5, np.full(num_windows, float(num_robots))], axis=1)
    out.lines(layers.NOW, top, bottom, rows)
    left = -BESIDE * num_windows
    above = -BESIDE * num_robots
    robots = range(0, num_robots, max(1, num_robots // NUM_NAMES))
    # rerun writes below a point.
    places = [(left, i + 0.5 + above) for i in robots]
    out.words(layers.STATE_ROBOTS, [f"r{i}" for i in robots], places)
    every = max(1, int(palette.nice_top(num_windows / NUM_TICKS)))
    ticks = np.flatnonzero(log.window % every == 0).tolist()
    places = [(k + 0.5, 2.0 * above) for k in ticks]
    out.words(layers.STATE_WINDOWS, [str(log.window[k]) for k in ticks], places)


def _draw_classes(
    out: RerunLog,
    entity: Entity,
    shape: Sequence[int],
    names: Sequence[str],
    colours: Sequence[Sequence[int]],
    size: tuple[float, float],
) -> None:
    """Prepare an image of classes, each a name and a colour, as large as this in its view."""
    # rerun's own views of tensors and of states write over them, and show short states as grey.
    classes = [(k, name, colours[k]) for k, name in enumerate(names)]
    out.fixed(entity, rr.AnnotationContext(classes))
    height, width = shape
    x, y = size
    form = rr.components.ImageFormat(height=height, width=width, channel_datatype="U8")
    out.fixed(entity, rr.SegmentationImage.from_fields(format=form, opacity=1.0))
    out.fixed(entity, rr.Transform3D(mat3x3=np.diag([x / width, y / height, 1.0])))


def radio_states(log: Log) -> Shaped[np.ndarray, "T N"]:
    """Return the radios' states by name: sending goes before answering, that before hearing."""
    robots = np.arange(log.recipient.shape[2])
    sends = log.is_transmitter
    hears = np.any(log.heard != robots, axis=1)
    order: dict[RadioState, np.ndarray]
    if log.facts.is_broadcast:
        order = {"transmits": sends, "hears": hears}
    else:
        delivers = np.take_along_axis(log.heard, log.recipient, axis=2)[:, 0] == robots
        answers = log.recipient[:, 1] != robots
        order = {
            "delivers": sends & delivers,
            "is lost": sends,
            "answers": answers,
            "overhears": hears,
        }
    silent: RadioState = "silent"
    return np.select(list(order.values()), list(order), silent)


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
        found.append(_cost_plot(cost))
    return found


def _age_plot(log: Log) -> Plot:
    own = f"r{log.ego}"
    view = layers.AGE_PLOT
    mean = PlotCurve(
        layers.MEAN_AGE, "team, mean ± std", palette.MEAN_AGE, log.age_mean, std=log.age_std
    )
    worst = PlotCurve(
        view.below("worst"), "worst pair", palette.WORST_AGE, log.age_max, is_hidden=True
    )
    ego_age = np.mean(log.ego_age, axis=1)
    ego = PlotCurve(view.below("ego"), f"{own}, mean", palette.EGO, ego_age)
    title = f"Age of information [windows]: team ± std (green), {own} (white)"
    return Plot(title=title, view=view, curves=[mean, worst, ego])


def _packet_plot(log: Log) -> Plot:
    if log.facts.is_broadcast:
        sent = "sent (grey), heard by anyone (blue)"
        counts = _broadcast_counts(log)
    else:
        sent = "delivered (green), lost (orange), answered (blue)"
        counts = _addressed_counts(log)
    view = layers.PACKET_PLOT
    curves = []
    for name, (colour, count) in counts.items():
        # Over several windows, for the counts of single ones would hide the trend.
        recent = np.convolve(count, np.ones(RATE_WINDOWS))[: len(log.window)]
        is_hidden = name == "overheard"
        curves.append(PlotCurve(view.below(name), name, colour, recent, is_hidden=is_hidden))
    return Plot(title=f"Packets in {RATE_WINDOWS} windows: {sent}", view=view, curves=curves)


Counts = dict[str, tuple[Colour, Int[np.ndarray, "T"]]]  # of packets in each window, by their names


def _broadcast_counts(log: Log) -> Counts:
    sent = np.sum(is_other(log.recipient), axis=(1, 2))
    row, phase, hearer = np.nonzero(is_other(log.heard))
    # A packet that several robots heard counts once.
    heard = np.unique([row, phase, log.heard[row, phase, hearer]], axis=1)
    num_heard = np.bincount(heard[0], minlength=len(log.window))
    return {"sent": (palette.SENT, sent), "heard": (palette.BROADCAST, num_heard)}


def _addressed_counts(log: Log) -> Counts:
    counts: Counts = {}
    for fate, colour in palette.COUNTED.items():
        counts[fate] = (colour, np.bincount(log.packets[fate].row, minlength=len(log.window)))
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
    named = "believed, too weak (red); works, unbelieved (green); cut off (white)"
    return Plot(title=f"Share [%]: {named}", view=view, curves=[too_weak, unbelieved, cut_off])


def _cost_plot(cost: TaskCost) -> Plot:
    title = f"{cost.name[:1].upper()}{cost.name[1:]} [{cost.unit}]"
    view = layers.COST_PLOT
    curve = PlotCurve(view.below("cost"), cost.name, palette.VARIANCE, cost.value)
    return Plot(title=title, view=view, curves=[curve])


def draw_plots(out: RerunLog) -> None:
    """Draw the curves of all plots."""
    for plot in plots(out.log):
        for curve in plot.curves:
            _draw_curve(out, curve)


def _draw_curve(out: RerunLog, curve: PlotCurve) -> None:
    colours = [curve.colour]
    names = [curve.name]
    if isinstance(curve.std, float):
        line = rr.SeriesLines(widths=[1.6], colors=colours, names=names)
        columns = rr.Scalars.columns(scalars=curve.values)
    else:
        line = rr.Measurements.from_fields(widths=[2.0], colors=colours, names=names)
        columns = rr.Measurements.columns(values=curve.values, variances=curve.std**2)
    out.fixed(curve.entity, line)
    out.timed(curve.entity, columns, curve.window)
