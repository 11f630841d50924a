"""Beside the map: the ego robot's tree, the age matrix, the plots and the radio's state lanes."""

import numpy as np
import rerun as rr
from jaxtyping import Int

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.replay import palette
from swarm_mj.replay.dendrogram import dendrogram
from swarm_mj.replay.links import Links, broadcast_counts, transmitters
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.sheet import Sheet, screen
from swarm_mj.replay.tensor_column import tensor_column

TREE_WIDTH, TREE_HEIGHT = 600.0, 400.0  # of the tree's view, in its own units
RATE_WINDOWS = 10  # packets are counted over the last second


def draw_tree(sheet: Sheet, full_scale: float) -> None:
    """The ego robot's parent tree as a dendrogram, nodes in the colour of their age."""
    log = sheet.log
    place = dendrogram(log.parent, log.is_known, log.ego)
    max_hops = max(4.0, float(np.nanmax(place[..., 0])))
    place *= (TREE_WIDTH / max_hops, TREE_HEIGHT)
    _draw_hop_lines(sheet, int(max_hops))
    colours = palette.age_colours(log.ego_age, full_scale, log.is_known)
    colours[:, log.ego] = palette.EGO
    shown = log.is_known.copy()
    shown[:, log.ego] = True
    style = {"radii": screen(4.5), "draw_order": 2.0}
    where, per_window = place[shown], np.sum(shown, axis=1)
    sheet.layer(
        "tree/nodes", rr.Points2D, style, per_window, positions=where, colors=colours[shown]
    )
    row, child = np.nonzero(log.is_known & (np.arange(log.parent.shape[1]) != log.ego))
    per_window = np.bincount(row, minlength=len(log.window))
    edges = (place[row, log.parent[row, child]], place[row, child])
    sheet.lines("tree/edges", edges, per_window, (palette.TREE, 0.8, 1.0))


def draw_age_matrix(sheet: Sheet, full_scale: float) -> None:
    """Ages of all pairs; rows and columns in the order of a walk along the start's spanning tree.

    So neighbours stand together, and clusters show as blocks.
    """
    log = sheet.log
    order = walk(spanning_tree(log.position_m[:1])[0])
    ages = np.minimum(log.age[:, order][:, :, order], full_scale).astype(np.float16)
    # Reversed, so that bright is fresh as on the map.
    sheet.fixed("ages", rr.Tensor.from_fields(value_range=[full_scale, 0.0]))
    sheet.timed("ages", tensor_column(ages, ("robot", "about robot")), log.age_window)


def draw_plots(sheet: Sheet, packets: dict[str, Links]) -> None:
    """Age of information, packets per second and velocity variance over the mission."""
    log = sheet.log
    sheet.layer(
        "plots/age/mean",
        rr.Measurements,
        {"names": ["team, mean ± std"], "colors": [palette.MEAN_AGE], "widths": [2.0]},
        values=log.age_mean,
        variances=log.age_std**2,
    )
    _plot(sheet, "plots/age/worst", "worst pair", palette.WORST_AGE, log.age_max)
    own_mean = np.mean(log.ego_age, axis=1)
    _plot(sheet, "plots/age/ego", f"r{log.ego}, mean", palette.EGO, own_mean)
    if log.has_motion:
        variance = log.velocity_variance_m2ps2
        _plot(sheet, "plots/flock/variance", "velocity variance", palette.VARIANCE, variance)
    for name, (colour, per_window) in packet_counts(log, packets).items():
        _plot(sheet, f"plots/radio/{name}", name, colour, rate(per_window))


def packet_counts(
    log: Log, packets: dict[str, Links]
) -> dict[str, tuple[palette.Colour, Int[np.ndarray, "T"]]]:
    """What is plotted of the packets: the curves' names and colours, and counts per window."""
    if log.is_broadcast:
        sent, heard = broadcast_counts(log)
        return {"sent": (palette.SENT, sent), "heard": (palette.BROADCAST, heard)}
    fates = ("delivered", "lost", "overheard", "answered")
    return {fate: (getattr(palette, fate.upper()), packets[fate].per_window) for fate in fates}


def draw_states(sheet: Sheet) -> None:
    """A lane per robot: what it did with the radio in each window, logged when it changes."""
    names, colours, state = radio_states(sheet.log)
    for i in range(state.shape[1]):
        path = f"state/r{i:03d}"
        sheet.fixed(
            path,
            rr.StateConfiguration(
                values=names,
                labels=names,
                visible=[name != "silent" for name in names],
                colors=np.array(colours, dtype=np.uint8),
            ),
        )
        changes = np.flatnonzero(np.diff(state[:, i], prepend=-1))
        sheet.timed(
            path,
            rr.StateChange.columns(state=names[state[changes, i]]),
            sheet.log.window[changes],
        )


def radio_states(log: Log) -> tuple[np.ndarray, list[palette.Colour], Int[np.ndarray, "T N"]]:
    """What every robot did with the radio in every window.

    Returns:
        The states' names, their colours, and each robot's state as an index into both; sending
        goes before answering, answering before hearing.
    """
    robots = np.arange(log.recipient.shape[2])
    state = np.where(np.any(log.heard != robots, axis=1), 1, 0)
    if log.is_broadcast:
        state[transmitters(log)] = 2
        names, colours = ["silent", "hears", "transmits"], [palette.RANGE, palette.BROADCAST]
        return np.array(names), [palette.BACKGROUND, *colours], state
    names = np.array(["silent", "overhears", "answers", "is lost", "delivers"])
    colours = [palette.OVERHEARD, palette.ANSWERED, palette.LOST, palette.DELIVERED]
    is_delivered = np.take_along_axis(log.heard, log.recipient, axis=2)[:, 0] == robots
    state[log.recipient[:, 1] != robots] = 2
    state[transmitters(log)] = np.where(is_delivered, 4, 3)[transmitters(log)]
    return names, [palette.BACKGROUND, *colours], state


def rate(per_window: Int[np.ndarray, "T"]) -> np.ndarray:
    """Packets in the last second, at each window."""
    return np.convolve(per_window, np.ones(RATE_WINDOWS))[: len(per_window)]


def walk(parent: Int[np.ndarray, "N"]) -> Int[np.ndarray, "N"]:
    """Robots in the order of a depth-first walk from the tree's root."""
    stack = [int(np.flatnonzero(parent == ROOT)[0])]
    order: list[int] = []
    while stack:
        order.append(stack.pop())
        stack.extend(np.flatnonzero(parent == order[-1]).tolist())
    return np.array(order)


def _plot(sheet: Sheet, path: str, name: str, colour: palette.Colour, values: np.ndarray) -> None:
    sheet.fixed(path, rr.SeriesLines(colors=[colour], names=[name], widths=[1.6]))
    sheet.timed(path, rr.Scalars.columns(scalars=values))


def _draw_hop_lines(sheet: Sheet, max_hops: int) -> None:
    """A vertical line for each number of hops."""
    across = np.arange(1, max_hops + 1) * (TREE_WIDTH / max_hops)
    strips = [[(x, -10.0), (x, TREE_HEIGHT + 10.0)] for x in across]
    sheet.fixed(
        "tree/hops",
        rr.LineStrips2D(strips, colors=[palette.GRID], radii=screen(0.5), draw_order=0.0),
    )
