"""Beside the map: the ego robot's tree, the age matrix, the radio's state lanes, and plots."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import rerun as rr
from jaxtyping import Bool, Float, Int, UInt8

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.replay import palette
from swarm_mj.replay.mismatch import LinkMismatch
from swarm_mj.replay.packets import PacketLinks, is_other, transmitters
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.rerun_log import RerunLog

TREE_WIDTH, TREE_HEIGHT = 600.0, 400.0  # of the tree's view, in its own units
RATE_WINDOWS = 10  # that packets are counted over


def draw_tree(out: RerunLog, colours: UInt8[np.ndarray, "T N 3"]) -> None:
    """Draw the ego robot's parent tree as a dendrogram, nodes in their robots' colours."""
    log = out.log
    place = dendrogram(log.parent, log.is_known, log.ego)
    max_hops = max(4.0, float(np.nanmax(place[..., 0])))
    place *= (TREE_WIDTH / max_hops, TREE_HEIGHT)
    across = np.arange(1, int(max_hops) + 1) * (TREE_WIDTH / int(max_hops))
    strips = [[(x, -10.0), (x, TREE_HEIGHT + 10.0)] for x in across]
    out.fixed_layer("tree/hops", strips=strips)
    row, child = np.nonzero(log.has_parent)
    out.lines("tree/edges", place[row, log.parent[row, child]], place[row, child], row)
    row, node = np.nonzero(~np.isnan(place[..., 0]))
    out.layer("tree/nodes", row, positions=place[row, node], colors=colours[row, node])


def dendrogram(
    parent: Int[np.ndarray, "T N"], is_known: Bool[np.ndarray, "T N"], root: int
) -> Float[np.ndarray, "T N 2"]:
    """Place robots by depth [hops] and height, 0 to 1, in the root's tree P; nan if unknown."""
    place = np.full((*parent.shape, 2), np.nan)
    is_child = is_known & (np.arange(parent.shape[1]) != root)
    for parents, known, its in zip(parent.tolist(), is_child, place, strict=True):
        _place(parents, np.flatnonzero(known).tolist(), root, its)
    return place


def _place(
    parent: Sequence[int], known: Sequence[int], root: int, place: Float[np.ndarray, "N 2"]
) -> None:
    """Walk depth first, so that subtrees stay together; a parent stands amid its children."""
    children: dict[int, list[int]] = {}
    for k in known:
        children.setdefault(parent[k], []).append(k)
    depth, order, stack = {root: 0.0}, [], [root]
    while stack:
        j = stack.pop()
        order.append(j)
        stack.extend(reversed(children.get(j, [])))
        depth.update((k, depth[j] + 1.0) for k in children.get(j, []))
    leaves = [j for j in order if j not in children]
    height = {j: float(rank) for rank, j in enumerate(leaves)}
    for j in reversed(order):  # children before parents
        if j in children:
            height[j] = sum(height[k] for k in children[j]) / len(children[j])
    for j in order:
        place[j] = (depth[j], height[j] / (len(leaves) - 1) if len(leaves) > 1 else 0.5)


def draw_age_matrix(out: RerunLog, full_scale: float) -> None:
    """Draw the ages of all pairs, in the order of a walk along the start's spanning tree.

    So neighbours stand together, and clusters show as blocks.
    """
    log = out.log
    order = walk(spanning_tree(log.position_m[:1])[0])
    ages = np.minimum(log.age[:, order][:, :, order], full_scale).astype(np.float16)
    # Reversed, so that bright is fresh as on the map.
    out.fixed("ages", rr.Tensor.from_fields(value_range=[full_scale, 0.0]))
    # `Tensor.columns` takes no batches in rerun 0.41.
    tensors = [rr.Tensor(matrix, dim_names=("robot", "about robot")) for matrix in ages]
    batches = [tensor.as_component_batches()[0] for tensor in tensors]
    name = batches[0].component_descriptor()
    column = pa.concat_arrays([batch.as_arrow_array() for batch in batches])
    out.timed("ages", [rr.ComponentColumn(name, rr.AnyBatchValue(name, column))], log.age_window)


