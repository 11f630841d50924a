"""The replay's map: the area and obstacles, robots, the ego robot's beliefs and tree, the radio."""

import itertools
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float, UInt8
from scipy.spatial import ConvexHull

from swarm_mj.mission import Mission
from swarm_mj.physics.state import BOX, CAPSULE, CYLINDER, ROBOT_HEIGHT_M, Obstacles
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.mismatch import PIECES, LinkMismatch, mismatch_lines
from swarm_mj.replay.packets import PacketLinks, transmitters
from swarm_mj.replay.rerun_log import LAYERS, RerunLog

SQUARE_M = 100.0
MAX_SQUARES = 60  # across the ground; more would be too small to see
TRAIL_WINDOWS = 150
TRAIL_STRIDE = 15
TRAIL_EVERY = 5  # windows; in between, the last one is shown
HEADING_SHARE = 0.06  # a heading's length, of half the map's width
RING_SHARE = 0.014  # the radius of a ring around a believed position, likewise
FILL_SHARE = 0.008  # of half the map's width: between the lines that fill an obstacle
CORNERS = 24  # of a circle
LATITUDES = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)  # of a ball's circles
MIRROR = np.diag([1.0, -1.0, 1.0])  # rerun's 2D views have y down, the map has it up


def draw_map(
    out: RerunLog,
    mission: Mission,
    packets: dict[str, PacketLinks],
    colours: UInt8[np.ndarray, "T N 3"],
    obstacles: Obstacles,
) -> None:
    """Draw the map, with packets by their fate."""
    _draw_area(out, mission)
    _draw_obstacles(out, obstacles)
    if out.log.mismatch is not None:
        _draw_mismatch(out, out.log.mismatch)
    _draw_robots(out, colours)
    if out.log.has_motion:
        where = out.log.position_m.reshape(-1, 2)
        out.lines("arena/heading", where, where + heading_m(out).reshape(-1, 2))
        _draw_trails(out)
        _draw_beliefs(out)
    log, (row, child) = out.log, np.nonzero(out.log.has_parent)
    parent = log.parent[row, child]
    out.lines("arena/tree", log.position_m[row, parent], log.position_m[row, child], row)
    _draw_radio(out, packets, mission.range_m)


def square_m(frame: Ground) -> float:
    """Return the side of the grid's squares: 100 m, or a power of ten more for a large ground."""
    across_m = 2.0 * frame.reach_m + float(np.max(np.ptp(frame.centre_m, axis=0)))
    return SQUARE_M * 10.0 ** max(0, int(np.ceil(np.log10(across_m / SQUARE_M / MAX_SQUARES))))


def grid(frame: Ground) -> list[list[tuple[float, float]]]:
    """Return lines at whole squares, over all the ground that the map ever shows."""
    square = square_m(frame)
    x_low, y_low = np.floor((np.min(frame.centre_m, axis=0) - frame.reach_m) / square)
    x_high, y_high = np.ceil((np.max(frame.centre_m, axis=0) + frame.reach_m) / square)
    xs, ys = np.arange(x_low, x_high + 1) * square, np.arange(y_low, y_high + 1) * square
    return [[(x, ys[0]), (x, ys[-1])] for x in xs] + [[(xs[0], y), (xs[-1], y)] for y in ys]


def _draw_area(out: RerunLog, mission: Mission) -> None:
    """Draw the floor's grid and the area's outline, in metres with y up."""
    if out.frame.moves:
        away = np.pad(-out.frame.centre_m, ((0, 0), (0, 1))) @ MIRROR
        # rerun shows a timed transform whole or not at all, so the mirror is repeated.
        mirrors = np.tile(MIRROR, (len(away), 1, 1))
        out.timed("arena", rr.Transform3D.columns(translation=away, mat3x3=mirrors))
    else:
        out.fixed("arena", rr.Transform3D(mat3x3=MIRROR))
    out.fixed_layer("arena/area/grid", strips=grid(out.frame))
    half = mission.half_side_m
    outline = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
    name = "walls" if mission.has_walls else "outline"
    out.fixed_layer(f"arena/area/{name}", strips=[outline])


