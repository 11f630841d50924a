"""The replay's view in three dimensions: MuJoCo's scene, robots as bodies, packets as arcs."""

import numpy as np
import rerun as rr
from jaxtyping import UInt8
from mujoco._structs import MjModel

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import compose
from swarm_mj.physics.solid_geoms import loss_db_of, obstacle_geoms
from swarm_mj.replay import palette
from swarm_mj.replay.arcs import arcs
from swarm_mj.replay.arena import HEADING_SHARE, RING_SHARE, grid
from swarm_mj.replay.layers import screen
from swarm_mj.replay.links import Links
from swarm_mj.replay.sheet import Sheet
from swarm_mj.replay.shots import LOOKS, ends_of
from swarm_mj.replay.solids import fixed_solids, name_of

RADIUS_SHARE = 1.4 * RING_SHARE  # of a body, by half the view's width
OBSERVER = 1.3  # times larger
ROBOT_HEIGHT = 0.8  # of a body, by its radius
GRID_M = 0.2  # above the floor


def stage(sheet: Sheet, mission: Mission) -> MjModel:
    """MuJoCo's scene as it is drawn."""
    spec = compose(mission, scene=sheet.log.scene)
    if not mission.has_walls:
        # An open area's floor is as large as what is ever seen.
        low, high = (end(sheet.frame.centre_m, axis=0) for end in (np.min, np.max))
        for geom in (geom for geom in spec.geoms if geom.name == "floor"):
            geom.pos = [*(low + high) / 2.0, 0.0]
            geom.size = [*(high - low) / 2.0 + 1.5 * sheet.frame.reach_m, 1.0]
    return spec.compile()


def draw_space(
    sheet: Sheet,
    model: MjModel,
    packets: dict[str, Links],
    colours: UInt8[np.ndarray, "T N 3"],
) -> None:
    """Draws it: what stands still once, the rest window by window.

    Args:
        sheet: To draw on.
        model: MuJoCo's, of `stage`.
        packets: By their fate.
        colours: The robots'.
    """
    if sheet.frame.moves:
        away = np.pad(-sheet.frame.centre_m, ((0, 0), (0, 1)))
        sheet.timed("scene", rr.Transform3D.columns(translation=away))
    for name, solid in fixed_solids(model).items():
        sheet.fixed(f"scene/area/{name}", solid)
    for g in obstacle_geoms(model):  # for those who click on one
        loss = rr.AnyValues(loss_db=loss_db_of(model, g))
        sheet.fixed(f"scene/area/{name_of(model, g)}", loss)
    lines = [[(*start, GRID_M), (*end, GRID_M)] for start, end in grid(sheet.frame)]
    style = {"colors": [palette.OUTLINE], "radii": screen(0.5)}
    sheet.fixed("scene/grid", rr.LineStrips3D(lines, **style))
    _draw_bodies(sheet, colours)
    _draw_packets(sheet, packets)


def _draw_bodies(sheet: Sheet, colours: UInt8[np.ndarray, "T N 3"]) -> None:
    log, radius_m = sheet.log, RADIUS_SHARE * sheet.frame.reach_m
    num_windows, num_robots = log.is_on.shape
    height_m = ROBOT_HEIGHT * radius_m
    radii = np.full(num_robots, radius_m)
    radii[log.ego] *= OBSERVER
    bodies = rr.Cylinders3D.from_fields(
        radii=radii, lengths=np.full(num_robots, height_m), fill_mode="solid"
    )
    sheet.fixed("scene/robots", bodies)
    shown = palette.with_switched_off(colours, log.is_on)
    where = _lifted(log.position_m, height_m / 2.0)
    columns = rr.Cylinders3D.columns(centers=where, colors=shown.reshape(-1, 3))
    sheet.timed("scene/robots", columns.partition([num_robots] * num_windows))
    # For those who click on a robot, and for videos.
    age = log.known_age.astype(np.float32).ravel()
    known = rr.AnyValues.columns(age=age, is_on=log.is_on.ravel())
    sheet.timed("scene/robots", known.partition([num_robots] * num_windows))
    if log.looks is not None:
        cut_off = rr.AnyValues.columns(is_cut_off=log.is_cut_off.ravel())
        sheet.timed("scene/robots", cut_off.partition([num_robots] * num_windows))
    if log.has_motion:
        speed = np.linalg.norm(log.velocity_mps, axis=2, keepdims=True)
        way = HEADING_SHARE * sheet.frame.reach_m * log.velocity_mps / np.maximum(speed, 1e-9)
        start, end = (_lifted(at, height_m) for at in (log.position_m, log.position_m + way))
        style = rr.LineStrips3D.from_fields(colors=[palette.HEADING], radii=screen(0.8))
        sheet.fixed("scene/heading", style)
        strips = rr.LineStrips3D.columns(strips=np.stack([start, end], axis=1))
        sheet.timed("scene/heading", strips.partition([num_robots] * num_windows))


def _draw_packets(sheet: Sheet, packets: dict[str, Links]) -> None:
    """Packets as arcs, those that were lost as arcs that end on their way."""
    base_m = ROBOT_HEIGHT * RADIUS_SHARE * sheet.frame.reach_m
    for fate, (colour, _) in LOOKS.items():
        if fate in packets:
            path, links = f"scene/packets/{fate}", packets[fate]
            style = rr.LineStrips3D.from_fields(colors=[colour], radii=screen(1.0))
            sheet.fixed(path, style)
            points = arcs(*ends_of(fate, links, sheet.log.position_m), base_m)
            strips = rr.LineStrips3D.columns(strips=points.astype(np.float32))
            sheet.timed(path, strips.partition(links.per_window))


def _lifted(at_m: np.ndarray, height_m: float) -> np.ndarray:
    """Points on the ground, so high above it."""
    flat = at_m.reshape(-1, 2).astype(np.float32)
    return np.pad(flat, ((0, 0), (0, 1)), constant_values=np.float32(height_m))
