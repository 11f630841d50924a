"""The still things of a replay, on the map and in 3-D: the ground, walls and obstacles."""

import itertools
from typing import Literal, TypeAlias

import numpy as np
import rerun as rr
from jaxtyping import Float, UInt8
from mujoco._enums import mjtTextureRole  # private: type checkers see it only there
from mujoco._functions import mj_kinematics, mju_mat2Quat
from mujoco._specs import MjSpec
from mujoco._structs import MjData, MjModel

from swarm_mj.mission import Mission
from swarm_mj.physics.obstacles import loss_db_of, obstacle_geoms, obstacles_of
from swarm_mj.physics.outlines import footprints
from swarm_mj.physics.scene import compose
from swarm_mj.physics.state import CAPSULE, CYLINDER, ELLIPSOID, ROBOT_HEIGHT_M, SPHERE
from swarm_mj.replay import layers
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.links import lifted
from swarm_mj.replay.rerun_log import RerunLog

SQUARE_M = 100.0
MAX_SQUARES = 60  # across the ground; more would be too small to see
GRID_M = 0.2  # above the floor
FILL_SHARE = 0.008  # of half the map's width: between the lines that fill an obstacle
MIRROR = np.diag([1.0, -1.0, 1.0])  # rerun's 2D views have y down, the map has it up
PLANE_GEOM = 0  # as MuJoCo numbers it
FLOOR_M = 0.5  # half the thickness of a drawn plane: rerun has solids only
FillMode: TypeAlias = Literal["solid", "transparentfillmajorwireframe"]
GLASS: FillMode = "transparentfillmajorwireframe"  # obstacles hide no robot
FAR_M = 1e4  # half the side of a plane that has no end


def draw_stage(out: RerunLog) -> None:
    """Draw the area, its walls and its obstacles, on the map and in 3-D."""
    mission = out.log.facts.mission
    spec = compose(mission, scene=out.log.scene)
    if not mission.has_walls:
        _widen_floor(spec, out.drawn.ground)
    model = spec.compile()
    _draw_ground(out, mission)
    for name, parts in static_geoms(model).items():
        for part in parts:
            out.fixed(layers.SCENE_AREA.below(name), part)
    # On the map, where they are in the way of the antennas.
    outlines = footprints(obstacles_of(model), ROBOT_HEIGHT_M)
    if outlines:
        _draw_obstacles(out, outlines)


def _widen_floor(spec: MjSpec, ground: Ground) -> None:
    """Make an open area's floor as large as what is ever seen."""
    low_m = np.min(ground.centre_m, axis=0)
    high_m = np.max(ground.centre_m, axis=0)
    for geom in spec.geoms:
        if geom.name == "floor":  # a scene of the user's may have none
            geom.pos = [*(low_m + high_m) / 2.0, 0.0]
            geom.size = [*(high_m - low_m) / 2.0 + 1.5 * ground.reach_m, 1.0]


def _draw_obstacles(out: RerunLog, outlines_m: list[Float[np.ndarray, "_ 2"]]) -> None:
    apart_m = FILL_SHARE * out.unit_m
    lines = []
    for outline_m in outlines_m:
        lines += filling(outline_m, apart_m)
    # The width is in metres, since rerun fills no areas.
    out.fixed(layers.FILLING, layers.FILLING.look(strips=lines, radii=0.55 * apart_m))
    out.fixed(layers.OBSTACLES, layers.OBSTACLES.look(strips=outlines_m))


def move_ground(out: RerunLog) -> None:
    """Let the map and the scene follow the team, in an area that is open."""
    away = lifted(-out.ground.centre_m, 0.0)
    out.timed(layers.SCENE, rr.Transform3D.columns(translation=away))
    # rerun shows a timed transform whole or not at all, so the mirror is repeated.
    mirrors = np.tile(MIRROR, (len(away), 1, 1))
    columns = rr.Transform3D.columns(translation=away @ MIRROR, mat3x3=mirrors)
    out.timed(layers.ARENA, columns)


def _draw_ground(out: RerunLog, mission: Mission) -> None:
    if mission.has_walls:
        out.fixed(layers.ARENA, rr.Transform3D(mat3x3=MIRROR))
    strips = grid(out.drawn.ground)
    out.fixed(layers.GROUND_GRID, layers.GROUND_GRID.look(strips=strips))
    raised_m = lifted(np.array(strips), GRID_M)
    out.fixed(layers.SCENE_GRID, layers.SCENE_GRID.look(strips=raised_m))
    half = mission.half_side_m
    outline = [(-half, -half), (half, -half), (half, half), (-half, half), (-half, -half)]
    border = layers.WALLS if mission.has_walls else layers.OUTLINE
    out.fixed(border, border.look(strips=[outline]))


def square_m(ground: Ground) -> float:
    """Return the side of the grid's squares: 100 m, or a power of ten more for a large ground."""
    across_m = 2.0 * ground.reach_m + float(np.max(np.ptp(ground.centre_m, axis=0)))
    return SQUARE_M * 10.0 ** max(0, int(np.ceil(np.log10(across_m / SQUARE_M / MAX_SQUARES))))


def grid(ground: Ground) -> list[list[tuple[float, float]]]:
    """Return lines at whole squares, over all the ground that the map ever shows."""
    square = square_m(ground)
    x_low, y_low = np.floor((np.min(ground.centre_m, axis=0) - ground.reach_m) / square)
    x_high, y_high = np.ceil((np.max(ground.centre_m, axis=0) + ground.reach_m) / square)
    xs = np.arange(x_low, x_high + 1) * square
    ys = np.arange(y_low, y_high + 1) * square
    northward = [[(x, ys[0]), (x, ys[-1])] for x in xs]
    eastward = [[(xs[0], y), (xs[-1], y)] for y in ys]
    return northward + eastward


