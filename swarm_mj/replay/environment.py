"""The additions beyond free space: obstacles, mismatched links, robots that are cut off.

The map and the view in 3-D draw the same things in the same colours.
"""

import itertools
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float
from scipy.spatial import ConvexHull

from swarm_mj.physics.state import BOX, CAPSULE, CYLINDER, ROBOT_HEIGHT_M, Obstacles
from swarm_mj.replay import palette
from swarm_mj.replay.mismatch import PIECES, LinkMismatch, mismatch_lines, shades
from swarm_mj.replay.rerun_log import LAYERS, RerunLog, lifted
from swarm_mj.replay.space import RADIUS_SHARE, ROBOT_HEIGHT

NUMBERS = ("sender", "receiver", "loss_db", "margin_db")  # of links, that the file keeps
FILL_SHARE = 0.008  # of half the map's width: between the lines that fill an obstacle
HALO, HALO_M = 1.7, 2.0  # of a robot that is cut off, by the robot's radius; its height [m]
CORNERS = 24  # of a circle
LATITUDES = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 9)  # of a ball's circles


def draw_obstacles(out: RerunLog, obstacles: Obstacles) -> None:
    """Draw on the map where obstacles are in the way of the antennas."""
    if not (outlines := footprints(obstacles, ROBOT_HEIGHT_M)):
        return
    path, apart_m = "arena/world/filling", FILL_SHARE * out.frame.reach_m
    lines = [line for outline in outlines for line in filling(outline, apart_m)]
    # The width is in metres, since rerun fills no areas.
    style: dict[str, Any] = LAYERS[path].style | {"radii": 0.55 * apart_m}
    out.fixed(path, rr.LineStrips2D.from_fields(strips=lines, **style))
    out.fixed_layer("arena/world/obstacle", strips=outlines)


def draw_mismatch(out: RerunLog, mismatch: LinkMismatch) -> None:
    """Draw links on which channel and belief differ, and who is cut off from the ego robot."""
    log, radius_m = out.log, RADIUS_SHARE * out.frame.reach_m
    position_m = log.position_m[mismatch.window - log.window[0]]
    for kind, links in mismatch.by_kind.items():
        lines_m, link = mismatch_lines(links, position_m, PIECES[kind])
        _draw_links(out, f"arena/world/{kind}", kind, links.chosen(link), lines_m)
        # In space they are whole, whatever their kind: dashes would make the file larger.
        lines_m, _ = mismatch_lines(links, position_m)
        lines_m = lifted(lines_m, ROBOT_HEIGHT * radius_m)
        _draw_links(out, f"scene/world/{kind}", kind, links, lines_m)
    row, robot = np.nonzero(log.is_cut_off)
    where_m = log.position_m[row, robot]
    out.layer("arena/world/cut_off", row, positions=where_m)
    path = "scene/world/cut_off"
    out.fixed(path, rr.Cylinders3D.from_fields(colors=[palette.CUT_OFF], fill_mode="solid"))
    radii, lengths = np.full(len(row), HALO * radius_m), np.full(len(row), HALO_M)
    halos = rr.Cylinders3D.columns(centers=lifted(where_m, 0.0), radii=radii, lengths=lengths)
    out.timed(path, out.partitioned(halos, row))


def _draw_links(
    out: RerunLog, path: str, kind: str, links: LinkMismatch, lines_m: Float[np.ndarray, "L 2 A"]
) -> None:
    """Draw a line for each of these links; those who click on one read its numbers."""
    out.fixed_layer(path)
    per_snapshot = np.bincount(links.row, minlength=len(links.window))
    columns = LAYERS[path].kind.columns(strips=lines_m, colors=shades(kind, links))
    numbers = rr.AnyValues.columns(**{name: getattr(links, name) for name in NUMBERS})
    parts = (part for each in (columns, numbers) for part in each.partition(per_snapshot))
    out.timed(path, parts, links.window)


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
