"""The bodies of a replay: each robot's own geoms, where it is and as it is turned, in 3-D.

A line is the thrust of its motors: straight up, and as long as its weight, while one hovers.

They are drawn as large as the discs that stand for points: true to scale, none could be seen in an
area of a square kilometre.
"""

from collections.abc import Iterable

import numpy as np
import rerun as rr
from jaxtyping import Float
from mujoco._structs import MjModel

from swarm_mj.physics.robot_model import rest_pose
from swarm_mj.physics.robots import RobotKind, kinds_of
from swarm_mj.replay import layers
from swarm_mj.replay.layer_kinds import Entity
from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.stage import drawn_geom

LARGER = 1.6  # than a disc: a body is seen around the colour of its age
THRUST_RADII = 4.0  # length of a thrust as large as the weight, by a disc's radius
HIDDEN_GROUP = 3  # of geoms that only collide, by MuJoCo's custom


def body_of(i: int) -> Entity:
    """Return the entity of a robot's body."""
    return layers.SCENE_BODIES.below(f"r{i}")


def draw_bodies(out: RerunLog, radius_m: float) -> None:
    """Draw all bodies in all windows; their geoms, which never change, with the first piece."""
    log = out.log
    assert log.height_m is not None
    assert log.attitude is not None
    place_m = np.concatenate([log.position_m, log.height_m[..., None]], axis=2)
    real_last = log.attitude[..., [1, 2, 3, 0]]  # as rerun has quaternions
    for kind in kinds_of(log.facts.mission):
        scale = LARGER * radius_m / kind.reach_m
        for i in range(kind.first, kind.first + kind.num_robots):
            if out.is_first:
                for name, shape in _geoms(kind).items():
                    out.fixed(body_of(i).below(name), shape)
            columns = rr.Transform3D.columns(
                translation=place_m[:, i],
                quaternion=real_last[:, i],
                scale=np.full((len(place_m), 3), scale),
            )
            out.timed(body_of(i), columns)
    if log.thrust is not None:
        end_m = place_m + THRUST_RADII * radius_m * rotated(log.thrust, log.attitude)
        out.lines(layers.SCENE_THRUST, place_m.reshape(-1, 3), end_m.reshape(-1, 3))


def rotated(
    vector: Float[np.ndarray, "T N 3"], attitude: Float[np.ndarray, "T N 4"]
) -> Float[np.ndarray, "T N 3"]:
    """Return vectors of robots' own axes in those of the world."""
    real = attitude[..., :1]
    imaginary = attitude[..., 1:]
    turned = np.cross(imaginary, vector)
    return vector + 2.0 * (real * turned + np.cross(imaginary, turned))


def _geoms(kind: RobotKind) -> dict[str, rr.AsComponents]:
    """Return the shapes that are seen of a robot in its own frame, by the names of its geoms."""
    model = kind.model
    data = rest_pose(kind.model)
    data.geom_xpos[:, 2] -= data.xpos[1, 2]  # of a base on a plane, which is above the floor
    found: dict[str, rr.AsComponents] = {}
    for g in _seen(model):
        name = model.geom(g).name or f"geom{g}"
        found[name] = drawn_geom(model, data, g, "solid")
    return found


def _seen(model: MjModel) -> Iterable[int]:
    """Return the robot's geoms that are seen: not its surroundings, nor those that only collide."""
    for g in range(model.ngeom):
        is_shown = model.geom_group[g] < HIDDEN_GROUP and model.geom_rgba[g, 3] > 0.0
        if model.geom_bodyid[g] > 0 and is_shown:
            yield g
