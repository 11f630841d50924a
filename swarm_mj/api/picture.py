"""A still map of one window, for a slide: robots by age, their trails, and packets on the way."""

import textwrap
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon, Rectangle

from swarm_mj.api.charts import kept
from swarm_mj.evaluation.figures.style import CAPTION, escape_mathtext, styled
from swarm_mj.physics import arenas, outlines, scene, state
from swarm_mj.radio.words import where_flown
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage, frame
from swarm_mj.system.packages import version

WIDTH_IN, HEIGHT_IN, DPI = 12.8, 7.2, 150  # 1920 by 1080 pixels
MAP_IN, LEFT_IN, BOTTOM_IN = 6.3, 0.85, 0.6  # the map's side, and where it stands
TEXT_IN, RAMP_IN = 7.75, 4.4  # where what is written begins, and how long the ramp of ages is
MARGIN = 1.04  # of the map, around what it must show
TRAIL_WINDOWS, PIECES = 300, 15  # of a trail, and how many shades it fades in
FAINTEST, BRIGHTEST = 0.08, 0.75  # of a trail's ends
SMALLEST_PT, LARGEST_PT, CROWD_PT = 6.5, 13.0, 75.0  # a robot's size: the last by the root of N
LARGE_PT, TEXT_PT, SMALL_PT = 22.0, 13.0, 10.5
LINE = 1.45  # of a line's height, by the size of its type
CHARACTERS = 52  # of a line
POINTS_PER_IN = 72.0


def draw_picture(footage: Footage, window: int | None = None) -> Figure:
    """Return a map of one window, 16 by 9, the last unless given; ValueError if there is none."""
    row = _row(footage, window)
    with styled():
        figure = plt.figure(figsize=(WIDTH_IN, HEIGHT_IN), dpi=DPI)
        figure.set_facecolor(_rgb(palette.BACKGROUND))
        sides = LEFT_IN / WIDTH_IN, BOTTOM_IN / HEIGHT_IN, MAP_IN / WIDTH_IN, MAP_IN / HEIGHT_IN
        axes = figure.add_axes(sides)
        radius_m = _frame(axes, footage, row)
        shown = _draw_ground(axes, footage)
        if np.ptp(_trails(footage, row), axis=0).max() > radius_m:  # or else robots hide them
            shown.append(_draw_trails(axes, footage, row))
        shown += _draw_robots(axes, footage, row)
        shown += _draw_packets(axes, footage, row, radius_m)
        below_in = _write(figure, footage, row)
        _draw_ramp(figure, footage, below_in)
        _draw_legend(figure, shown, below_in - 0.75)
    return kept(figure)


def _row(footage: Footage, window: int | None) -> int:
    windows = footage.window.tolist()
    if window is not None and window not in windows:
        raise ValueError(f"window must be from {windows[0]} to {windows[-1]}, not {window}")
    return len(windows) - 1 if window is None else windows.index(window)


def _rgb(colour: palette.Colour) -> str:
    return f"#{bytes(colour).hex()}"


def _size_pt(footage: Footage) -> float:
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
    (x, y), reach_m = ground.centre_m[0], MARGIN * ground.reach_m
    axes.set(xlim=(x - reach_m, x + reach_m), ylim=(y - reach_m, y + reach_m), aspect="equal")
    axes.set_facecolor(_rgb(palette.BACKGROUND))
    axes.grid(color=_rgb(palette.GRID), linewidth=0.8)
    faint, grey = _rgb(palette.WALL), _rgb(palette.SENT)
    axes.set_xlabel("x [m]", fontsize=TEXT_PT, color=grey)
    axes.set_ylabel("y [m]", fontsize=TEXT_PT, color=grey)
    axes.tick_params(colors=faint, labelcolor=grey, labelsize=SMALL_PT)
    axes.spines[:].set(visible=True, color=_rgb(palette.OUTLINE))
    return reach_m * _size_pt(footage) / (POINTS_PER_IN * MAP_IN)


