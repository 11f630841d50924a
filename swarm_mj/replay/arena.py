"""The replay's map: the area, the robots, what the ego robot believes, its tree, the radio."""

import numpy as np
import rerun as rr
from jaxtyping import Float

from swarm_mj.mission import Mission
from swarm_mj.replay import palette
from swarm_mj.replay.frame import Frame
from swarm_mj.replay.links import Links, ends, transmitters
from swarm_mj.replay.sheet import Sheet, screen

SQUARE_M = 100.0
MAX_SQUARES = 60  # across the ground; more would be too small to see
TRAIL_WINDOWS = 150
TRAIL_STRIDE = 15
HALO_POINTS = 9.0  # around a transmitter, on the screen
LOST_SHARE = 0.6  # a lost packet's arrow stops short of its receiver
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
    sheet.fixed(
        "arena/area/grid",
        rr.LineStrips2D(
            _grid(sheet.frame), colors=[palette.GRID], radii=screen(0.5), draw_order=-20
        ),
    )
    half = mission.half_side_m
    outline = [[(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]]
    name, colour = ("walls", palette.WALL) if mission.has_walls else ("outline", palette.OUTLINE)
    sheet.fixed(
        f"arena/area/{name}",
        rr.LineStrips2D(outline, colors=[colour], radii=screen(1.5), draw_order=-19),
    )


def square_m(frame: Frame) -> float:
    """The side of the grid's squares: 100 m, or a power of ten more for a large ground."""
    across_m = 2.0 * frame.reach_m + float(np.max(np.ptp(frame.centre_m, axis=0)))
    return SQUARE_M * 10.0 ** max(0, int(np.ceil(np.log10(across_m / SQUARE_M / MAX_SQUARES))))


def draw_robots(sheet: Sheet, full_scale: float) -> None:
    """Robots in the colour of the age of what the ego robot knows, or off; headings and trails."""
    log = sheet.log
    num_windows, num_robots = log.parent.shape
    per_window = [num_robots] * num_windows
    colours = palette.age_colours(log.ego_age, full_scale, log.is_known)
    colours[:, log.ego] = palette.EGO
    colours[~log.is_on] = palette.SWITCHED_OFF
    names = [f"r{i}" for i in range(num_robots)]
    sheet.layer(
        "arena/robots",
        rr.Points2D,
        {"radii": screen(5.5), "labels": names, "show_labels": False, "draw_order": 30.0},
        per_window,
        positions=log.position_m.reshape(-1, 2),
        colors=colours.reshape(-1, 3),
    )
    if log.has_motion:
        _draw_headings(sheet)
        _draw_trails(sheet)
    _draw_ego(sheet)


def draw_beliefs(sheet: Sheet) -> None:
    """A ring where the ego robot believes each robot to be, and a line from there to the truth."""
    log = sheet.log
    shown = log.is_known & (np.arange(log.parent.shape[1]) != log.ego)
    believed, truth = log.believed_m[shown], log.position_m[shown]
    per_window = np.sum(shown, axis=1)
    look = (palette.dim(palette.BELIEF, 0.8), 0.6, 3.0)
    sheet.lines("arena/belief/error", (believed, truth), per_window, look)
    radius_m = RING_SHARE * sheet.frame.reach_m
    style = {"colors": [palette.BELIEF], "line_radii": screen(0.8), "draw_order": 4.0}
    _draw_rings(sheet, "arena/belief/ring", believed, radius_m, per_window, style)


def draw_tree_on_map(sheet: Sheet) -> None:
    """The ego robot's parent tree between the robots' true positions."""
    log = sheet.log
    row, child = np.nonzero(log.is_known & (np.arange(log.parent.shape[1]) != log.ego))
    links = Links(
        num_windows=len(log.window), row=row, sender=log.parent[row, child], receiver=child
    )
    sheet.lines("arena/tree", ends(log, links), links.per_window, (palette.TREE, 0.8, 6.0))


def draw_radio(sheet: Sheet, packets: dict[str, Links], range_m: float) -> None:
    """Ranges of those who transmit, and their packets: to hearers, or by fate to addressees."""
    _draw_ranges(sheet, range_m)
    if sheet.log.is_broadcast:
        _draw_broadcasts(sheet, packets["heard"])
    else:
        _draw_requests(sheet, packets)
        _draw_responses(sheet, packets)
        look = (palette.dim(palette.OVERHEARD, 0.6), 0.7, 10.0)
        _draw_lines(sheet, "overheard", packets["overheard"], look)


def _grid(frame: Frame) -> list[list[tuple[float, float]]]:
    """Lines at whole squares, over all the ground that the map ever shows."""
    square = square_m(frame)
    x_low, y_low = np.floor((np.min(frame.centre_m, axis=0) - frame.reach_m) / square)
    x_high, y_high = np.ceil((np.max(frame.centre_m, axis=0) + frame.reach_m) / square)
    xs, ys = np.arange(x_low, x_high + 1) * square, np.arange(y_low, y_high + 1) * square
    return [[(x, ys[0]), (x, ys[-1])] for x in xs] + [[(xs[0], y), (xs[-1], y)] for y in ys]


def _draw_headings(sheet: Sheet) -> None:
    """A line into the direction of flight; all have one length, for agreement is in directions."""
    log = sheet.log
    velocity = log.velocity_mps.reshape(-1, 2)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    way = HEADING_SHARE * sheet.frame.reach_m * velocity / np.maximum(speed, 1e-9)
    where = log.position_m.reshape(-1, 2)
    per_window = [log.position_m.shape[1]] * len(log.window)
    look = (palette.HEADING, 0.8, 29.0)
    sheet.lines("arena/heading", (where, where + way), per_window, look)


def _draw_trails(sheet: Sheet) -> None:
    log = sheet.log
    rows = np.arange(len(log.window))
    past = range(0, TRAIL_WINDOWS + 1, TRAIL_STRIDE)
    trail = np.stack([log.position_m[np.maximum(0, rows - ago)] for ago in past], axis=2)
    per_window = [log.position_m.shape[1]] * len(rows)
    style = {"colors": [palette.TRAIL], "radii": screen(1.0), "draw_order": -5.0}
    strips = trail.reshape(-1, len(past), 2)
    sheet.layer("arena/trail", rr.LineStrips2D, style, per_window, strips=strips)


def _draw_ego(sheet: Sheet) -> None:
    """A ring around the ego robot, and its name: a point's label, for an ellipse's is misplaced."""
    log = sheet.log
    radius_m = 2.0 * RING_SHARE * sheet.frame.reach_m
    where = log.position_m[:, log.ego]
    ring = {"colors": [palette.EGO], "line_radii": screen(1.2), "draw_order": 31.0}
    size = {"half_sizes": [(radius_m, radius_m)]}
    sheet.layer("arena/ego", rr.Ellipses2D, ring | size, centers=where)
    name = {"radii": screen(0.1), "colors": [palette.EGO], "labels": [f"r{log.ego}"]}
    below = where - (0.0, 3.0 * radius_m)
    sheet.layer("arena/ego/name", rr.Points2D, name | {"show_labels": True}, positions=below)


def _draw_ranges(sheet: Sheet, range_m: float) -> None:
    """Circles of the range in silence around those who transmit first."""
    row, sender = np.nonzero(transmitters(sheet.log))
    centres = sheet.log.position_m[row, sender]
    per_window = np.bincount(row, minlength=len(sheet.log.window))
    style = {"colors": [palette.RANGE], "line_radii": screen(0.6), "draw_order": 1.0}
    _draw_rings(sheet, "arena/radio/range", centres, range_m, per_window, style)


def _draw_rings(
    sheet: Sheet,
    path: str,
    centre: Float[np.ndarray, "L 2"],
    radius_m: float,
    per_window: np.ndarray,
    style: dict[str, object],
) -> None:
    half_sizes = np.full(centre.shape, radius_m)
    sheet.layer(path, rr.Ellipses2D, style, per_window, centers=centre, half_sizes=half_sizes)


def _draw_broadcasts(sheet: Sheet, heard: Links) -> None:
    """A halo around whoever transmits, and lines from there to all who decode it."""
    row, sender = np.nonzero(transmitters(sheet.log))
    where = sheet.log.position_m[row, sender]
    per_window = np.bincount(row, minlength=len(sheet.log.window))
    style = {"colors": [palette.BROADCAST], "radii": screen(HALO_POINTS), "draw_order": 25.0}
    sheet.layer("arena/radio/transmitter", rr.Points2D, style, per_window, positions=where)
    _draw_lines(sheet, "heard", heard, (palette.BROADCAST, 1.0, 18.0))


def _draw_requests(sheet: Sheet, packets: dict[str, Links]) -> None:
    delivered, lost = packets["delivered"], packets["lost"]
    sheet.arrows("arena/radio/delivered", delivered, look=(palette.DELIVERED, 2.0, 20.0))
    sheet.arrows("arena/radio/lost", lost, look=(palette.LOST, 1.8, 19.0), share=LOST_SHARE)
    _draw_lines(sheet, "lost/rest", lost, (palette.dim(palette.LOST, 0.5), 0.7, 18.0))


def _draw_responses(sheet: Sheet, packets: dict[str, Links]) -> None:
    """Beside the requests that they answer."""
    aside_m = 0.8 * RING_SHARE * sheet.frame.reach_m
    sheet.arrows(
        "arena/radio/answered",
        packets["answered"],
        look=(palette.ANSWERED, 1.5, 21.0),
        aside_m=aside_m,
    )
    sheet.arrows(
        "arena/radio/unanswered",
        packets["unanswered"],
        look=(palette.dim(palette.ANSWERED, 0.6), 1.2, 18.0),
        share=LOST_SHARE,
        aside_m=aside_m,
    )


def _draw_lines(
    sheet: Sheet, name: str, links: Links, look: tuple[palette.Colour, float, float]
) -> None:
    sheet.lines(f"arena/radio/{name}", ends(sheet.log, links), links.per_window, look)
