"""Beside the map: the ego robot's tree, the age matrix and the radio's state lanes."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import rerun as rr
from jaxtyping import Bool, Float, Int, UInt8

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.replay import palette
from swarm_mj.replay.packets import transmitters
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.rerun_log import RerunLog

TREE_WIDTH, TREE_HEIGHT = 600.0, 400.0  # of the tree's view, in its own units


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
    """Place each robot that the root, the ego robot, has heard of; nan for the others (II-B).

    x is its depth [hops], y its height, 0 to 1; `parent` is P of the root's buffer.
    """
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
