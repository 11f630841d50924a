"""The replay's map: the area, the robots, what the ego robot believes, its tree, the radio."""

import numpy as np
import rerun as rr
from jaxtyping import UInt8

from swarm_mj.mission import Mission
from swarm_mj.replay import palette
from swarm_mj.replay.frame import Frame
from swarm_mj.replay.links import Links, ends, transmitters
from swarm_mj.replay.sheet import Sheet
from swarm_mj.replay.shots import LOST_SHARE

SQUARE_M = 100.0
MAX_SQUARES = 60  # across the ground; more would be too small to see
TRAIL_WINDOWS = 150
TRAIL_STRIDE = 15
TRAIL_EVERY = 5  # windows; in between, the last one is shown
HEADING_SHARE = 0.06  # a heading's length, of half the map's width
RING_SHARE = 0.014  # the radius of a ring around a believed position, likewise
MIRROR = np.diag([1.0, -1.0, 1.0])  # rerun's 2D views have y down, the map has it up


def draw_area(sheet: Sheet, mission: Mission) -> None:
    """Floor grid and the area's outline, in metres with y up."""
    if sheet.frame.moves:
        away = np.pad(-sheet.frame.centre_m, ((0, 0), (0, 1))) @ MIRROR
        mirrors = np.tile(MIRROR, (len(away), 1, 1))
        sheet.timed("arena", rr.Transform3D.columns(translation=away, mat3x3=mirrors))
    else:
        sheet.fixed("arena", rr.Transform3D(mat3x3=MIRROR))
    sheet.fixed_layer("arena/area/grid", strips=grid(sheet.frame))
    half = mission.half_side_m
    outline = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
    name = "walls" if mission.has_walls else "outline"
    sheet.fixed_layer(f"arena/area/{name}", strips=[outline])


def square_m(frame: Frame) -> float:
    """Return the side of the grid's squares: 100 m, or a power of ten more for a large ground."""
    across_m = 2.0 * frame.reach_m + float(np.max(np.ptp(frame.centre_m, axis=0)))
    return SQUARE_M * 10.0 ** max(0, int(np.ceil(np.log10(across_m / SQUARE_M / MAX_SQUARES))))


def grid(frame: Frame) -> list[list[tuple[float, float]]]:
    """Lines at whole squares, over all the ground that the map ever shows."""
    square = square_m(frame)
    x_low, y_low = np.floor((np.min(frame.centre_m, axis=0) - frame.reach_m) / square)
    x_high, y_high = np.ceil((np.max(frame.centre_m, axis=0) + frame.reach_m) / square)
    xs, ys = np.arange(x_low, x_high + 1) * square, np.arange(y_low, y_high + 1) * square
    return [[(x, ys[0]), (x, ys[-1])] for x in xs] + [[(xs[0], y), (xs[-1], y)] for y in ys]


def draw_robots(sheet: Sheet, colours: UInt8[np.ndarray, "T N 3"]) -> None:
    """Robots in their colours, or off; the ego robot's ring; headings and trails."""
    log = sheet.log
    shown = palette.with_switched_off(colours, log.is_on)
    names = [f"r{i}" for i in range(log.parent.shape[1])]
    sheet.fixed("arena/robots", rr.Points2D.from_fields(labels=names, show_labels=False))
    where = log.position_m.reshape(-1, 2)
    sheet.layer("arena/robots", positions=where, colors=shown.reshape(-1, 3))
    if log.has_motion:
        _draw_headings(sheet)
        _draw_trails(sheet)
    _draw_ego(sheet)


def draw_beliefs(sheet: Sheet) -> None:
    """A ring where the ego robot believes each robot to be, and a line from there to the truth."""
    log = sheet.log
    row, other = np.nonzero(log.is_other_known)
    believed = log.believed_m[row, other]
    sheet.lines("arena/belief/error", believed, log.position_m[row, other], row)
    sheet.rings("arena/belief/ring", believed, RING_SHARE * sheet.frame.reach_m, row)


def draw_tree_on_map(sheet: Sheet) -> None:
    """Return the ego robot's parent tree between the robots' true positions."""
    log = sheet.log
    row, child = np.nonzero(log.has_parent)
    parent = log.parent[row, child]
    sheet.lines("arena/tree", log.position_m[row, parent], log.position_m[row, child], row)


def draw_radio(sheet: Sheet, packets: dict[str, Links], range_m: float) -> None:
    """Who transmits first, the range in silence around them, and all packets by their fate."""
    log = sheet.log
    row, sender = np.nonzero(transmitters(log))
    where = log.position_m[row, sender]
    sheet.rings("arena/radio/range", where, range_m, row)
    if log.is_broadcast:
        sheet.layer("arena/radio/transmitter", row, positions=where)
    else:
        lost = packets["lost"]
        sheet.lines("arena/radio/lost/rest", *ends(log, lost), lost.row)
    aside_m = 0.8 * RING_SHARE * sheet.frame.reach_m  # an answer stands beside its request
    arrows = {
        "delivered": (1.0, 0.0),
        "lost": (LOST_SHARE, 0.0),
        "answered": (1.0, aside_m),
        "unanswered": (LOST_SHARE, aside_m),
    }
    for fate, links in packets.items():
        if fate in arrows:
            _draw_arrows(sheet, fate, links, *arrows[fate])
        else:
            sheet.lines(f"arena/radio/{fate}", *ends(log, links), links.row)


def _draw_arrows(sheet: Sheet, fate: str, links: Links, share: float, aside_m: float) -> None:
    """Packets as arrows: this share of the way to the receiver, this far to the left of it [m]."""
    start, end = ends(sheet.log, links)
    way = end - start
    length = np.linalg.norm(way, axis=1, keepdims=True)
    left = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.maximum(length, 1e-6)
    origins, vectors = start + aside_m * left, share * way
    sheet.layer(f"arena/radio/{fate}", links.row, origins=origins, vectors=vectors)


def _draw_headings(sheet: Sheet) -> None:
    """A line into the direction of flight; all have one length, for agreement is in directions."""
    velocity = sheet.log.velocity_mps.reshape(-1, 2)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    way = HEADING_SHARE * sheet.frame.reach_m * velocity / np.maximum(speed, 1e-9)
    where = sheet.log.position_m.reshape(-1, 2)
    sheet.lines("arena/heading", where, where + way)


def _draw_trails(sheet: Sheet) -> None:
    """Where robots were; drawn anew every few windows only, for trails would be half the file."""
    log = sheet.log
    rows = np.arange(0, len(log.window), TRAIL_EVERY)
    past = range(0, TRAIL_WINDOWS + 1, TRAIL_STRIDE)
    trail = np.stack([log.position_m[np.maximum(0, rows - ago)] for ago in past], axis=2)
    sheet.fixed_layer("arena/trail")
    columns = rr.LineStrips2D.columns(strips=trail.reshape(-1, len(past), 2))
    sheet.timed("arena/trail", columns.partition([trail.shape[1]] * len(rows)), log.window[rows])


def _draw_ego(sheet: Sheet) -> None:
    """A ring around the ego robot, and its name: a point's label, for an ellipse's is misplaced."""
    log = sheet.log
    radius_m = 2.0 * RING_SHARE * sheet.frame.reach_m
    where = log.position_m[:, log.ego]
    sheet.rings("arena/ego", where, radius_m)
    name = rr.Points2D.from_fields(labels=[f"r{log.ego}"], show_labels=True)
    sheet.fixed("arena/ego/name", name)
    sheet.layer("arena/ego/name", positions=where - (0.0, 3.0 * radius_m))
