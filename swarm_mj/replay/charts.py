"""Beside the map: the ego robot's tree, the age matrix, and the radio's state lanes."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.replay import layers, palette
from swarm_mj.replay.layer_kinds import Entity
from swarm_mj.replay.log import REQUEST, RESPONSE, Log
from swarm_mj.replay.palette import RadioState
from swarm_mj.replay.replay_size import in_matrix
from swarm_mj.replay.rerun_log import RerunLog

# Width and height of views, in units of their own.
TREE_SIZE = (600.0, 400.0)  # and of the matrix
STATES_SIZE = (1400.0, 1000.0)
OLDEST = 255  # shade of an age in the matrix, from 0
NUM_NAMES = 20  # of robots, about, beside the states
NUM_TICKS = 6  # of windows, about, above the states
BESIDE = 0.02  # of the states' width and height: from them to the names


def draw_tree(out: RerunLog) -> None:
    """Draw the ego robot's parent tree as a dendrogram, nodes in the colours of their ages."""
    log = out.log
    shown = np.ones_like(log.is_on)  # those off, too: what is known of them may be passed on
    colours = palette.robot_colours(log.known_age, log.facts.full_scale, shown, log.ego)
    tree = dendrogram(log.parent, ~np.isnan(log.known_age), log.ego)
    max_hops = max(4.0, float(np.nanmax(tree.hops)))
    width, height = TREE_SIZE
    place = np.stack([tree.hops * (width / max_hops), tree.height * height], axis=-1)
    across = np.arange(1, int(max_hops) + 1) * (width / int(max_hops))
    hops = [[(x, -10.0), (x, height + 10.0)] for x in across]
    out.fixed(layers.TREE_HOPS, layers.TREE_HOPS.look(strips=hops))
    row, child = np.nonzero(log.has_parent)
    out.lines(layers.TREE_EDGES, place[row, log.parent[row, child]], place[row, child], row)
    row, node = np.nonzero(~np.isnan(tree.hops))
    out.points(layers.TREE_NODES, place[row, node], row, colours[row, node])


class TreePlaces(NamedTuple):
    """Where robots stand in a dendrogram; nan if they are not in it."""

    hops: Float[np.ndarray, "T N"]  # from the root
    height: Float[np.ndarray, "T N"]  # from 0 to 1


def dendrogram(
    parent: Int[np.ndarray, "T N"], is_known: Bool[np.ndarray, "T N"], root: int
) -> TreePlaces:
    """Place robots in the root's tree P, in each window."""
    places = TreePlaces(hops=np.full(parent.shape, np.nan), height=np.full(parent.shape, np.nan))
    for row, parents in enumerate(parent.tolist()):
        hops = places.hops[row]
        height = places.height[row]
        others = np.flatnonzero(is_known[row]).tolist()
        if root in others:
            others.remove(root)
        order, children = walk(parents, reversed(others), root)
        hops[root] = 0.0
        for j in order[1:]:
            hops[j] = hops[parents[j]] + 1.0
        leaves = [j for j in order if j not in children]
        height[leaves] = np.linspace(0.0, 1.0, len(leaves)) if len(leaves) > 1 else 0.5
        for j in reversed(order):  # a parent stands amid its children, which come before it
            if j in children:
                height[j] = np.mean(height[children[j]])
    return places


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
        requested = log.recipient[:, REQUEST]
        delivers = np.take_along_axis(log.heard[:, REQUEST], requested, axis=1) == robots
        answers = log.recipient[:, RESPONSE] != robots
        order = {
            "delivers": sends & delivers,
            "is lost": sends,
            "answers": answers,
            "overhears": hears,
        }
    silent: RadioState = "silent"
    return np.select(list(order.values()), list(order), silent)
