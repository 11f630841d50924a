"""A still map of one window, for a slide: robots by age, their trails, and packets on the way."""

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle

from swarm_mj.api.picture_text import (
    BOTTOM_IN,
    HEIGHT_IN,
    POINTS_PER_IN,
    RAMP_ROOM_IN,
    SMALL_PT,
    TEXT_PT,
    WIDTH_IN,
    draw_legend,
    draw_ramp,
    rgb,
    share,
    write_text,
)
from swarm_mj.evaluation.figures.style import kept, styled
from swarm_mj.physics import outlines, scene, state
from swarm_mj.physics.obstacles import obstacles_of
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage, frame
from swarm_mj.replay.links import on_map

DPI = 150  # so that the picture has 1920 by 1080 pixels
# The map's side, and where it stands.
MAP_IN = 6.3
LEFT_IN = 0.85
MARGIN = 1.04  # of the map, around what it must show
# Trails, which fade towards their beginnings.
TRAIL_WINDOWS = 300
PIECES = 15  # in which they fade
FAINTEST = 0.08  # opacity of the first
BRIGHTEST = 0.75  # and of the last
# A robot's size: CROWD_PT over the root of N, within these limits.
SMALLEST_PT = 6.5
LARGEST_PT = 13.0
CROWD_PT = 75.0


def draw_picture(footage: Footage, window: int | None = None) -> Figure:
    """Return a map of one window, 16 by 9.

    Args:
        footage: A flight's log, or what `read_footage` read from its replay.
        window: The window's number, 1 for a mission's first; None is the last.

    Returns:
        The figure, 1920 by 1080 pixels unless it is saved otherwise.

    Raises:
        ValueError: There is no such window.
    """
    row = _row(footage, window)
    with styled():
        figure = plt.figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI)
        figure.set_facecolor(rgb(palette.BACKGROUND))
        axes = figure.add_axes(share(LEFT_IN, BOTTOM_IN, MAP_IN, MAP_IN))
        radius_m = _frame(axes, footage, row)
        shown = _draw_ground(axes, footage)
        longest_m = np.ptp(_trails(footage, row), axis=0).max()
        if longest_m > radius_m:  # or else robots hide them
            shown.append(_draw_trails(axes, footage, row))
        shown += _draw_robots(axes, footage, row)
        shown += _draw_packets(axes, footage, row, radius_m)
        below_in = write_text(figure, footage, row)
        draw_ramp(figure, footage, below_in)
        draw_legend(figure, shown, below_in - RAMP_ROOM_IN)
    return kept(figure)


def _row(footage: Footage, window: int | None) -> int:
    """Return a window's row in the footage, which may have begun later than the mission."""
    windows = footage.window.tolist()
    if window is not None and window not in windows:
        raise ValueError(f"window must be from {windows[0]} to {windows[-1]}, not {window}")
    return len(windows) - 1 if window is None else windows.index(window)


def _size_pt(footage: Footage) -> float:
    """Return a robot's diameter: the more robots, the smaller, so that few cover others."""
    size = CROWD_PT / np.sqrt(footage.facts.mission.num_robots)
    return float(np.clip(size, SMALLEST_PT, LARGEST_PT))


def _trails(footage: Footage, row: int) -> Float[np.ndarray, "P N 2"]:
    """Return where the robots were in the last windows, the oldest first; at rest in one [m]."""
    first = max(0, row - TRAIL_WINDOWS) if footage.has_motion else row
    return footage.position_m[first : row + 1]


def _frame(axes: Axes, footage: Footage, row: int) -> float:
    """Set the map's limits around area, robots and trails; return a robot's radius on it [m]."""
    trails_m = _trails(footage, row).reshape(1, -1, 2)
    ground = frame(trails_m, footage.facts.mission.half_side_m)
    x, y = ground.centre_m[0]
    reach_m = MARGIN * ground.reach_m
    axes.set(xlim=(x - reach_m, x + reach_m), ylim=(y - reach_m, y + reach_m), aspect="equal")
    axes.set_facecolor(rgb(palette.BACKGROUND))
    axes.grid(color=rgb(palette.GRID), linewidth=0.8)
    faint = rgb(palette.WALL)
    grey = rgb(palette.SENT)
    axes.set_xlabel("x [m]", fontsize=TEXT_PT, color=grey)
    axes.set_ylabel("y [m]", fontsize=TEXT_PT, color=grey)
    axes.tick_params(colors=faint, labelcolor=grey, labelsize=SMALL_PT)
    axes.spines[:].set(visible=True, color=rgb(palette.OUTLINE))
    return reach_m * _size_pt(footage) / (POINTS_PER_IN * MAP_IN)