def _draw_robots(out: RerunLog, colours: UInt8[np.ndarray, "T N 3"]) -> None:
    """Draw robots in their colours, and a ring with a name around the ego robot."""
    log = out.log
    names = [f"r{i}" for i in range(log.parent.shape[1])]
    out.fixed("arena/robots", rr.Points2D.from_fields(labels=names, show_labels=False))
    where = log.position_m.reshape(-1, 2)
    out.layer("arena/robots", positions=where, colors=colours.reshape(-1, 3))
    row, where = np.arange(len(log.window)), log.position_m[:, log.ego]
    radius_m = 2.0 * RING_SHARE * out.frame.reach_m
    out.rings("arena/ego", where, radius_m, row)
    # The name is a point's label, for rerun misplaces an ellipse's.
    name = rr.Points2D.from_fields(labels=[f"r{log.ego}"], show_labels=True)
    out.fixed("arena/ego/name", name)
    out.layer("arena/ego/name", row, positions=where - (0.0, 3.0 * radius_m))


def heading_m(out: RerunLog) -> np.ndarray:
    """Return the robots' headings, all of one length, for agreement is in directions [m]."""
    speed = np.linalg.norm(out.log.velocity_mps, axis=2, keepdims=True)
    return HEADING_SHARE * out.frame.reach_m * out.log.velocity_mps / np.maximum(speed, 1e-9)


def _draw_trails(out: RerunLog) -> None:
    """Draw where robots were, anew every few windows only: trails would be half the file."""
    log = out.log
    rows = np.arange(0, len(log.window), TRAIL_EVERY)
    past = range(0, TRAIL_WINDOWS + 1, TRAIL_STRIDE)
    trail = np.stack([log.position_m[np.maximum(0, rows - ago)] for ago in past], axis=2)
    out.fixed_layer("arena/trail")
    columns = rr.LineStrips2D.columns(strips=trail.reshape(-1, len(past), 2))
    out.timed("arena/trail", columns.partition([trail.shape[1]] * len(rows)), log.window[rows])


def _draw_beliefs(out: RerunLog) -> None:
    """Draw a ring where the ego robot believes each robot to be, and a line to the truth."""
    log, (row, other) = out.log, np.nonzero(out.log.is_other_known)
    believed = log.believed_m[row, other]
    out.lines("arena/belief/error", believed, log.position_m[row, other], row)
    out.rings("arena/belief/ring", believed, RING_SHARE * out.frame.reach_m, row)


def _draw_radio(out: RerunLog, packets: dict[str, PacketLinks], range_m: float) -> None:
    """Draw who transmits first, the range in silence around them, and packets by their fate."""
    log = out.log
    row, sender = np.nonzero(transmitters(log.recipient, is_broadcast=log.is_broadcast))
    where = log.position_m[row, sender]
    out.rings("arena/radio/range", where, range_m, row)
    if log.is_broadcast:
        out.layer("arena/radio/transmitter", row, positions=where)
    else:
        lost = packets["lost"]
        out.lines("arena/radio/lost/rest", *lost.ends(log.position_m), lost.row)
    aside_m = 0.8 * RING_SHARE * out.frame.reach_m  # an answer stands beside its request
    aside = {"delivered": 0.0, "lost": 0.0, "answered": aside_m, "unanswered": aside_m}
    for fate, links in packets.items():
        if fate in aside:
            _draw_arrows(out, fate, links, aside[fate])
        else:
            out.lines(f"arena/radio/{fate}", *links.ends(log.position_m), links.row)


def _draw_arrows(out: RerunLog, fate: str, links: PacketLinks, aside_m: float) -> None:
    """Draw packets as arrows, this far to the left of the line to the receiver [m]."""
    start, end = links.ends(out.log.position_m)
    way = end - start
    length = np.linalg.norm(way, axis=1, keepdims=True)
    left = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.maximum(length, 1e-6)
    origins, vectors = start + aside_m * left, palette.PACKETS[fate][1] * way
    out.layer(f"arena/radio/{fate}", links.row, origins=origins, vectors=vectors)


