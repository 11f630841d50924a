"""Questions to the compiled model of one robot, and its way into a scene."""

import numpy as np
from jaxtyping import Bool, Float
from mujoco._enums import mjtBias, mjtJoint, mjtObj
from mujoco._functions import mj_forward, mj_name2id
from mujoco._specs import MjsBody, MjSpec
from mujoco._structs import MjData, MjModel

# MuJoCo's coordinates of a free base, and their rates.
PLACE = slice(0, 3)
ATTITUDE = slice(3, 7)  # a quaternion
FREE_QPOS = 7
VELOCITY = slice(0, 3)
TURN_RATE = slice(3, 6)
FREE_QVEL = 6
# Of one that slides along x and y, and turns about z; of its rates, too.
PLANAR_PLACE = slice(0, 2)
HEADING = 2
PLANAR_QPOS = 3
# Of a quaternion.
REAL = 0
ABOUT_Z = 3
LEVEL = (1.0, 0.0, 0.0, 0.0)
ANTENNA = "antenna"  # the site where a model has it


def collides(model: MjModel) -> Bool[np.ndarray, "G"]:
    """Return which geoms are of the robot, not its surroundings, and collide."""
    has_mask = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    return has_mask & (model.geom_bodyid > 0)


def is_motor(model: MjModel) -> Bool[np.ndarray, "U"]:
    """Return which actuators' force is their control times a gain, and nothing else."""
    return model.actuator_biastype == mjtBias.mjBIAS_NONE


def rest_pose(model: MjModel) -> MjData:
    """Return a robot whose base is level at the origin, or on its plane, all other joints at 0."""
    data = MjData(model)
    if is_free_base(model):
        data.qpos[PLACE] = 0.0
        data.qpos[ATTITUDE] = LEVEL
    mj_forward(model, data)
    return data


def is_free_base(model: MjModel) -> bool:
    """Return whether a robot's base can move and turn in all directions: it flies."""
    return int(model.jnt_type[0]) == int(mjtJoint.mjJNT_FREE)


def antenna_offset_m(model: MjModel) -> Float[np.ndarray, "3"]:
    """Return the antenna's place from the base, in a robot at rest; 0 without such a site [m]."""
    site = mj_name2id(model, mjtObj.mjOBJ_SITE, ANTENNA)
    if site < 0:
        return np.zeros(3)
    data = rest_pose(model)
    return data.site_xpos[site] - data.xpos[1]


def attached(spec: MjSpec, own: MjSpec, i: int) -> MjsBody:
    """Attach a robot, with what refers to its parts alone, as `r{i}/`; return its base there."""
    return spec.worldbody.add_frame().attach_body(base_of(own), f"r{i}/", "")


def base_of(spec: MjSpec) -> MjsBody:
    """Return the one body that stands in the world."""
    return spec.worldbody.first_body()
