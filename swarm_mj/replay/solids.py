"""The solid parts of MuJoCo's scene that never move, as rerun draws them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float, UInt8
from mujoco._enums import mjtGeom, mjtTextureRole
from mujoco._functions import mj_kinematics, mju_mat2Quat
from mujoco._structs import MjData, MjModel

from swarm_mj.physics.solid_geoms import obstacle_geoms

FLOOR_M = 0.5  # half the thickness of a drawn plane: rerun has solids only
GLASS = "transparentfillmajorwireframe"  # obstacles hide no robot
FAR_M = 1e4  # half the side of a plane that has no end


def fixed_solids(model: MjModel) -> dict[str, rr.AsComponents]:
    """What stands still in a scene, each named by its geom: the arena, and whatever was added.

    Meshes and fields of heights are drawn as the boxes around them.
    """
    data = MjData(model)
    mj_kinematics(model, data)
    stands_still = model.body_weldid[model.geom_bodyid] == 0
    return {
        name_of(model, g): _solid(model, data, g) for g in np.flatnonzero(stands_still).tolist()
    }


def name_of(model: MjModel, g: int) -> str:
    """Return a geom's name, made up if it has none."""
    return model.geom(g).name or f"geom{g}"


def _solid(model: MjModel, data: MjData, g: int) -> rr.AsComponents:
    """Return a geom in its place."""
    quaternion = np.empty(4)
    mju_mat2Quat(quaternion, data.geom_xmat[g])
    turn = data.geom_xmat[g].reshape(3, 3)
    kind = int(model.geom_type[g])
    make = SOLIDS.get(kind, _box_around)
    return make(
        model.geom_size[g],
        model.geom_aabb[g],
        data.geom_xpos[g],
        turn,
        colors=[_colour(model, g)],
        quaternions=[rr.Quaternion(xyzw=np.roll(quaternion, -1))],
        fill_mode=GLASS if g in obstacle_geoms(model) else "solid",
    )


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


def _box(
    size: np.ndarray, _: np.ndarray, at: np.ndarray, __: np.ndarray, **look: Any
) -> rr.Boxes3D:
    return rr.Boxes3D(half_sizes=[size], centers=[at], **look)


def _box_around(
    _: np.ndarray, box: Float[np.ndarray, "6"], at: np.ndarray, turn: np.ndarray, **look: Any
) -> rr.Boxes3D:
    return rr.Boxes3D(half_sizes=[box[3:]], centers=[at + turn @ box[:3]], **look)


def _plane(
    size: np.ndarray, _: np.ndarray, at: np.ndarray, turn: np.ndarray, **look: Any
) -> rr.Boxes3D:
    """Return a plate whose upper face is the plane; sizes of 0 are without end."""
    half = [*np.where(size[:2] > 0.0, size[:2], FAR_M), FLOOR_M]
    return rr.Boxes3D(half_sizes=[half], centers=[at - FLOOR_M * turn[:, 2]], **look)


def _ellipsoid(
    size: np.ndarray, _: np.ndarray, at: np.ndarray, __: np.ndarray, **look: Any
) -> rr.Ellipsoids3D:
    half = size if np.all(size > 0.0) else np.full(3, size[0])  # a sphere's has one number
    return rr.Ellipsoids3D(half_sizes=[half], centers=[at], **look)


def _cylinder(
    size: np.ndarray, _: np.ndarray, at: np.ndarray, __: np.ndarray, **look: Any
) -> rr.Cylinders3D:
    return rr.Cylinders3D(radii=[size[0]], lengths=[2.0 * size[1]], centers=[at], **look)


def _capsule(
    size: np.ndarray, _: np.ndarray, at: np.ndarray, turn: np.ndarray, **look: Any
) -> rr.Capsules3D:
    """Rerun's begins where it stands, MuJoCo's has its middle there."""
    start = at - size[1] * turn[:, 2]
    return rr.Capsules3D(radii=[size[0]], lengths=[2.0 * size[1]], translations=[start], **look)


SOLIDS: dict[int, Callable[..., rr.AsComponents]] = {
    mjtGeom.mjGEOM_PLANE.value: _plane,
    mjtGeom.mjGEOM_SPHERE.value: _ellipsoid,
    mjtGeom.mjGEOM_CAPSULE.value: _capsule,
    mjtGeom.mjGEOM_ELLIPSOID.value: _ellipsoid,
    mjtGeom.mjGEOM_CYLINDER.value: _cylinder,
    mjtGeom.mjGEOM_BOX.value: _box,
}