def _draw_obstacles(out: RerunLog, obstacles: Obstacles) -> None:
    """Draw on the map where obstacles are in the way of the antennas."""
    if not (outlines := footprints(obstacles, ROBOT_HEIGHT_M)):
        return
    path, apart_m = "arena/world/filling", FILL_SHARE * out.frame.reach_m
    lines = [line for outline in outlines for line in filling(outline, apart_m)]
    # The width is in metres, since rerun fills no areas.
    style: dict[str, Any] = LAYERS[path].style | {"radii": 0.55 * apart_m}
    out.fixed(path, rr.LineStrips2D.from_fields(strips=lines, **style))
    out.fixed_layer("arena/world/obstacle", strips=outlines)


def _draw_mismatch(out: RerunLog, mismatch: LinkMismatch) -> None:
    """Draw links on which channel and belief differ, and who is cut off from the ego robot."""
    log = out.log
    position_m = log.position_m[mismatch.window - log.window[0]]
    for kind, links in mismatch.by_kind.items():
        lines_m, link = mismatch_lines(links, position_m, PIECES[kind])
        out.mismatch_lines(f"arena/world/{kind}", kind, links.chosen(link), lines_m)
    row, robot = np.nonzero(log.is_cut_off)
    out.layer("arena/world/cut_off", row, positions=log.position_m[row, robot])


def footprints(obstacles: Obstacles, height_m: float) -> list[Float[np.ndarray, "K 2"]]:
    """Return the outline of each obstacle that reaches this height, once round [m]."""
    outlines = []
    for kind, centre_m, rotation, size_m in zip(*obstacles[:4], strict=True):
        points_m = _surface(int(kind), size_m) @ rotation.T + centre_m
        # The outline is the hull of where lines from the points above to those below pass.
        is_above = points_m[:, 2] > height_m
        above, below = points_m[is_above][:, None], points_m[~is_above][None]
        share = (above[..., 2:] - height_m) / (above[..., 2:] - below[..., 2:])
        cut = (above + share * (below - above))[..., :2].reshape(-1, 2)
        if len(cut) > 2:
            corners = cut[ConvexHull(cut).vertices]
            outlines.append(np.concatenate([corners, corners[:1]]))
    return outlines


def filling(
    outline_m: Float[np.ndarray, "K 2"], apart_m: float
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Return lines from west to east, so far apart, that fill an outline [m]."""
    y_low, y_high = np.min(outline_m[:, 1]), np.max(outline_m[:, 1])
    num = max(1, int(np.ceil((y_high - y_low) / apart_m)))
    lines = []
    for y in y_low + (np.arange(num) + 0.5) * (y_high - y_low) / num:
        xs = [
            a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
            for a, b in itertools.pairwise(outline_m.tolist())
            if min(a[1], b[1]) <= y < max(a[1], b[1])
        ]
        lines.append(((min(xs), y), (max(xs), y)))
    return lines


def _surface(kind: int, size_m: Float[np.ndarray, "3"]) -> Float[np.ndarray, "K 3"]:
    """Return points whose convex hull is the obstacle, in its own frame [m]."""
    if kind == BOX:
        return size_m * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    angle = np.linspace(0.0, 2.0 * np.pi, CORNERS, endpoint=False)
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(CORNERS)], axis=1)
    ball = np.concatenate([np.cos(at) * circle + (0.0, 0.0, np.sin(at)) for at in LATITUDES])
    if kind in (CYLINDER, CAPSULE):
        half = np.array([0.0, 0.0, size_m[1]])
        disc = size_m[0] * (circle if kind == CYLINDER else ball)
        return np.concatenate([disc - half, disc + half])
    return ball * (size_m if np.all(size_m > 0.0) else size_m[0])
