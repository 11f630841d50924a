"""What a world beyond free space adds to a replay: obstacles, links that surprise, who is cut off.

The map and the view in 3-D draw the same things in the same colours.
"""

import numpy as np
import rerun as rr
from jaxtyping import Int

from swarm_mj.physics.obstacles import Obstacles
from swarm_mj.physics.state import ROBOT_HEIGHT_M
from swarm_mj.replay import palette
from swarm_mj.replay.footprints import filling, footprints
from swarm_mj.replay.layers import LAYERS, screen
from swarm_mj.replay.looks import Looks, Surprises
from swarm_mj.replay.sheet import Sheet
from swarm_mj.replay.space import RADIUS_SHARE, ROBOT_HEIGHT
from swarm_mj.replay.strokes import PIECES, WHOLE, shades, strokes

NUMBERS = ("sender", "receiver", "loss_db", "margin_db")  # of links, that the file keeps
FILL_SHARE = 0.008  # of half the map's width: between the lines that fill an obstacle
HALO, HALO_M = 1.7, 2.0  # of a robot that is cut off, by the robot's radius; its height [m]


def draw_obstacles(sheet: Sheet, obstacles: Obstacles) -> None:
    """Return the obstacles on the map."""
    outlines = footprints(obstacles, ROBOT_HEIGHT_M)
    if outlines:
        apart_m = FILL_SHARE * sheet.frame.reach_m
        lines = [line for outline in outlines for line in filling(outline, apart_m)]
        path = "arena/world/filling"
        filled = rr.LineStrips2D(
            lines,
            colors=[palette.OBSTACLE],
            radii=0.55 * apart_m,
            draw_order=LAYERS[path].order,
        )
        sheet.fixed(path, filled)
        sheet.fixed_layer("arena/world/obstacle", strips=outlines)


def draw_looks(sheet: Sheet, looks: Looks) -> None:
    """Links that surprise, and who is cut off from the ego robot."""
    radius_m = RADIUS_SHARE * sheet.frame.reach_m
    position_m = sheet.log.position_m[looks.window - sheet.log.window[0]]
    for kind, links in looks.surprises.by_kind.items():
        lines_m, link = strokes(links, position_m, PIECES[kind])
        on_map = f"arena/world/{kind}"
        sheet.fixed_layer(on_map)
        strips = rr.LineStrips2D.columns(strips=lines_m, colors=shades(kind, links)[link])
        _draw_links(sheet, on_map, strips, links.chosen(link), looks.window)
        # In space they are whole, whatever their kind: dashes would make the file larger.
        lines_m, _ = strokes(links, position_m, WHOLE)
        height_m = np.float32(ROBOT_HEIGHT * radius_m)
        lifted = np.pad(lines_m, ((0, 0), (0, 0), (0, 1)), constant_values=height_m)
        in_space = f"scene/world/{kind}"
        sheet.fixed(in_space, rr.LineStrips3D.from_fields(radii=screen(LAYERS[on_map].width)))
        strips = rr.LineStrips3D.columns(strips=lifted, colors=shades(kind, links))
        _draw_links(sheet, in_space, strips, links, looks.window)
    _draw_cut_off(sheet, HALO * radius_m)


def _draw_links(
    sheet: Sheet,
    path: str,
    strips: rr.ComponentColumnList,
    links: Surprises,
    window: Int[np.ndarray, "C"],
) -> None:
    """Return a strip for each of these links; who clicks on one reads its numbers."""
    numbers = {name: getattr(links, name) for name in NUMBERS}
    per_look = np.bincount(links.row, minlength=len(window))
    known = rr.AnyValues.columns(**numbers).partition(per_look)
    sheet.timed(path, [*strips.partition(per_look), *known], window)


def _draw_cut_off(sheet: Sheet, radius_m: float) -> None:
    """Return a halo around each robot that is cut off from the ego robot."""
    log = sheet.log
    row, robot = np.nonzero(log.is_cut_off)
    where_m = log.position_m[row, robot]
    sheet.layer("arena/world/cut_off", row, positions=where_m)
    path = "scene/world/cut_off"
    flat = np.pad(where_m.astype(np.float32), ((0, 0), (0, 1)))
    style = rr.Cylinders3D.from_fields(colors=[palette.CUT_OFF], fill_mode="solid")
    sheet.fixed(path, style)
    columns = rr.Cylinders3D.columns(
        centers=flat, radii=np.full(len(row), radius_m), lengths=np.full(len(row), HALO_M)
    )
    per_window = np.bincount(row, minlength=len(log.window))
    sheet.timed(path, columns.partition(per_window))
