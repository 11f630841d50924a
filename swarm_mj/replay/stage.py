"""The still things of a replay, on the map and in 3-D: the ground, walls and obstacles."""

import itertools
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float, UInt8
from mujoco._enums import mjtTextureRole  # private: type checkers see it only there
from mujoco._functions import mj_kinematics, mju_mat2Quat
from mujoco._structs import MjData, MjModel

from swarm_mj.mission import Mission
from swarm_mj.physics.arenas import loss_db_of, obstacle_geoms, obstacles_of
from swarm_mj.physics.outlines import footprints
from swarm_mj.physics.scene import compose
from swarm_mj.physics.state import CAPSULE, CYLINDER, ELLIPSOID, ROBOT_HEIGHT_M, SPHERE
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.links import lifted
from swarm_mj.replay.rerun_log import LAYERS, RerunLog

SQUARE_M = 100.0
MAX_SQUARES = 60  # across the ground; more would be too small to see
GRID_M = 0.2  # above the floor
FILL_SHARE = 0.008  # of half the map's width: between the lines that fill an obstacle
MIRROR = np.diag([1.0, -1.0, 1.0])  # rerun's 2D views have y down, the map has it up
PLANE = 0  # as MuJoCo numbers it
FLOOR_M = 0.5  # half the thickness of a drawn plane: rerun has solids only
GLASS = "transparentfillmajorwireframe"  # obstacles hide no robot
FAR_M = 1e4  # half the side of a plane that has no end


def draw_stage(out: RerunLog) -> None:
    """Draw the area, its walls and its obstacles, on the map and in 3-D."""
    mission = out.log.facts.mission
    spec = compose(mission, scene=out.log.scene)
    if not mission.has_walls:
        # An open area's floor is as large as what is ever seen.
        low, high = (end(out.ground.centre_m, axis=0) for end in (np.min, np.max))
        for geom in (geom for geom in spec.geoms if geom.name == "floor"):
            geom.pos = [*(low + high) / 2.0, 0.0]
            geom.size = [*(high - low) / 2.0 + 1.5 * out.ground.reach_m, 1.0]
    model = spec.compile()
    _draw_ground(out, mission)
    for name, parts in static_geoms(model).items():
        for part in parts:
            out.fixed(f"scene/area/{name}", part)
    # On the map, where they are in the way of the antennas.
    if outlines := footprints(obstacles_of(model), ROBOT_HEIGHT_M):
        path = "arena/world/filling"
        apart_m = FILL_SHARE * out.ground.reach_m
        lines = [line for outline in outlines for line in filling(outline, apart_m)]
        # The width is in metres, since rerun fills no areas.
        style: dict[str, Any] = LAYERS[path].style | {"radii": 0.55 * apart_m}
        out.fixed(path, rr.LineStrips2D.from_fields(strips=lines, **style))
        out.fixed_layer("arena/world/obstacle", strips=outlines)


def _draw_ground(out: RerunLog, mission: Mission) -> None:
    if out.ground.moves:
        away = lifted(-out.ground.centre_m, 0.0)
        out.timed("scene", rr.Transform3D.columns(translation=away))
        # rerun shows a timed transform whole or not at all, so the mirror is repeated.
        mirrors = np.tile(MIRROR, (len(away), 1, 1))
        out.timed("arena", rr.Transform3D.columns(translation=away @ MIRROR, mat3x3=mirrors))
    else:
        out.fixed("arena", rr.Transform3D(mat3x3=MIRROR))
    strips = grid(out.ground)
    out.fixed_layer("arena/area/grid", strips=strips)
    out.fixed_layer("scene/grid", strips=lifted(np.array(strips), GRID_M))
    half = mission.half_side_m
    outline = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
    out.fixed_layer(f"arena/area/{'walls' if mission.has_walls else 'outline'}", strips=[outline])


def square_m(ground: Ground) -> float:
    """Return the side of the grid's squares: 100 m, or a power of ten more for a large ground."""
    across_m = 2.0 * ground.reach_m + float(np.max(np.ptp(ground.centre_m, axis=0)))
    return SQUARE_M * 10.0 ** max(0, int(np.ceil(np.log10(across_m / SQUARE_M / MAX_SQUARES))))