def _draw_ground(axes: Axes, footage: Footage) -> list[Line2D]:
    """Draw area and obstacles; return samples for the legend."""
    mission = footage.facts.mission
    low_m = -mission.half_side_m
    side_m = mission.side_m
    colour = rgb(palette.WALL)
    dashes = "-" if mission.has_walls else "--"
    border = Rectangle((low_m, low_m), side_m, side_m, fill=False, zorder=1.0)
    border.set(linestyle=dashes, linewidth=1.2, edgecolor=colour)
    axes.add_patch(border)
    label = "wall of the area" if mission.has_walls else "area"
    shown = [Line2D([], [], linestyle=dashes, linewidth=1.2, color=colour, label=label)]
    obstacles = obstacles_of(scene.compose(mission, scene=footage.scene).compile())
    if len(obstacles.kind) > 0:
        for outline_m in outlines.footprints(obstacles, state.ROBOT_HEIGHT_M):
            block = Polygon(outline_m, linewidth=0.8, zorder=1.5)
            block.set(facecolor=rgb(palette.OUTLINE), edgecolor=colour)
            axes.add_patch(block)
        shown.append(_dot("obstacle", palette.OUTLINE, "s", palette.WALL))
    return shown


def _draw_trails(axes: Axes, footage: Footage, row: int) -> Line2D:
    """Draw where the robots came from, fading; return a sample for the legend."""
    trails_m = _trails(footage, row)
    edges = np.linspace(0, len(trails_m) - 1, PIECES + 1).round().astype(int)
    colours = footage.colours[row] / 255.0
    # A line has one opacity, so a trail that fades is drawn in pieces.
    for k, alpha in enumerate(np.linspace(FAINTEST, BRIGHTEST, PIECES)):
        # Each piece ends where the next begins, or there would be gaps; [N P 2], a line a robot.
        piece_m = trails_m[edges[k] : edges[k + 1] + 1].swapaxes(0, 1)
        lines = LineCollection(list(piece_m), colors=colours, linewidth=1.6, zorder=2.0)
        lines.set_alpha(alpha)
        axes.add_collection(lines, autolim=False)
    label = f"trail of the last {(len(trails_m) - 1) * footage.facts.mission.window_s:g} s"
    return Line2D([], [], color=rgb(palette.SENT), alpha=BRIGHTEST, linewidth=1.6, label=label)


def _draw_robots(axes: Axes, footage: Footage, row: int) -> list[Line2D]:
    """Draw the robots over all but packets; return samples of what the ramp does not show."""
    x, y = footage.position_m[row].T
    size = _size_pt(footage) ** 2  # matplotlib scatters by area
    off = footage.is_cut_off[row]
    if np.any(off):
        axes.scatter(x[off], y[off], s=3.2 * size, color=rgb(palette.CUT_OFF), zorder=3.0)
    colours = footage.colours[row] / 255.0
    edge = rgb(palette.BACKGROUND)
    axes.scatter(x, y, s=size, c=colours, edgecolors=edge, linewidths=0.8, zorder=4.0)
    own = footage.ego  # the robot whose knowledge the colours show
    beside_pt = 0.7 * _size_pt(footage)
    axes.annotate(
        f"r{own}",
        xy=(x[own], y[own]),
        xytext=(beside_pt, beside_pt),
        textcoords="offset points",
        color=rgb(palette.EGO),
        fontsize=TEXT_PT,
        fontweight="bold",
        zorder=6.0,
    )
    shown = [_dot(f"r{own}, whose knowledge is shown", palette.EGO)]
    if np.any(np.isnan(footage.known_age[row]) & footage.is_on[row]):
        shown.append(_dot("never heard of", palette.UNKNOWN))
    if not np.all(footage.is_on[row]):
        shown.append(_dot("failed", palette.SWITCHED_OFF))
    if np.any(off):
        shown.append(_dot(f"halo: cut off from r{own} now", palette.CUT_OFF))
    return shown


def _draw_packets(axes: Axes, footage: Footage, row: int, radius_m: float) -> list[Line2D]:
    """Draw an arrow for each packet that was on the way, a lost one half-way; return samples."""
    shown = []
    for fate, packets in footage.packets_at(row).items():
        way_m = palette.PACKETS[fate].share * on_map(packets.end_m - packets.start_m)
        span_m = np.linalg.norm(way_m, axis=1)
        far = span_m > 2.0 * radius_m
        if not np.any(far):
            continue
        # From rim to rim, so that no robot hides an arrow's head.
        rim_m = radius_m * way_m[far] / span_m[far, None]
        start_m = on_map(packets.start_m[far]) + rim_m
        along_m = way_m[far] - 2.0 * rim_m
        colour = rgb(palette.PACKETS[fate].colour)
        axes.quiver(
            *start_m.T,
            *along_m.T,
            angles="xy",
            scale_units="xy",
            scale=1.0,
            width=0.0028,
            headwidth=4.5,
            color=colour,
            alpha=0.9,
            zorder=5.0,
        )
        label = f"packet {fate}"
        shown.append(Line2D([], [], color=colour, marker=">", markevery=[1], label=label))
    return shown


def _dot(
    label: str, colour: palette.Colour, marker: str = "o", edge: palette.Colour | None = None
) -> Line2D:
    """Return a marker for the legend."""
    dot = Line2D([], [], linestyle="", marker=marker, markersize=9.0, label=label)
    dot.set(markerfacecolor=rgb(colour), markeredgecolor=rgb(edge or colour))
    return dot