def _draw_ground(axes: Axes, footage: Footage) -> list[Line2D]:
    """Draw area and obstacles; return samples for the legend."""
    mission = footage.facts.mission
    low_m, side_m = -mission.half_side_m, mission.side_m
    line: dict[str, Any] = {"linestyle": "-" if mission.has_walls else "--", "linewidth": 1.2}
    line["color"] = _rgb(palette.WALL)
    axes.add_patch(Rectangle((low_m, low_m), side_m, side_m, fill=False, zorder=1.0, **line))
    shown = [Line2D([], [], label="wall of the area" if mission.has_walls else "area", **line)]
    obstacles = arenas.obstacles_of(scene.compose(mission, scene=footage.scene).compile())
    if len(obstacles.kind) > 0:
        inside, edge = _rgb(palette.OUTLINE), _rgb(palette.WALL)
        for outline_m in outlines.footprints(obstacles, state.ROBOT_HEIGHT_M):
            block = Polygon(outline_m, facecolor=inside, edgecolor=edge, linewidth=0.8, zorder=1.5)
            axes.add_patch(block)
        shown.append(_dot("obstacle", palette.OUTLINE, "s", palette.WALL))
    return shown


def _draw_trails(axes: Axes, footage: Footage, row: int) -> Line2D:
    trails_m = _trails(footage, row)
    edges = np.linspace(0, len(trails_m) - 1, PIECES + 1).round().astype(int)
    colours = footage.colours[row] / 255.0
    for k, alpha in enumerate(np.linspace(FAINTEST, BRIGHTEST, PIECES)):
        piece_m = trails_m[edges[k] : edges[k + 1] + 1].swapaxes(0, 1)
        lines = LineCollection(list(piece_m), colors=colours, linewidth=1.6, zorder=2.0)
        lines.set_alpha(alpha)
        axes.add_collection(lines, autolim=False)
    label = f"trail of the last {(len(trails_m) - 1) * footage.facts.mission.window_s:g} s"
    return Line2D([], [], color=_rgb(palette.SENT), alpha=BRIGHTEST, linewidth=1.6, label=label)


def _draw_robots(axes: Axes, footage: Footage, row: int) -> list[Line2D]:
    """Draw the robots over all but packets; return samples of what the ramp does not show."""
    x, y = footage.position_m[row].T
    size = _size_pt(footage) ** 2
    off = footage.is_cut_off[row]
    if np.any(off):
        axes.scatter(x[off], y[off], s=3.2 * size, color=_rgb(palette.CUT_OFF), zorder=3.0)
    colours, edge = footage.colours[row] / 255.0, _rgb(palette.BACKGROUND)
    axes.scatter(x, y, s=size, c=colours, edgecolors=edge, linewidths=0.8, zorder=4.0)
    own, beside_pt = footage.ego, 0.7 * _size_pt(footage)
    look: dict[str, Any] = {"color": _rgb(palette.EGO), "fontsize": TEXT_PT, "fontweight": "bold"}
    place: dict[str, Any] = {"xytext": (beside_pt, beside_pt), "textcoords": "offset points"}
    axes.annotate(f"r{own}", (x[own], y[own]), zorder=6.0, **place, **look)
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
        way_m = palette.PACKETS[fate].share * (packets.end_m - packets.start_m)
        span_m = np.linalg.norm(way_m, axis=1, keepdims=True)
        far = span_m[:, 0] > 2.0 * radius_m
        if not np.any(far):
            continue
        # From rim to rim, so that no robot hides an arrow's head.
        rim_m = radius_m * way_m[far] / span_m[far]
        start_m, along_m = packets.start_m[far] + rim_m, way_m[far] - 2.0 * rim_m
        colour = _rgb(palette.PACKETS[fate].colour)
        how = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.0028, "headwidth": 4.5}
        x, y, along_x, along_y = np.hstack([start_m, along_m]).T
        axes.quiver(x, y, along_x, along_y, color=colour, zorder=5.0, alpha=0.9, **how)
        shown.append(
            Line2D([], [], color=colour, marker=">", markevery=[1], label=f"packet {fate}")
        )
    return shown


