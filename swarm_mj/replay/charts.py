"""Beside the map: the ego robot's tree, the age matrix, and the radio's state lanes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.replay import layers, palette
from swarm_mj.replay.log import REQUEST, RESPONSE, Log
from swarm_mj.replay.palette import Colour, RadioState
from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.walk import walk

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
    place = np.stack([tree.hops, tree.height], axis=-1)
    out.drawn.hops = max(out.drawn.hops, float(np.nanmax(tree.hops)))
    row, child = np.nonzero(log.has_parent)
    out.lines(layers.TREE_EDGES, place[row, log.parent[row, child]], place[row, child], row)
    row, node = np.nonzero(~np.isnan(tree.hops))
    out.points(layers.TREE_NODES, place[row, node], row, colours[row, node])


def draw_tree_hops(out: RerunLog) -> None:
    """Stretch the tree over its view, however deep it has been, and draw a line at each hop."""
    width, height = TREE_SIZE
    num_hops = int(out.drawn.hops)
    stretched = np.diag([width / num_hops, height, 1.0])
    out.fixed(layers.TREE, rr.Transform3D(mat3x3=stretched))
    beyond = 10.0 / height
    hops = [[(hop, -beyond), (hop, 1.0 + beyond)] for hop in range(1, num_hops + 1)]
    out.fixed(layers.TREE_HOPS, layers.TREE_HOPS.look(strips=hops))


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


def draw_age_matrix(out: RerunLog) -> None:
    """Draw the ages of all pairs; neighbours, along the start's spanning tree, stand together."""
    log = out.log
    full_scale = log.facts.full_scale
    order = out.drawn.order
    shown = np.ix_(order, order)
    shades = np.empty((len(log.age), len(order), len(order)), dtype=np.uint8)
    for k, age in enumerate(log.age):  # one by one: copies of all would take most of the memory
        shades[k] = np.rint(OLDEST * np.minimum(age[shown] / full_scale, 1.0))
    if out.is_first:
        _draw_scale(out)
    if len(shades) == 0:  # a large team's matrix is kept every few pieces only
        return
    columns = rr.SegmentationImage.columns(buffer=shades.reshape(len(shades), -1))
    out.timed(layers.AGES, columns, log.age_window)


def _draw_scale(out: RerunLog) -> None:
    """Say what the matrix's shades mean: a class for each of 256 takes a while to make."""
    full_scale = out.log.facts.full_scale
    order = out.drawn.order
    ages = np.linspace(0.0, full_scale, OLDEST + 1)
    names = [f"{age:.0f} windows" for age in ages[:-1]] + [f"{full_scale:g} windows or more"]
    colours = palette.age_colours(ages, full_scale).tolist()
    shape = (len(order), len(order))
    for still in _classes(shape, names, colours, TREE_SIZE):
        out.fixed(layers.AGES, still)


def draw_states(out: RerunLog) -> None:
    """Mark each window in the picture of the radios' states, and keep these for it."""
    log = out.log
    state = radio_states(log)
    names = list(_state_colours(log))
    out.drawn.states.append(np.argmax([state == name for name in names], axis=0).astype(np.uint8))
    num_windows, num_robots = state.shape
    amid = log.window - 0.5
    top = np.stack([amid, np.zeros(num_windows)], axis=1)
    bottom = np.stack([amid, np.full(num_windows, float(num_robots))], axis=1)
    out.lines(layers.NOW, top, bottom, np.arange(num_windows))


def _state_colours(log: Log) -> dict[RadioState, Colour]:
    return palette.BROADCAST_STATES if log.facts.is_broadcast else palette.ADDRESSED_STATES


def draw_all_states(out: RerunLog) -> None:
    """Draw a row per robot: what it did with the radio in each window so far."""
    colours = _state_colours(out.log)
    shades = np.concatenate(out.drawn.states).T
    names = list(colours)
    for still in _classes(shades.shape, names, list(colours.values()), STATES_SIZE):
        out.fixed(layers.STATES, still)
    image = rr.SegmentationImage.from_fields(buffer=shades.tobytes())
    out.fixed(layers.STATES, image)
    num_robots, num_windows = shades.shape
    left = -BESIDE * num_windows
    above = -BESIDE * num_robots
    robots = range(0, num_robots, max(1, num_robots // NUM_NAMES))
    # rerun writes below a point.
    places = [(left, i + 0.5 + above) for i in robots]
    out.words(layers.STATE_ROBOTS, [f"r{i}" for i in robots], places)
    every = max(1, int(palette.nice_top(num_windows / NUM_TICKS)))
    ticks = range(every, num_windows + 1, every)
    places = [(window - 0.5, 2.0 * above) for window in ticks]
    out.words(layers.STATE_WINDOWS, [str(window) for window in ticks], places)


def _classes(
    shape: Sequence[int],
    names: Sequence[str],
    colours: Sequence[Sequence[int]],
    size: tuple[float, float],
) -> list[rr.AsComponents]:
    """Return what makes an image one of classes, names with colours, as large as its view."""
    # rerun's own views of tensors and of states write over them, and show short states as grey.
    classes = [(k, name, colours[k]) for k, name in enumerate(names)]
    height, width = shape
    x, y = size
    form = rr.components.ImageFormat(height=height, width=width, channel_datatype="U8")
    return [
        rr.AnnotationContext(classes),
        rr.SegmentationImage.from_fields(format=form, opacity=1.0),
        rr.Transform3D(mat3x3=np.diag([x / width, y / height, 1.0])),
    ]


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