def walk(parent: Int[np.ndarray, "N"]) -> Int[np.ndarray, "N"]:
    """Return robots in the order of a depth-first walk from the tree's root."""
    stack = [int(np.flatnonzero(parent == ROOT)[0])]
    order: list[int] = []
    while stack:
        order.append(stack.pop())
        stack.extend(np.flatnonzero(parent == order[-1]).tolist())
    return np.array(order)


def draw_states(out: RerunLog) -> None:
    """Draw a lane per robot: what it did with the radio, logged when it changes."""
    states, state = radio_states(out.log)
    names = np.array(list(states))
    colours = np.array(list(states.values()), dtype=np.uint8)
    configuration = rr.StateConfiguration(
        values=names, labels=names, visible=names != "silent", colors=colours
    )
    for i in range(state.shape[1]):
        path = f"state/r{i:03d}"
        out.fixed(path, configuration)
        # A lane keeps its state until the next change, so that one row per window is not needed.
        changes = np.flatnonzero(np.diff(state[:, i], prepend=-1))
        columns = rr.StateChange.columns(state=names[state[changes, i]])
        out.timed(path, columns, out.log.window[changes])


def radio_states(log: Log) -> tuple[dict[str, Colour], Int[np.ndarray, "T N"]]:
    """Tell what every robot did with the radio in every window.

    Returns:
        The states' names and colours, and each robot's state as an index into them; sending goes
        before answering, answering before hearing.
    """
    robots = np.arange(log.recipient.shape[2])
    is_first = transmitters(log.recipient, is_broadcast=log.is_broadcast)
    state = np.where(np.any(log.heard != robots, axis=1), 1, 0)
    states = {"silent": palette.BACKGROUND}
    if log.is_broadcast:
        state[is_first] = 2
        return states | {"hears": palette.RANGE, "transmits": palette.BROADCAST}, state
    is_delivered = np.take_along_axis(log.heard, log.recipient, axis=2)[:, 0] == robots
    state[log.recipient[:, 1] != robots] = 2
    state[is_first] = np.where(is_delivered, 4, 3)[is_first]
    return states | {
        "overhears": palette.OVERHEARD,
        "answers": palette.ANSWERED,
        "is lost": palette.LOST,
        "delivers": palette.DELIVERED,
    }, state


class PlotCurve(NamedTuple):
    """One curve of a plot."""

    path: str  # of its entity, below "plots"
    name: str
    colour: Colour
    values: np.ndarray
    std: np.ndarray | None = None
    window: np.ndarray | None = None  # of each value; None: all of the log's
    is_hidden: bool = False  # it would dwarf the others; the viewer can show it


class Plot(NamedTuple):
    """Curves over the mission on a common axis."""

    name: str  # says what the curves are: a legend would cover them
    curves: list[PlotCurve]


def plots(log: Log, packets: dict[str, PacketLinks]) -> list[Plot]:
    """Return the plots of age, packets, mismatched links and the task's cost, as far as apply."""
    own = f"r{log.ego}"
    ages = [
        PlotCurve("age/mean", "team, mean ± std", palette.MEAN_AGE, log.age_mean, log.age_std),
        PlotCurve("age/worst", "worst pair", palette.WORST_AGE, log.age_max, is_hidden=True),
        PlotCurve("age/ego", f"{own}, mean", palette.EGO, np.mean(log.ego_age, axis=1)),
    ]
    found = [Plot(f"Age of information [windows]: team ± std (green), {own} (white)", ages)]
    found.append(_packet_plot(log, packets))
    if log.mismatch is not None:
        found.append(_mismatch_plot(log, log.mismatch))
    if (cost := log.task_cost) is not None:
        found.append(_cost_plot(cost.name, cost.unit, cost.value))
    elif log.has_motion:
        found.append(_cost_plot("velocity variance", "m²/s²", log.velocity_variance_m2ps2))
    return found


