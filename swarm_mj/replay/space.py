"""The replay's view in three dimensions: MuJoCo's scene, robots as bodies, packets as arcs."""

from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import UInt8
from mujoco._enums import mjtTextureRole
from mujoco._functions import mj_kinematics, mju_mat2Quat
from mujoco._structs import MjData, MjModel

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import compose
from swarm_mj.physics.solid_geoms import loss_db_of, obstacle_geoms
from swarm_mj.physics.state import CAPSULE, CYLINDER, ELLIPSOID, SPHERE
from swarm_mj.replay import palette
from swarm_mj.replay.arena import RING_SHARE, grid, heading_m
from swarm_mj.replay.mismatch import LinkMismatch, mismatch_lines
from swarm_mj.replay.packets import PacketSegments, arcs
from swarm_mj.replay.rerun_log import RerunLog, lifted

RADIUS_SHARE = 1.4 * RING_SHARE  # of a body, by half the view's width
OBSERVER = 1.3  # times larger
ROBOT_HEIGHT = 0.8  # of a body, by its radius
GRID_M = 0.2  # above the floor
HALO, HALO_M = 1.7, 2.0  # of a robot that is cut off, by the robot's radius; its height [m]
PLANE = 0  # as MuJoCo numbers it
FLOOR_M = 0.5  # half the thickness of a drawn plane: rerun has solids only
GLASS = "transparentfillmajorwireframe"  # obstacles hide no robot
FAR_M = 1e4  # half the side of a plane that has no end


def stage(out: RerunLog, mission: Mission) -> MjModel:
    """Compile MuJoCo's scene as it is drawn."""
    spec = compose(mission, scene=out.log.scene)
    if not mission.has_walls:
        # An open area's floor is as large as what is ever seen.
        low, high = (end(out.frame.centre_m, axis=0) for end in (np.min, np.max))
        for geom in (geom for geom in spec.geoms if geom.name == "floor"):
            geom.pos = [*(low + high) / 2.0, 0.0]
            geom.size = [*(high - low) / 2.0 + 1.5 * out.frame.reach_m, 1.0]
    return spec.compile()


def draw_space(
    out: RerunLog,
    model: MjModel,
    segments: dict[str, PacketSegments],
    colours: UInt8[np.ndarray, "T N 3"],
) -> None:
    """Draw the model once, and robots and packets, by their fate, window by window."""
    if out.frame.moves:
        away = lifted(-out.frame.centre_m, 0.0)
        out.timed("scene", rr.Transform3D.columns(translation=away))
    for name, solid in static_geoms(model).items():
        out.fixed(f"scene/area/{name}", solid)
    for g in obstacle_geoms(model):  # for those who click on one
        out.fixed(f"scene/area/{name_of(model, g)}", rr.AnyValues(loss_db=loss_db_of(model, g)))
    out.fixed_layer("scene/grid", strips=lifted(np.array(grid(out.frame)), GRID_M))
    log, radius_m = out.log, RADIUS_SHARE * out.frame.reach_m
    height_m = ROBOT_HEIGHT * radius_m
    _draw_bodies(out, colours, radius_m, height_m)
    if log.has_motion:
        start, end = log.position_m, log.position_m + heading_m(out)
        ends = (lifted(at.reshape(-1, 2), height_m) for at in (start, end))
        out.lines("scene/heading", *ends)
    for fate, drawn in segments.items():
        strips = arcs(drawn.start_m, drawn.end_m, height_m)
        out.layer(f"scene/packets/{fate}", drawn.row, strips=strips)
    if log.mismatch is not None:
        _draw_mismatch(out, log.mismatch, radius_m, height_m)


def _draw_bodies(
    out: RerunLog, colours: UInt8[np.ndarray, "T N 3"], radius_m: float, height_m: float
) -> None:
    """Draw robots as cylinders; those who click on one, and videos, read what is known of it."""
    log, path = out.log, "scene/robots"
    num_robots = log.is_on.shape[1]
    radii = np.full(num_robots, radius_m)
    radii[log.ego] *= OBSERVER
    lengths = np.full(num_robots, height_m)
    out.fixed(path, rr.Cylinders3D.from_fields(radii=radii, lengths=lengths, fill_mode="solid"))
    where = lifted(log.position_m.reshape(-1, 2), height_m / 2.0)
    bodies = rr.Cylinders3D.columns(centers=where, colors=colours.reshape(-1, 3))
    out.timed(path, out.partitioned(bodies))
    age = log.known_age.astype(np.float32).ravel()
    out.timed(path, out.partitioned(rr.AnyValues.columns(age=age, is_on=log.is_on.ravel())))
    if log.mismatch is not None:
        cut_off = rr.AnyValues.columns(is_cut_off=log.is_cut_off.ravel())
        out.timed(path, out.partitioned(cut_off))


def _draw_mismatch(out: RerunLog, mismatch: LinkMismatch, radius_m: float, height_m: float) -> None:
    """Draw links on which channel and belief differ, and halos of robots that are cut off."""
    log = out.log
    position_m = log.position_m[mismatch.window - log.window[0]]
    for kind, links in mismatch.by_kind.items():
        # They are whole, whatever their kind: dashes would make the file larger.
        lines_m, _ = mismatch_lines(links, position_m)
        out.mismatch_lines(f"scene/world/{kind}", kind, links, lifted(lines_m, height_m))
    (row, robot), path = np.nonzero(log.is_cut_off), "scene/world/cut_off"
    out.fixed(path, rr.Cylinders3D.from_fields(colors=[palette.CUT_OFF], fill_mode="solid"))
    radii, lengths = np.full(len(row), HALO * radius_m), np.full(len(row), HALO_M)
    where_m = lifted(log.position_m[row, robot], 0.0)
    halos = rr.Cylinders3D.columns(centers=where_m, radii=radii, lengths=lengths)
    out.timed(path, out.partitioned(halos, row))


def static_geoms(model: MjModel) -> dict[str, rr.AsComponents]:
    """Return what stands still in a scene by its geom's name: the arena, and whatever was added.

    Meshes and fields of heights are drawn as the boxes around them.
    """
    data = MjData(model)
    mj_kinematics(model, data)
    stands_still = model.body_weldid[model.geom_bodyid] == 0
    return {
        name_of(model, g): _drawn(model, data, g) for g in np.flatnonzero(stands_still).tolist()
    }


def name_of(model: MjModel, g: int) -> str:
    """Return a geom's name, made up if it has none."""
    return model.geom(g).name or f"geom{g}"


def _drawn(model: MjModel, data: MjData, g: int) -> rr.AsComponents:
    quaternion = np.empty(4)
    mju_mat2Quat(quaternion, data.geom_xmat[g])
    style: dict[str, Any] = {
        "colors": [_colour(model, g)],
        "quaternions": [rr.Quaternion(xyzw=np.roll(quaternion, -1))],
        "fill_mode": GLASS if g in obstacle_geoms(model) else "solid",
    }
    kind, size, place = model.geom_type[g], model.geom_size[g], data.geom_xpos[g]
    rotation = data.geom_xmat[g].reshape(3, 3)
    if kind in (SPHERE, ELLIPSOID):
        half = size if np.all(size > 0.0) else np.full(3, size[0])  # a sphere's has one number
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
    middle, half = np.split(model.geom_aabb[g], 2)
    return rr.Boxes3D(half_sizes=[half], centers=[place + rotation @ middle], **style)


def _colour(model: MjModel, g: int) -> UInt8[np.ndarray, "3"]:
    """Return a geom's colour, or its material's, or the mean of its texture."""
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
