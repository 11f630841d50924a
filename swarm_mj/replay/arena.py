"""The replay's map: the area, the robots, what the observer believes, its tree, the radio."""

import numpy as np
import rerun as rr

from swarm_mj.mission import Mission
from swarm_mj.replay import palette
from swarm_mj.replay.links import Links, ends
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.sheet import Sheet, screen

GRID_M = 100.0
TRAIL_WINDOWS = 40
TRAIL_STRIDE = 5
HEADING_S = 10.0  # a velocity is drawn as the way it covers in this time
LOST_SHARE = 0.6  # a lost packet's arrow stops short of its receiver


def draw_area(sheet: Sheet, mission: Mission) -> None:
    """Floor grid and walls, in metres with y up: rerun's 2D views have y down."""
    sheet.fixed("arena", rr.Transform3D(mat3x3=[[1, 0, 0], [0, -1, 0], [0, 0, 1]]))
    half = mission.half_side_m
    ticks = np.arange(-np.floor(half / GRID_M), np.floor(half / GRID_M) + 1) * GRID_M
    grid = [[(x, -half), (x, half)] for x in ticks] + [[(-half, y), (half, y)] for y in ticks]
    sheet.fixed(
        "arena/area/grid",
        rr.LineStrips2D(grid, colors=[palette.GRID], radii=screen(0.5), draw_order=-20),
    )
    walls = [[(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]]
    if mission.has_walls:
        sheet.fixed(
            "arena/area/walls",
            rr.LineStrips2D(walls, colors=[palette.WALL], radii=screen(1.5), draw_order=-19),
        )


def draw_robots(sheet: Sheet, full_scale: float) -> None:
    """Robots in the colour of the age of what the observer knows, or off; headings and trails."""
    log = sheet.log
    num_windows, num_robots = log.parent.shape
    per_window = [num_robots] * num_windows
    where = log.position_m.reshape(-1, 2)
    colours = palette.age_colours(log.observer_age, full_scale, log.is_known)
    colours[:, log.observer] = palette.OBSERVER
    colours[~log.is_on] = palette.SWITCHED_OFF
    names = [f"r{i}" for i in range(num_robots)]
    sheet.fixed(
        "arena/robots",
        rr.Points2D.from_fields(
            radii=screen(5.5), labels=names, show_labels=False, draw_order=30.0
        ),
    )
    sheet.points("arena/robots", where, colours.reshape(-1, 3), per_window)
    if np.any(log.velocity_mps):
        sheet.line_style("arena/heading", palette.HEADING, 0.8, 29.0)
        ahead = where + HEADING_S * log.velocity_mps.reshape(-1, 2)
        sheet.lines("arena/heading", where, ahead, per_window)
        _draw_trails(sheet)
    _draw_observer(sheet)


def draw_beliefs(sheet: Sheet) -> None:
    """A ring where the observer believes each robot to be, and a line from there to the truth."""
    log = sheet.log
    shown = log.is_known & (np.arange(log.parent.shape[1]) != log.observer)
    believed, truth = log.believed_m[shown], log.position_m[shown]
    per_window = np.sum(shown, axis=1)
    sheet.line_style("arena/belief/error", palette.dim(palette.BELIEF, 0.8), 0.6, 3.0)
    sheet.lines("arena/belief/error", believed, truth, per_window)
    sheet.fixed(
        "arena/belief/ring",
        rr.Ellipses2D.from_fields(colors=[palette.BELIEF], line_radii=screen(0.8), draw_order=4.0),
    )
    rings = rr.Ellipses2D.columns(
        centers=believed, half_sizes=np.full((len(believed), 2), ring_radius_m(log))
    )
    sheet.timed("arena/belief/ring", rings.partition(per_window))


def draw_tree_on_map(sheet: Sheet) -> None:
    """The observer's parent tree between the robots' true positions."""
    log = sheet.log
    row, child = np.nonzero(log.is_known & (np.arange(log.parent.shape[1]) != log.observer))
    links = Links(
        num_windows=len(log.window), row=row, sender=log.parent[row, child], receiver=child
    )
    sheet.line_style("arena/tree", palette.dim(palette.TREE, 0.75), 0.8, 6.0)
    sheet.lines("arena/tree", *ends(log, links), links.per_window)


def draw_radio(sheet: Sheet, packets: dict[str, Links], range_m: float) -> None:
    """Packets by fate: colour and shape say which; a transmitter's range is a faint circle."""
    sheet.arrows(
        "arena/radio/delivered",
        packets["delivered"],
        colour=palette.DELIVERED,
        width=2.0,
        order=20.0,
    )
    lost, unanswered = packets["lost"], packets["unanswered"]
    sheet.arrows(
        "arena/radio/lost", lost, colour=palette.LOST, width=1.8, order=19.0, share=LOST_SHARE
    )
    sheet.line_style("arena/radio/lost/rest", palette.dim(palette.LOST, 0.5), 0.7, 18.0)
    sheet.lines("arena/radio/lost/rest", *ends(sheet.log, lost), lost.per_window)
    aside_m = 0.8 * ring_radius_m(sheet.log)
    sheet.arrows(
        "arena/radio/answered",
        packets["answered"],
        colour=palette.ANSWERED,
        width=1.5,
        order=21.0,
        aside_m=aside_m,
    )
    sheet.arrows(
        "arena/radio/unanswered",
        unanswered,
        colour=palette.dim(palette.ANSWERED, 0.6),
        width=1.2,
        order=18.0,
        share=LOST_SHARE,
        aside_m=aside_m,
    )
    overheard = packets["overheard"]
    sheet.line_style("arena/radio/overheard", palette.dim(palette.OVERHEARD, 0.6), 0.7, 10.0)
    sheet.lines("arena/radio/overheard", *ends(sheet.log, overheard), overheard.per_window)
    _draw_ranges(sheet, packets, range_m)


def ring_radius_m(log: Log) -> float:
    """Radius of a belief's ring: seven thousandths of the span that the robots cover [m]."""
    return 0.007 * float(np.ptp(log.position_m))


def _draw_trails(sheet: Sheet) -> None:
    log = sheet.log
    rows = np.arange(len(log.window))
    past = range(0, TRAIL_WINDOWS + 1, TRAIL_STRIDE)
    trail = np.stack([log.position_m[np.maximum(0, rows - ago)] for ago in past], axis=2)
    strips = trail.reshape(-1, len(past), 2)
    sheet.line_style("arena/trail", palette.TRAIL, 1.0, -5.0)
    per_window = [log.position_m.shape[1]] * len(rows)
    sheet.timed("arena/trail", rr.LineStrips2D.columns(strips=strips).partition(per_window))


def _draw_observer(sheet: Sheet) -> None:
    """A ring around the observer, and its name: a point's label, for an ellipse's is misplaced."""
    log = sheet.log
    radius_m = 2.0 * ring_radius_m(log)
    where = log.position_m[:, log.observer]
    sheet.fixed(
        "arena/observer",
        rr.Ellipses2D.from_fields(
            half_sizes=[(radius_m, radius_m)],
            colors=[palette.OBSERVER],
            line_radii=screen(1.2),
            draw_order=31.0,
        ),
    )
    sheet.timed("arena/observer", rr.Ellipses2D.columns(centers=where))
    sheet.fixed(
        "arena/observer/name",
        rr.Points2D.from_fields(
            radii=screen(0.1),
            colors=[palette.OBSERVER],
            labels=[f"r{log.observer}"],
            show_labels=True,
        ),
    )
    below = where - (0.0, 3.0 * radius_m)
    sheet.timed("arena/observer/name", rr.Points2D.columns(positions=below))


def _draw_ranges(sheet: Sheet, packets: dict[str, Links], range_m: float) -> None:
    """Circles of the range in silence around those who transmit first."""
    both = [packets["delivered"], packets["lost"]]
    row = np.concatenate([links.row for links in both])
    sender = np.concatenate([links.sender for links in both])
    shades = [palette.dim(palette.DELIVERED, 0.3), palette.dim(palette.LOST, 0.3)]
    colour = np.repeat(np.array(shades, dtype=np.uint8), [len(links.row) for links in both], axis=0)
    order = np.argsort(row, kind="stable")
    centres = sheet.log.position_m[row[order], sender[order]]
    sheet.fixed(
        "arena/radio/range", rr.Ellipses2D.from_fields(line_radii=screen(0.6), draw_order=1.0)
    )
    circles = rr.Ellipses2D.columns(
        centers=centres, half_sizes=np.full((len(row), 2), range_m), colors=colour[order]
    )
    per_window = np.bincount(row, minlength=len(sheet.log.window))
    sheet.timed("arena/radio/range", circles.partition(per_window))