def filling(
    outline_m: Float[np.ndarray, "K 2"], apart_m: float
) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Return lines from west to east, so far apart, that fill an outline [m]."""
    _, y_m = outline_m.T
    y_low = np.min(y_m)
    y_high = np.max(y_m)
    num = max(1, int(np.ceil((y_high - y_low) / apart_m)))
    lines = []
    for y in y_low + (np.arange(num) + 0.5) * (y_high - y_low) / num:
        xs = []  # where the outline's edges cross this height: outlines are convex, so twice
        for (x_a, y_a), (x_b, y_b) in itertools.pairwise(outline_m.tolist()):
            # Half open, so that a corner counts for one of its edges only.
            if min(y_a, y_b) <= y < max(y_a, y_b):
                share = (y - y_a) / (y_b - y_a)
                xs.append(x_a + share * (x_b - x_a))
        lines.append(((min(xs), y), (max(xs), y)))
    return lines


def static_geoms(model: MjModel) -> dict[str, list[rr.AsComponents]]:
    """Return what stands still in a scene by its geom's name: the arena, and whatever was added.

    Meshes and fields of heights are drawn as the boxes around them. Obstacles have their loss, for
    those who click on one.
    """
    data = MjData(model)
    mj_kinematics(model, data)
    stands_still = model.body_weldid[model.geom_bodyid] == 0
    obstacles = obstacle_geoms(model)
    found = {}
    for g in np.flatnonzero(stands_still).tolist():
        name = model.geom(g).name or f"geom{g}"
        if g in obstacles:
            loss = rr.AnyValues(loss_db=loss_db_of(model, g))
            found[name] = [drawn_geom(model, data, g, GLASS), loss]
        else:
            found[name] = [drawn_geom(model, data, g, "solid")]
    return found


def drawn_geom(model: MjModel, data: MjData, g: int, fill_mode: FillMode) -> rr.AsComponents:
    """Return a geom in the shape that rerun has for its kind, or else as the box around it."""
    kind = model.geom_type[g]
    size_m = model.geom_size[g]
    place_m = data.geom_xpos[g]
    turns = [_quaternion(data, g)]
    colours = [_colour(model, g)]
    if kind in (SPHERE, ELLIPSOID):
        _, half_m = np.split(model.geom_aabb[g], 2)
        return rr.Ellipsoids3D(
            half_sizes=[half_m],
            centers=[place_m],
            quaternions=turns,
            colors=colours,
            fill_mode=fill_mode,
        )
    if kind == CYLINDER:
        radius_m, half_length_m, _ = size_m
        return rr.Cylinders3D(
            radii=[radius_m],
            lengths=[2.0 * half_length_m],
            centers=[place_m],
            quaternions=turns,
            colors=colours,
            fill_mode=fill_mode,
        )
    if kind == CAPSULE:
        # Rerun's capsule begins at its place, MuJoCo's has its middle there.
        radius_m, half_length_m, _ = size_m
        return rr.Capsules3D(
            radii=[radius_m],
            lengths=[2.0 * half_length_m],
            translations=[place_m - half_length_m * _upward(data, g)],
            quaternions=turns,
            colors=colours,
            fill_mode=fill_mode,
        )
    return _box_around(model, data, g, fill_mode)


def _box_around(model: MjModel, data: MjData, g: int, fill_mode: FillMode) -> rr.Boxes3D:
    """Return the box around a geom; of a plane, a plate whose upper face it is."""
    place_m = data.geom_xpos[g]
    rotation = data.geom_xmat[g].reshape(3, 3)
    # In the geom's own axes: a mesh's box need not be centred on its place.
    middle_m, half_m = np.split(model.geom_aabb[g], 2)
    centre_m = place_m + rotation @ middle_m
    if model.geom_type[g] == PLANE_GEOM:
        half_x_m, half_y_m, _ = model.geom_size[g]
        # A size of 0 means without end.
        half_m = np.array([half_x_m or FAR_M, half_y_m or FAR_M, FLOOR_M])
        centre_m = place_m - FLOOR_M * _upward(data, g)
    return rr.Boxes3D(
        half_sizes=[half_m],
        centers=[centre_m],
        quaternions=[_quaternion(data, g)],
        colors=[_colour(model, g)],
        fill_mode=fill_mode,
    )


def _upward(data: MjData, g: int) -> np.ndarray:
    """Return a geom's own upward axis in the world: the third column of its rotation."""
    _, _, upward = data.geom_xmat[g].reshape(3, 3).T
    return upward


def _quaternion(data: MjData, g: int) -> rr.Quaternion:
    wxyz = np.empty(4)
    mju_mat2Quat(wxyz, data.geom_xmat[g])
    return rr.Quaternion(xyzw=np.roll(wxyz, -1))  # MuJoCo writes w first, rerun last


def _colour(model: MjModel, g: int) -> UInt8[np.ndarray, "3"]:
    """Return a geom's own colour, or its material's: of a texture the mean, as rerun has none."""
    material = int(model.geom_matid[g])
    if material < 0:
        return (255.0 * model.geom_rgba[g, :3]).astype(np.uint8)
    rgb = np.array(model.mat_rgba[material, :3])
    texture = int(model.mat_texid[material, mjtTextureRole.mjTEXROLE_RGB.value])
    if texture >= 0 and model.tex_nchannel[texture] == 3:
        # All textures' bytes lie in one array, one after the other.
        start = int(model.tex_adr[texture])
        num_pixels = int(model.tex_width[texture] * model.tex_height[texture])
        pixels = model.tex_data[start : start + 3 * num_pixels].reshape(-1, 3)
        rgb = rgb * np.mean(pixels, axis=0) / 255.0
    return (255.0 * rgb).astype(np.uint8)
