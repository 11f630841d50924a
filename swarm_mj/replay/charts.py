"""Beside the map: the ego robot's tree, the age matrix, the plots and the radio's state lanes."""

import numpy as np
import pyarrow as pa
import rerun as rr
from jaxtyping import Float, Int, UInt8

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.protocol.costs import TaskCost
from swarm_mj.replay import palette
from swarm_mj.replay.dendrogram import dendrogram
from swarm_mj.replay.links import Links, broadcast_counts, transmitters
from swarm_mj.replay.looks import Looks
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.sheet import Sheet

TREE_WIDTH, TREE_HEIGHT = 600.0, 400.0  # of the tree's view, in its own units
RATE_WINDOWS = 10  # that packets are counted over


def draw_tree(sheet: Sheet, colours: UInt8[np.ndarray, "T N 3"]) -> None:
    """Return the ego robot's parent tree as a dendrogram, nodes in their robots' colours."""
    log = sheet.log
    place = dendrogram(log.parent, log.is_known, log.ego)
    max_hops = max(4.0, float(np.nanmax(place[..., 0])))
    place *= (TREE_WIDTH / max_hops, TREE_HEIGHT)
    across = np.arange(1, int(max_hops) + 1) * (TREE_WIDTH / int(max_hops))
    strips = [[(x, -10.0), (x, TREE_HEIGHT + 10.0)] for x in across]
    sheet.fixed_layer("tree/hops", strips=strips)
    row, child = np.nonzero(log.has_parent)
    sheet.lines("tree/edges", place[row, log.parent[row, child]], place[row, child], row)
    row, node = np.nonzero(~np.isnan(place[..., 0]))
    sheet.layer("tree/nodes", row, positions=place[row, node], colors=colours[row, node])


def draw_age_matrix(sheet: Sheet, full_scale: float) -> None:
    """Ages of all pairs; rows and columns in the order of a walk along the start's spanning tree.

    So neighbours stand together, and clusters show as blocks.
    """
    log = sheet.log
    order = walk(spanning_tree(log.position_m[:1])[0])
    ages = np.minimum(log.age[:, order][:, :, order], full_scale).astype(np.float16)
    # Reversed, so that bright is fresh as on the map.
    sheet.fixed("ages", rr.Tensor.from_fields(value_range=[full_scale, 0.0]))
    # `Tensor.columns` takes no batches in rerun 0.41.
    tensors = [rr.Tensor(matrix, dim_names=("robot", "about robot")) for matrix in ages]
    batches = [tensor.as_component_batches()[0] for tensor in tensors]
    name = batches[0].component_descriptor()
    column = pa.concat_arrays([batch.as_arrow_array() for batch in batches])
    sheet.timed("ages", [rr.ComponentColumn(name, rr.AnyBatchValue(name, column))], log.age_window)


def draw_plots(sheet: Sheet, packets: dict[str, Links]) -> None:
    """Age of information, packets and the task's cost over the mission."""
    log = sheet.log
    style = {"colors": [palette.MEAN_AGE], "widths": [2.0]}
    sheet.fixed("plots/age/mean", rr.Measurements.from_fields(names=["team, mean ± std"], **style))
    mean = rr.Measurements.columns(values=log.age_mean, variances=log.age_std**2)
    sheet.timed("plots/age/mean", mean)
    _plot(sheet, "plots/age/worst", "worst pair", palette.WORST_AGE, log.age_max)
    own_mean = np.mean(log.ego_age, axis=1)
    _plot(sheet, "plots/age/ego", f"r{log.ego}, mean", palette.EGO, own_mean)
    if (cost := shown_cost(log)) is not None:
        _plot(sheet, "plots/task/cost", cost.name, palette.VARIANCE, cost.value)
    for name, (colour, per_window) in packet_counts(log, packets).items():
        _plot(sheet, f"plots/radio/{name}", name, colour, rate(per_window))
    if log.looks is not None:
        for name, (colour, share) in surprise_shares(log, log.looks).items():
            path = "plots/world/" + name.replace(" ", "_")
            _plot(sheet, path, name, colour, share, log.looks.window)


def shown_cost(log: Log) -> TaskCost | None:
    """What is plotted of the task: its cost or else, of robots that move, the velocity variance."""
    if log.task_cost is not None or not log.has_motion:
        return log.task_cost
    return TaskCost(name="velocity variance", unit="m²/s²", value=log.velocity_variance_m2ps2)


