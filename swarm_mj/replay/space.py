"""The replay's view in three dimensions: MuJoCo's scene, robots as bodies, packets as arcs."""

import numpy as np
import rerun as rr
from jaxtyping import UInt8
from mujoco._structs import MjModel

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import compose
from swarm_mj.physics.solid_geoms import loss_db_of, obstacle_geoms
from swarm_mj.replay.arena import RING_SHARE, grid, heading_m
from swarm_mj.replay.packets import PacketSegments, arcs
from swarm_mj.replay.rerun_log import RerunLog, lifted
from swarm_mj.replay.static_geoms import name_of, static_geoms

RADIUS_SHARE = 1.4 * RING_SHARE  # of a body, by half the view's width
OBSERVER = 1.3  # times larger
ROBOT_HEIGHT = 0.8  # of a body, by its radius
GRID_M = 0.2  # above the floor


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
        loss = rr.AnyValues(loss_db=loss_db_of(model, g))
        out.fixed(f"scene/area/{name_of(model, g)}", loss)
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
