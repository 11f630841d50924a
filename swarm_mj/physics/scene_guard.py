"""The guard of scenes: it refuses those that change how robots move, their hulls or the solver."""

from typing import NamedTuple

import numpy as np
from mujoco._specs import MjsActuator, MjsGeom, MjsJoint, MjSpec

# What a scene must leave, by what it is of.
OF_JOINTS = (
    "axis",
    "damping",
    "stiffness",
    "frictionloss",
    "armature",
    "range",
    "limited",
    "ref",
    "springref",
    "actfrclimited",
    "solref_limit",
    "solimp_limit",
    "actgravcomp",
    "margin",
)
OF_ACTUATORS = (
    "damping",
    "armature",
    "gear",
    "gainprm",
    "biasprm",
    "gaintype",
    "biastype",
    "dyntype",
    "dynprm",
    "ctrlrange",
    "forcerange",
    "ctrllimited",
    "forcelimited",
)
OF_OPTIONS = (
    "integrator",
    "solver",
    "cone",
    "jacobian",
    "enableflags",
    "disableactuator",
    "iterations",
    "tolerance",
    "ls_iterations",
    "ls_tolerance",
    "impratio",
    "gravity",
    "wind",
    "density",
    "viscosity",
)
# What a scene must leave of the sphere that stands for a robot; `worlds` sees to its mass.
HULL = ("type", "size", "pos", "quat", "fromto", "contype", "conaffinity", "margin", "gap")


class Kept(NamedTuple):
    """The parts, numbers and hulls that a scene must leave, as they are before or after it."""

    parts: list[str]  # what a message calls each joint and actuator
    motion: dict[str, str]  # their numbers and those of MuJoCo's solver, by what they are of
    hulls: dict[str, str]  # the shapes, places and masks of the robots' hulls, likewise


def kept_parts(spec: MjSpec, num_hulls: int) -> Kept:
    """Return what a scene must leave; robots with bodies have no hulls."""
    return Kept(parts=_moving_parts(spec), motion=_motion(spec), hulls=_hulls(spec, num_hulls))


def check_kept(name: str, before: Kept, after: Kept) -> None:
    """Raise ValueError if the scene of this name changed what it must leave."""
    _check_parts(name, before.parts, after.parts)
    _check_unchanged("how robots move", before.motion, after.motion)
    _check_unchanged("the robots' hulls", before.hulls, after.hulls)


def hull_of(spec: MjSpec, i: int) -> MjsGeom:
    """Return the sphere that stands for robot i; ValueError if a scene deleted it."""
    hull = spec.geom(f"r{i}/hull")
    if hull is None:
        raise ValueError(f"a scene must leave the robots' hulls, but deleted r{i}/hull")
    return hull


def _check_parts(name: str, before: list[str], after: list[str]) -> None:
    """Raise ValueError if a scene added, took away or renamed what moves or is moved."""
    for part in after:
        if part not in before:
            raise ValueError(f"scene {name} adds {part}; scenes may add only static geometry")
    for part in before:
        if part not in after:
            raise ValueError(
                f"scene {name} removes or renames {part}; robots must keep joints and actuators"
            )


def _check_unchanged(what: str, before: dict[str, str], after: dict[str, str]) -> None:
    """Raise ValueError if one of the numbers that a scene must leave is another now."""
    for name, value in after.items():
        if value != before.get(name):
            raise ValueError(f"a scene must leave {what}, but changed {name}; add geoms instead")


def _moving_parts(spec: MjSpec) -> list[str]:
    """Return what a message calls each joint and actuator; no two of them are called alike."""
    joints = [f"joint {_called(n, joint)}" for n, joint in enumerate(spec.joints)]
    actuators = [f"actuator {_called(n, each)}" for n, each in enumerate(spec.actuators)]
    return joints + actuators


def _called(n: int, part: MjsJoint | MjsActuator) -> str:
    """Return the name of the n-th joint or actuator; models need not give them names."""
    return part.name or f"{n}, which has no name"


def _motion(spec: MjSpec) -> dict[str, str]:
    """Return the numbers of joints and actuators and of MuJoCo's solver, by what they are of."""
    named = [OF_JOINTS] * len(spec.joints) + [OF_ACTUATORS] * len(spec.actuators) + [OF_OPTIONS]
    parts = [*spec.joints, *spec.actuators, spec.option]
    owners = [*_moving_parts(spec), "option"]
    motion: dict[str, str] = {}
    for owner, part, names in zip(owners, parts, named, strict=True):
        for name in names:
            value = getattr(part, name)
            motion[f"{name} of {owner}"] = str(np.asarray(value).tolist())  # nan is nan there
    return motion


def _hulls(spec: MjSpec, num_hulls: int) -> dict[str, str]:
    """Return the shape, place and masks of these robots' hulls, by what they are of."""
    found: dict[str, str] = {}
    for i in range(num_hulls):
        hull = hull_of(spec, i)
        for name in HULL:
            found[f"{name} of {hull.name}"] = str(np.asarray(getattr(hull, name)).tolist())
    return found
