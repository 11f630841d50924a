"""The geoms of MuJoCo's scene that never move, as rerun draws them."""

from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import UInt8
from mujoco._enums import mjtTextureRole
from mujoco._functions import mj_kinematics, mju_mat2Quat
from mujoco._structs import MjData, MjModel

from swarm_mj.physics.solid_geoms import obstacle_geoms
from swarm_mj.physics.state import CAPSULE, CYLINDER, ELLIPSOID, SPHERE

PLANE = 0  # as MuJoCo numbers it
FLOOR_M = 0.5  # half the thickness of a drawn plane: rerun has solids only
GLASS = "transparentfillmajorwireframe"  # obstacles hide no robot
FAR_M = 1e4  # half the side of a plane that has no end


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