def grid(ground: Ground) -> list[list[tuple[float, float]]]:
    """Return lines at whole squares, over all the ground that the map ever shows."""
    square = square_m(ground)
    x_low, y_low = np.floor((np.min(ground.centre_m, axis=0) - ground.reach_m) / square)
    x_high, y_high = np.ceil((np.max(ground.centre_m, axis=0) + ground.reach_m) / square)
    xs, ys = np.arange(x_low, x_high + 1) * square, np.arange(y_low, y_high + 1) * square
    return [[(x, ys[0]), (x, ys[-1])] for x in xs] + [[(xs[0], y), (xs[-1], y)] for y in ys]


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


def static_geoms(model: MjModel) -> dict[str, list[rr.AsComponents]]:
    """Return what stands still in a scene by its geom's name: the arena, and whatever was added.

    Meshes and fields of heights are drawn as the boxes around them. Obstacles have their loss, for
    those who click on one.
    """
    data, found = MjData(model), {}
    mj_kinematics(model, data)
    stands_still = model.body_weldid[model.geom_bodyid] == 0
    obstacles = obstacle_geoms(model)
    for g in np.flatnonzero(stands_still).tolist():
        name = model.geom(g).name or f"geom{g}"
        loss = [rr.AnyValues(loss_db=loss_db_of(model, g))] if g in obstacles else []
        found[name] = [_drawn(model, data, g, GLASS if g in obstacles else "solid"), *loss]
    return found


def _drawn(model: MjModel, data: MjData, g: int, fill_mode: str) -> rr.AsComponents:
    quaternion = np.empty(4)
    mju_mat2Quat(quaternion, data.geom_xmat[g])
    style: dict[str, Any] = {
        "colors": [_colour(model, g)],
        "quaternions": [rr.Quaternion(xyzw=np.roll(quaternion, -1))],
        "fill_mode": fill_mode,
    }
    kind, size, place = model.geom_type[g], model.geom_size[g], data.geom_xpos[g]
    rotation = data.geom_xmat[g].reshape(3, 3)
    middle, half = np.split(model.geom_aabb[g], 2)
    if kind in (SPHERE, ELLIPSOID):
        return rr.Ellipsoids3D(half_sizes=[half], centers=[place], **style)
    if kind in (CYLINDER, CAPSULE):
        style |= {"radii": [size[0]], "lengths": [2.0 * size[1]]}
        if kind == CYLINDER:
            return rr.Cylinders3D(centers=[place], **style)
        # Rerun's capsule begins at its place, MuJoCo's has its middle there.
        return rr.Capsules3D(translations=[place - size[1] * rotation[:, 2]], **style)
    if kind == PLANE:  # a plate whose upper face is the plane; sizes of 0 are without end
        half = [*np.where(size[:2] > 0.0, size[:2], FAR_M), FLOOR_M]
        return rr.Boxes3D(half_sizes=[half], centers=[place - FLOOR_M * rotation[:, 2]], **style)
    return rr.Boxes3D(half_sizes=[half], centers=[place + rotation @ middle], **style)


def _colour(model: MjModel, g: int) -> UInt8[np.ndarray, "3"]:
    material = int(model.geom_matid[g])
    if material < 0:
        return (255.0 * model.geom_rgba[g, :3]).astype(np.uint8)
    rgb = np.array(model.mat_rgba[material, :3])
    texture = int(model.mat_texid[material, mjtTextureRole.mjTEXROLE_RGB.value])
    if texture >= 0 and model.tex_nchannel[texture] == 3:
        start = int(model.tex_adr[texture])
        size = 3 * int(model.tex_width[texture] * model.tex_height[texture])
        pixels = model.tex_data[start : start + size].reshape(-1, 3)
        rgb = rgb * np.mean(pixels, axis=0) / 255.0
    return (255.0 * rgb).astype(np.uint8)
