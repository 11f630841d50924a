"""The rules that a model must keep to be one robot of a team, each with its message."""

import numpy as np
from mujoco._enums import mjtJoint
from mujoco._specs import MjSpec
from mujoco._structs import MjModel

from swarm_mj.physics.arena_files import take_over_settings
from swarm_mj.physics.pilots import GRAVITY_MPS2
from swarm_mj.physics.robot_model import (
    LEVEL,
    PLANAR_QPOS,
    antenna_offset_m,
    attached,
    collides,
    is_free_base,
)

LEAST_STEP_S = 0.0005
MOST_STEP_S = 0.01
MOST_ANTENNA_M = 10.0  # above or below the base
OFF_AXIS_M = 1e-6  # as much as a compiled model rounds by


def check_robot(kind: str, spec: MjSpec, model: MjModel) -> None:
    """Raise ValueError for a model that cannot be one robot of a team."""
    said = _fault_of_base(spec, model) or _fault_of_parts(model) or _fault_of_sensors(spec, model)
    if said:
        raise ValueError(f"robot {kind}: {said}")


def _fault_of_base(spec: MjSpec, model: MjModel) -> str:
    """Return what is wrong with where a model is and how it can move; nothing if it is right."""
    bases = spec.worldbody.bodies
    if len(bases) != 1:
        return f"it has {len(bases)} bodies in the world, but a robot has one, and others within it"
    if not _has_base(model):
        return (
            f"body {bases[0].name or 'without a name'} is neither free nor on a plane; give it "
            "<freejoint/>, or slides along x and y and then a hinge about z"
        )
    if not _is_at_origin(model):
        return (
            "a base on a plane must begin at x = y = 0, level and facing x, its joints without pos "
            "and ref"
        )
    return ""


def _fault_of_parts(model: MjModel) -> str:
    """Return what is wrong with what a model has; nothing if it is right."""
    step_s = model.opt.timestep
    if model.nu == 0:
        return "it has no actuator, so nothing could drive it"
    if not np.any(collides(model)):
        return "it has no geom that collides, so nothing could stop it; give one contype 1"
    if not LEAST_STEP_S <= step_s <= MOST_STEP_S:
        limits = f"from {LEAST_STEP_S:g} to {MOST_STEP_S:g} s"
        return f"its timestep must be {limits}, not {step_s:g}; give <option timestep/>"
    if model.opt.gravity.tolist() != [0.0, 0.0, -GRAVITY_MPS2] or np.any(model.opt.wind):
        return (
            f"gravity is {GRAVITY_MPS2:g} m/s² here, and wind the mission's; take both out of its "
            "option"
        )
    if model.neq + model.ntendon > 0:
        return "it has equalities or tendons, which are not supported"
    return _fault_of_antenna(model)


def _fault_of_antenna(model: MjModel) -> str:
    """Return what is wrong with where the antenna is; nothing if it is right."""
    x_m, y_m, z_m = antenna_offset_m(model).tolist()
    if max(abs(x_m), abs(y_m)) <= OFF_AXIS_M and abs(z_m) <= MOST_ANTENNA_M:
        return ""
    return (
        f"its antenna must be right above or below its base, at most {MOST_ANTENNA_M:g} m away, "
        f'not at ({x_m:g}, {y_m:g}, {z_m:g}) m from it; give the site pos="0 0 HEIGHT"'
    )


def _fault_of_sensors(spec: MjSpec, model: MjModel) -> str:
    """Return what is wrong with a model's sensors; nothing if it is right."""
    if model.nsensor == 0:
        return ""
    scene = MjSpec()
    own = spec.copy()
    take_over_settings(scene, own)
    attached(scene, own, 0)
    if scene.compile().nsensordata == model.nsensordata:
        return ""
    return (
        "it has a sensor of what is not in its body, which stays out of the scene; leave that "
        "sensor out"
    )


def _is_at_origin(model: MjModel) -> bool:
    """Return whether a planar base has the coordinates that its joints have; a free one may not."""
    if is_free_base(model):
        return True
    is_level = np.allclose(model.body_quat[1], LEVEL)
    is_central = not np.any(model.body_pos[1, :2]) and not np.any(model.jnt_pos[:3])
    return is_level and is_central and not np.any(model.qpos0[:PLANAR_QPOS])


def _has_base(model: MjModel) -> bool:
    """Return whether the first body, and no other, is on a free joint or a planar base."""
    slide, hinge = int(mjtJoint.mjJNT_SLIDE), int(mjtJoint.mjJNT_HINGE)
    of_base = np.flatnonzero(model.jnt_bodyid == 1)
    kinds = model.jnt_type[of_base].tolist()
    if kinds == [int(mjtJoint.mjJNT_FREE)]:
        return True
    is_planar = kinds == [slide, slide, hinge]
    return is_planar and bool(np.array_equal(model.jnt_axis[of_base], np.eye(3)))