def packet_counts(
    log: Log, packets: dict[str, Links]
) -> dict[str, tuple[palette.Colour, Int[np.ndarray, "T"]]]:
    """What is plotted of the packets: the curves' names and colours, and counts per window."""
    if log.is_broadcast:
        sent, heard = broadcast_counts(log)
        return {"sent": (palette.SENT, sent), "heard": (palette.BROADCAST, heard)}
    fates = ("delivered", "lost", "overheard", "answered")
    return {fate: (getattr(palette, fate.upper()), packets[fate].per_window) for fate in fates}


def surprise_shares(
    log: Log, looks: Looks
) -> dict[str, tuple[palette.Colour, Float[np.ndarray, "C"]]]:
    """What is plotted of a world beyond free space: names, colours, and shares at each look [%]."""
    at = looks.window - log.window[0]
    links = {
        kind: np.bincount(found.row, minlength=len(at))
        for kind, found in looks.surprises.by_kind.items()
    }
    none = np.zeros(len(log.window), dtype=int)
    num_believed = (none if log.num_believed is None else log.num_believed)[at]
    num_working = (none if log.num_working is None else log.num_working)[at]
    num_others = np.maximum(1, np.sum(log.is_on[at], axis=1) - 1)
    is_cut_off = np.sum(log.is_cut_off[at], axis=1)
    return {
        "believed, too weak": (palette.TOO_WEAK, _percent(links["too_weak"], num_believed)),
        "works, unbelieved": (palette.UNBELIEVED, _percent(links["unbelieved"], num_working)),
        f"cut off from r{log.ego}": (palette.EGO, _percent(is_cut_off, num_others)),
    }


def _percent(part: Int[np.ndarray, "C"], of: Int[np.ndarray, "C"]) -> Float[np.ndarray, "C"]:
    return 100.0 * part / np.maximum(1, of)


def draw_states(sheet: Sheet) -> None:
    """A lane per robot: what it did with the radio in each window, logged when it changes."""
    states, state = radio_states(sheet.log)
    names = np.array(list(states))
    configuration = rr.StateConfiguration(
        values=names,
        labels=names,
        visible=names != "silent",
        colors=np.array(list(states.values()), dtype=np.uint8),
    )
    for i in range(state.shape[1]):
        path = f"state/r{i:03d}"
        sheet.fixed(path, configuration)
        changes = np.flatnonzero(np.diff(state[:, i], prepend=-1))
        columns = rr.StateChange.columns(state=names[state[changes, i]])
        sheet.timed(path, columns, sheet.log.window[changes])


def radio_states(log: Log) -> tuple[dict[str, palette.Colour], Int[np.ndarray, "T N"]]:
    """What every robot did with the radio in every window.

    Returns:
        The states' names and colours, and each robot's state as an index into them; sending goes
        before answering, answering before hearing.
    """
    robots = np.arange(log.recipient.shape[2])
    state = np.where(np.any(log.heard != robots, axis=1), 1, 0)
    states = {"silent": palette.BACKGROUND}
    if log.is_broadcast:
        state[transmitters(log)] = 2
        return states | {"hears": palette.RANGE, "transmits": palette.BROADCAST}, state
    is_delivered = np.take_along_axis(log.heard, log.recipient, axis=2)[:, 0] == robots
    state[log.recipient[:, 1] != robots] = 2
    state[transmitters(log)] = np.where(is_delivered, 4, 3)[transmitters(log)]
    return states | {
        "overhears": palette.OVERHEARD,
        "answers": palette.ANSWERED,
        "is lost": palette.LOST,
        "delivers": palette.DELIVERED,
    }, state


def rate(per_window: Int[np.ndarray, "T"]) -> np.ndarray:
    """Packets in the last `RATE_WINDOWS` windows, at each window."""
    return np.convolve(per_window, np.ones(RATE_WINDOWS))[: len(per_window)]


def walk(parent: Int[np.ndarray, "N"]) -> Int[np.ndarray, "N"]:
    """Robots in the order of a depth-first walk from the tree's root."""
    stack = [int(np.flatnonzero(parent == ROOT)[0])]
    order: list[int] = []
    while stack:
        order.append(stack.pop())
        stack.extend(np.flatnonzero(parent == order[-1]).tolist())
    return np.array(order)


def _plot(
    sheet: Sheet,
    path: str,
    name: str,
    colour: palette.Colour,
    values: np.ndarray,
    window: Int[np.ndarray, "K"] | None = None,
) -> None:
    sheet.fixed(path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.6]))
    sheet.timed(path, rr.Scalars.columns(scalars=values), window)
