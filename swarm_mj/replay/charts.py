"""Beside the map: the ego robot's tree, the age matrix, the radio's state lanes, and plots."""

import itertools
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.replay import palette
from swarm_mj.replay.links import by_kind, is_other
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.recorder import Log, in_matrix
from swarm_mj.replay.rerun_log import RerunLog

# Width and height of views, in units of their own.
TREE = (600.0, 400.0)  # and of the matrix
STATES = (1400.0, 1000.0)
OLDEST = 255  # shade of an age in the matrix, from 0
NUM_NAMES, NUM_TICKS = 20, 6  # of robots and windows, about, beside the states
BESIDE = 0.02  # of the states' width and height: from them to the names
RATE_WINDOWS = 10  # that packets are counted over


def draw_tree(out: RerunLog) -> None:
    """Draw the ego robot's parent tree as a dendrogram, nodes in the colours of their ages."""
    log = out.log
    shown = np.ones_like(log.is_on)  # those off, too: what is known of them may be passed on
    colours = palette.robot_colours(log.known_age, log.facts.full_scale, shown, log.ego)
    place = dendrogram(log.parent, ~np.isnan(log.known_age), log.ego)
    max_hops = max(4.0, float(np.nanmax(place[..., 0])))
    width, height = TREE
    place *= (width / max_hops, height)
    across = np.arange(1, int(max_hops) + 1) * (width / int(max_hops))
    out.fixed_layer("tree/hops", strips=[[(x, -10.0), (x, height + 10.0)] for x in across])
    row, child = np.nonzero(log.has_parent)
    out.lines("tree/edges", place[row, log.parent[row, child]], place[row, child], row)
    row, node = np.nonzero(~np.isnan(place[..., 0]))
    out.layer("tree/nodes", row, positions=place[row, node], colors=colours[row, node])


def dendrogram(
    parent: Int[np.ndarray, "T N"], is_known: Bool[np.ndarray, "T N"], root: int
) -> Float[np.ndarray, "T N 2"]:
    """Place robots by depth [hops] and height, 0 to 1, in the root's tree P; nan if unknown."""
    found = np.full((*parent.shape, 2), np.nan)
    for parents, known, place in zip(parent.tolist(), is_known, found, strict=True):
        others = (k for k in reversed(np.flatnonzero(known).tolist()) if k != root)
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
    order, stack = [], [root]
    while stack:
        order.append(stack.pop())
        stack.extend(children.get(order[-1], []))
    return order, children


def draw_age_matrix(out: RerunLog) -> None:
    """Draw the ages of all pairs; neighbours, along the start's spanning tree, stand together."""
    log, full_scale = out.log, out.log.facts.full_scale
    parent = spanning_tree(log.position_m[:1])[0].tolist()
    place = {robot: n for n, robot in enumerate(in_matrix(len(parent)))}
    order = [place[i] for i in walk(parent, range(len(parent)), ROOT)[0][1:] if i in place]
    shown = np.ix_(order, order)
    shades = np.empty((len(log.age), len(order), len(order)), dtype=np.uint8)
    for k, age in enumerate(log.age):  # one by one: copies of all would take most of the memory
        shades[k] = np.rint(OLDEST * np.minimum(age[shown] / full_scale, 1.0))
    ages = np.linspace(0.0, full_scale, OLDEST + 1)
    names = [f"{age:.0f} windows" for age in ages[:-1]] + [f"{full_scale:g} windows or more"]
    colours = palette.age_colours(ages, full_scale)
    _draw_classes(out, "ages", shades[0].shape, zip(names, colours, strict=True), TREE)
    columns = rr.SegmentationImage.columns(buffer=shades.reshape(len(shades), -1))
    out.timed("ages", columns, log.age_window)