def _packet_plot(log: Log, packets: dict[str, PacketLinks]) -> Plot:
    if log.is_broadcast:
        sent, heard = broadcast_counts(log)
        counts = {"sent": (palette.SENT, sent), "heard": (palette.BROADCAST, heard)}
        named = "sent (grey), heard by anyone (blue)"
    else:
        fates = ("delivered", "lost", "overheard", "answered")
        num = len(log.window)
        counts = {
            fate: (getattr(palette, fate.upper()), np.bincount(packets[fate].row, minlength=num))
            for fate in fates
        }
        named = "delivered (green), lost (orange), answered (blue)"
    curves = [
        PlotCurve(f"radio/{name}", name, colour, rate(count), is_hidden=name == "overheard")
        for name, (colour, count) in counts.items()
    ]
    return Plot(f"Packets in {RATE_WINDOWS} windows: {named}", curves)


def broadcast_counts(log: Log) -> tuple[Int[np.ndarray, "T"], Int[np.ndarray, "T"]]:
    """Count the broadcasts sent in each window, and those that any robot decoded."""
    row, phase, hearer = np.nonzero(is_other(log.heard))
    is_heard = np.zeros(log.heard.shape, dtype=bool)
    is_heard[row, phase, log.heard[row, phase, hearer]] = True
    return np.sum(is_other(log.recipient), axis=(1, 2)), np.sum(is_heard, axis=(1, 2))


def _mismatch_plot(log: Log, mismatch: LinkMismatch) -> Plot:
    at = mismatch.window - log.window[0]
    num = {
        kind: np.bincount(links.row, minlength=len(at)) for kind, links in mismatch.by_kind.items()
    }
    none = np.zeros(len(log.window), dtype=int)
    num_believed = (none if log.num_believed is None else log.num_believed)[at]
    num_working = (none if log.num_working is None else log.num_working)[at]
    num_others, num_cut_off = np.sum(log.is_on[at], axis=1) - 1, np.sum(log.is_cut_off[at], axis=1)
    shares = {
        "believed, too weak": (palette.TOO_WEAK, num["too_weak"], num_believed),
        "works, unbelieved": (palette.UNBELIEVED, num["unbelieved"], num_working),
        f"cut off from r{log.ego}": (palette.EGO, num_cut_off, num_others),
    }
    curves = []
    for name, (colour, part, of) in shares.items():
        percent, path = 100.0 * part / np.maximum(1, of), "world/" + name.replace(" ", "_")
        curves.append(PlotCurve(path, name, colour, percent, window=mismatch.window))
    named = "believed, too weak (red); works, unbelieved (green); cut off (white)"
    return Plot(f"Share [%]: {named}", curves)


def _cost_plot(name: str, unit: str, value: Float[np.ndarray, "T"]) -> Plot:
    title = f"{name[:1].upper()}{name[1:]} [{unit}]"
    return Plot(title, [PlotCurve("task/cost", name, palette.VARIANCE, value)])


def draw_plots(out: RerunLog, shown: Sequence[Plot]) -> None:
    """Draw the curves of all plots."""
    for curve in (curve for plot in shown for curve in plot.curves):
        path, style = f"plots/{curve.path}", {"colors": [curve.colour], "names": [curve.name]}
        if curve.std is not None:
            out.fixed(path, rr.Measurements.from_fields(widths=[2.0], **style))
            columns = rr.Measurements.columns(values=curve.values, variances=curve.std**2)
        else:
            out.fixed(path, rr.SeriesLines(widths=[1.6], **style))
            columns = rr.Scalars.columns(scalars=curve.values)
        out.timed(path, columns, curve.window)


def rate(per_window: Int[np.ndarray, "T"]) -> np.ndarray:
    """Return the packets in the last `RATE_WINDOWS` windows, at each window."""
    # Over several windows, for the counts of single ones would hide the trend.
    return np.convolve(per_window, np.ones(RATE_WINDOWS))[: len(per_window)]