def _dot(
    label: str, colour: palette.Colour, marker: str = "o", edge: palette.Colour | None = None
) -> Line2D:
    dot = Line2D([], [], linestyle="", marker=marker, markersize=9.0, label=label)
    dot.set(markerfacecolor=_rgb(colour), markeredgecolor=_rgb(edge or colour))
    return dot


def _write(figure: Figure, footage: Footage, row: int) -> float:
    """Write title and time beside the map; return how high the last line stands [in]."""
    facts, mission = footage.facts, footage.facts.mission
    where = [*where_flown(mission), *facts.own_parts]
    about = f"{mission.task}, {mission.num_robots} robots, seed {facts.seed}"
    now = footage.window[row]
    lines = [(facts.policy or "a mission", LARGE_PT, palette.TEXT)]
    lines += [(each, TEXT_PT, palette.TEXT) for each in textwrap.wrap(about, CHARACTERS)]
    said = textwrap.wrap(", ".join(where), CHARACTERS, break_on_hyphens=False)
    lines += [(each, SMALL_PT, palette.SENT) for each in said]
    time = f"{now * mission.window_s:.1f} s, window {now} of {mission.num_windows}"
    lines.append((time, TEXT_PT, palette.TEXT))
    if np.isfinite(footage.age_mean[row]):
        age = f"mean age of information: {footage.age_mean[row]:.1f} windows"
        lines.append((age, TEXT_PT, palette.MEAN_AGE))
    y_in = HEIGHT_IN - 0.3
    for text, size, colour in lines:
        y_in -= LINE * size / POINTS_PER_IN
        x, y = TEXT_IN / WIDTH_IN, y_in / HEIGHT_IN
        figure.text(x, y, escape_mathtext(text), fontsize=size, color=_rgb(colour))
    x, y = TEXT_IN / WIDTH_IN, BOTTOM_IN / HEIGHT_IN
    figure.text(x, y, f"swarm_mj {version()}", fontsize=8.0, color=_rgb(palette.WALL), gid=CAPTION)
    return y_in


def _draw_ramp(figure: Figure, footage: Footage, below_in: float) -> None:
    full = footage.facts.full_scale
    place = TEXT_IN / WIDTH_IN, (below_in - 0.75) / HEIGHT_IN, RAMP_IN / WIDTH_IN, 0.2 / HEIGHT_IN
    axes = figure.add_axes(place)
    ages = np.linspace(0.0, full, 256)
    axes.imshow(palette.age_colours(ages, full)[None], aspect="auto", extent=(0.0, full, 0.0, 1.0))
    title = f"age of what r{footage.ego} knows of a robot [windows]"
    axes.set_title(title, fontsize=TEXT_PT, color=_rgb(palette.TEXT))
    axes.set_xticks([0.0, full / 2.0, full], ["0", f"{full / 2.0:g}", f"{full:g} or more"])
    axes.tick_params(colors=_rgb(palette.WALL), labelcolor=_rgb(palette.SENT), labelsize=SMALL_PT)
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)


def _draw_legend(figure: Figure, shown: list[Line2D], below_in: float) -> None:
    place = (TEXT_IN - 0.05) / WIDTH_IN, (below_in - 0.4) / HEIGHT_IN
    look: dict[str, Any] = {"frameon": False, "fontsize": TEXT_PT, "labelcolor": _rgb(palette.SENT)}
    room: dict[str, Any] = {"borderpad": 0.0, "borderaxespad": 0.0, "labelspacing": 0.6}
    figure.legend(handles=shown, loc="upper left", bbox_to_anchor=place, **look, **room)