def draw_states(out: RerunLog) -> None:
    """Draw a row per robot: what it did with the radio in each window; a line marks this one."""
    log = out.log
    colours = palette.BROADCAST_STATES if log.facts.is_broadcast else palette.ADDRESSED_STATES
    state = radio_states(log).T
    _draw_classes(out, "state", state.shape, colours.items(), STATES)
    shades = np.argmax([state == name for name in colours], axis=0).astype(np.uint8)
    out.fixed("state", rr.SegmentationImage.from_fields(buffer=shades.tobytes()))
    num_robots, num_windows = state.shape
    rows = np.arange(num_windows)
    top, bottom = (np.stack([rows + 0.5, np.full(num_windows, y)], axis=1) for y in (0, num_robots))
    out.lines("state/now", top, bottom, rows)
    left, above = (-BESIDE * size for size in (num_windows, num_robots))
    robots = range(0, num_robots, max(1, num_robots // NUM_NAMES))
    # rerun writes below a point.
    out.words("state/robots", [f"r{i}" for i in robots], [(left, i + 0.5 + above) for i in robots])
    every = max(1, int(palette.nice_top(num_windows / NUM_TICKS)))
    ticks = np.flatnonzero(log.window % every == 0).tolist()
    names = [str(log.window[k]) for k in ticks]
    out.words("state/windows", names, [(k + 0.5, 2.0 * above) for k in ticks])


def _draw_classes(
    out: RerunLog, path: str, shape: Sequence[int], classes: Iterable[Any], size: Sequence[float]
) -> None:
    """Prepare an image of classes, each a name and a colour, as large as this in its view."""
    # rerun's own views of tensors and of states write over them, and show short states as grey.
    out.fixed(path, rr.AnnotationContext([(k, *named) for k, named in enumerate(classes)]))
    (height, width), (x, y) = shape, size
    form = rr.components.ImageFormat(height=height, width=width, channel_datatype="U8")
    out.fixed(path, rr.SegmentationImage.from_fields(format=form, opacity=1.0))
    out.fixed(path, rr.Transform3D(mat3x3=np.diag([x / width, y / height, 1.0])))


def radio_states(log: Log) -> Shaped[np.ndarray, "T N"]:
    """Return the radios' states by name: sending goes before answering, that before hearing."""
    robots = np.arange(log.recipient.shape[2])
    sends = log.is_transmitter
    hears = np.any(log.heard != robots, axis=1)
    if log.facts.is_broadcast:
        return np.select([sends, hears], ["transmits", "hears"], palette.SILENT)
    delivers = np.take_along_axis(log.heard, log.recipient, axis=2)[:, 0] == robots
    answers = log.recipient[:, 1] != robots
    order = {"delivers": sends & delivers, "is lost": sends, "answers": answers, "overhears": hears}
    return np.select(list(order.values()), list(order), palette.SILENT)


class PlotCurve(NamedTuple):
    """One curve of a plot."""

    path: str  # of its entity, below "plots"
    name: str
    colour: Colour
    values: np.ndarray
    std: np.ndarray | float = 0.0  # the half width of a band around it
    window: np.ndarray | None = None  # of each value; None: all of the log's
    is_hidden: bool = False  # it would dwarf the others; the viewer can show it


def plots(log: Log) -> dict[str, list[PlotCurve]]:
    """Return the plots that apply, by names that say what the curves are: legends hide some."""
    own = f"r{log.ego}"
    found = {
        f"Age of information [windows]: team ± std (green), {own} (white)": [
            PlotCurve("age/mean", "team, mean ± std", palette.MEAN_AGE, log.age_mean, log.age_std),
            PlotCurve("age/worst", "worst pair", palette.WORST_AGE, log.age_max, is_hidden=True),
            PlotCurve("age/ego", f"{own}, mean", palette.EGO, np.mean(log.ego_age, axis=1)),
        ]
    }
    sent = "delivered (green), lost (orange), answered (blue)"
    if log.facts.is_broadcast:
        sent = "sent (grey), heard by anyone (blue)"
    found[f"Packets in {RATE_WINDOWS} windows: {sent}"] = _packet_curves(log)
    if log.is_compared:
        named = "believed, too weak (red); works, unbelieved (green); cut off (white)"
        found[f"Share [%]: {named}"] = _mismatch_curves(log)
    cost = log.task_cost
    if cost is None and log.facts.mission.flocks:
        variance = log.velocity_variance_m2ps2
        cost = TaskCost(name="velocity variance", unit="m²/s²", value=variance)
    if cost is not None:
        title = f"{cost.name[:1].upper()}{cost.name[1:]} [{cost.unit}]"
        found[title] = [PlotCurve("task/cost", cost.name, palette.VARIANCE, cost.value)]
    return found


def _packet_curves(log: Log) -> list[PlotCurve]:
    num = len(log.window)
    if log.facts.is_broadcast:
        row, phase, hearer = np.nonzero(is_other(log.heard))
        heard = np.unique([row, phase, log.heard[row, phase, hearer]], axis=1)  # by anyone
        counts = {
            "sent": (palette.SENT, np.sum(is_other(log.recipient), axis=(1, 2))),
            "heard": (palette.BROADCAST, np.bincount(heard[0], minlength=num)),
        }
    else:
        counts = {
            fate: (colour, np.bincount(log.packets[fate].row, minlength=num))
            for fate, colour in palette.COUNTED.items()
        }
    curves = []
    for name, (colour, count) in counts.items():
        # Over several windows, for the counts of single ones would hide the trend.
        recent = np.convolve(count, np.ones(RATE_WINDOWS))[:num]
        is_hidden = name == "overheard"
        curves.append(PlotCurve(f"radio/{name}", name, colour, recent, is_hidden=is_hidden))
    return curves


def _mismatch_curves(log: Log) -> list[PlotCurve]:
    window = log.mismatch.window
    at = window - log.window[0]
    links = by_kind(log.mismatch.links)
    num = {kind: np.bincount(its["row"], minlength=len(at)) for kind, its in links.items()}
    too_weak = num["too_weak"] / np.maximum(1, log.num_believed)
    unbelieved = num["unbelieved"] / np.maximum(1, log.num_working)
    shares = {
        "believed, too weak": (palette.TOO_WEAK, too_weak),
        "works, unbelieved": (palette.UNBELIEVED, unbelieved),
        f"cut off from r{log.ego}": (palette.EGO, log.cut_off_share[at]),
    }
    return [
        PlotCurve("world/" + name.replace(" ", "_"), name, colour, 100.0 * share, window=window)
        for name, (colour, share) in shares.items()
    ]


def draw_plots(out: RerunLog) -> None:
    """Draw the curves of all plots."""
    for curve in itertools.chain(*plots(out.log).values()):
        path, style = f"plots/{curve.path}", {"colors": [curve.colour], "names": [curve.name]}
        if isinstance(curve.std, float):
            out.fixed(path, rr.SeriesLines(widths=[1.6], **style))
            columns = rr.Scalars.columns(scalars=curve.values)
        else:
            out.fixed(path, rr.Measurements.from_fields(widths=[2.0], **style))
            columns = rr.Measurements.columns(values=curve.values, variances=curve.std**2)
        out.timed(path, columns, curve.window)
