"""The obstacles of a compiled scene: which geoms they are, where they stand, what they cost.

They are the static geoms of group `OBSTACLE_GROUP`. The penetration loss of one is its first `user`
number [dB]; without one, or with 0, that of its material's name (`MATERIALS`), or
`DEFAULT_LOSS_DB`.
"""

import numpy as np
from mujoco._functions import mj_kinematics
from mujoco._structs import MjData, MjModel

from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import HEIGHT
from swarm_mj.physics.materials import DEFAULT_LOSS_DB, MATERIALS
from swarm_mj.physics.state import BOX, KINDS, ROBOT_HEIGHT_M, ROBOT_RADIUS_M, Obstacles
from swarm_mj.system.decibels import from_db

OBSTACLE_GROUP = 1
# Of the masks that say who collides.
SCENE_BIT = 1  # arenas, and what scenes add
ROBOTS_BIT = 2  # robots, where they collide with each other
MESH = 7  # as MuJoCo numbers it


def obstacles_of(model: MjModel) -> Obstacles:
    """Return the obstacles of a compiled scene, or raise ValueError by a loss (`loss_db_of`)."""
    data = MjData(model)
    mj_kinematics(model, data)
    found = np.array(obstacle_geoms(model), dtype=int)
    kind = model.geom_type[found].copy()
    size_m = model.geom_size[found].copy()
    centre_m = data.geom_xpos[found].copy()
    rotation = data.geom_xmat[found].reshape(-1, 3, 3).copy()
    for o in np.flatnonzero(kind == MESH):
        middle_m, half_m = np.split(model.geom_aabb[found[o]], 2)
        centre_m[o] += rotation[o] @ middle_m
        kind[o] = BOX
        size_m[o] = half_m
    is_finite = np.isfinite(np.column_stack([centre_m, size_m])).all(axis=1)
    if not np.all(is_finite):
        g = int(found[np.argmin(is_finite)])
        named = model.geom(g).name or f"number {g}"
        raise ValueError(f"geom {named} is of infinite size, or infinitely far; give it numbers")
    return Obstacles(
        kind=kind.astype(np.int64),
        centre_m=centre_m,
        rotation=rotation,
        size_m=size_m,
        reach_m=np.maximum(model.geom_rbound[found], 0.0),
        power_left=from_db(-np.array([loss_db_of(model, int(g)) for g in found])),
    )


def obstacle_geoms(model: MjModel) -> list[int]:
    """Return the geoms that are obstacles."""
    stands_still = model.body_weldid[model.geom_bodyid] == 0
    is_solid = np.isin(model.geom_type, (*KINDS, MESH))
    is_obstacle = stands_still & is_solid & (model.geom_group == OBSTACLE_GROUP)
    return np.flatnonzero(is_obstacle).tolist()


def idle_obstacles(model: MjModel, mission: Mission) -> dict[str, str]:
    """Return the obstacles that neither robots nor packets can meet, and where they stand."""
    reach_m = mission.half_side_m if mission.has_walls else np.inf  # from the centre, per axis
    found = obstacles_of(model)
    idle: dict[str, str] = {}
    for o, g in enumerate(obstacle_geoms(model)):
        # Of the box around it that MuJoCo keeps, in the obstacle's frame; a ball may be narrower.
        half_m = np.abs(found.rotation[o]) @ model.geom_aabb[g, 3:]
        half_m = np.minimum(half_m, found.reach_m[o])
        name = f"geom {model.geom(g).name or f'number {g}'}"
        off_m = np.abs(found.centre_m[o] - [0.0, 0.0, ROBOT_HEIGHT_M]) - half_m
        if np.any(off_m[:2] > reach_m):
            idle[name] = f"outside the area of {2 * reach_m:.0f} m by {2 * reach_m:.0f} m"
        elif off_m[2] > ROBOT_RADIUS_M and not mission.has_bodies:
            side = "above" if found.centre_m[o, HEIGHT] > ROBOT_HEIGHT_M else "below"
            idle[name] = f"{side} the robots, which are {ROBOT_HEIGHT_M:g} m above the floor"
    return idle


def loss_db_of(model: MjModel, g: int) -> float:
    """Return an obstacle's penetration loss [dB]; raise ValueError if negative or not finite."""
    material = int(model.geom_matid[g])
    named = model.mat(material).name if material >= 0 else ""
    known = MATERIALS.get(named)
    loss_db = DEFAULT_LOSS_DB if known is None else known.loss_db
    if model.nuser_geom > 0 and model.geom_user[g, 0] != 0.0:  # 0 where a geom has none
        loss_db = float(model.geom_user[g, 0])
    if not (np.isfinite(loss_db) and loss_db >= 0.0):
        geom = f"geom {model.geom(g).name or f'number {g}'}"
        raise ValueError(f"the penetration loss of {geom} must be 0 dB or more, not {loss_db:g}")
    return loss_db
