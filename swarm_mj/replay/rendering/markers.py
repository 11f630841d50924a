"""Robots and packets, drawn into a scene next to the geoms of MuJoCo's model."""

import itertools

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtGeom
from mujoco._functions import mjv_connector, mjv_initGeom
from mujoco._structs import MjvGeom, MjvScene

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Contents
from swarm_mj.replay.packets import SEGMENTS, arcs
from swarm_mj.replay.rendering.camera import Camera

# Sizes on the picture, of its height, whatever the size of the area.
ROBOT, OBSERVER, HEADING, LINE = 0.0085, 0.0115, 0.022, 0.0025
SMALLEST = 520  # [pixels] in height: robots are not drawn smaller than on such a picture
ROBOT_HEIGHT = 0.6  # of a marker, by its radius
NO_TURN = np.eye(3).ravel()
HALO, HALO_HEIGHT = 1.7, 0.15  # of a robot that is cut off, by the robot's
LINES_PER_ROBOT = 40  # mismatched links; of very dense teams, some are left out
# A disc, a heading, a halo, arcs of all that a window can have, and lines.
GEOMS_PER_ROBOT = 3 + 4 * SEGMENTS + LINES_PER_ROBOT


def draw_markers(scene: MjvScene, contents: Contents, camera: Camera) -> None:
    """Add robots, packets and mismatched links to a scene with `GEOMS_PER_ROBOT` to spare."""
    enlarged = max(1.0, SMALLEST / camera.height)
    picture_m, line_pixels = enlarged * camera.pixel_m * camera.height, LINE * camera.height
    line_pixels *= enlarged
    _draw_robots(scene, contents, picture_m, line_pixels)
    lifted = arcs(contents.start_m, contents.end_m, ROBOT * picture_m)
    for points, colour in zip(lifted, contents.packet_colour, strict=True):
        for start, end in itertools.pairwise(points):
            _add_line(scene, start, end, colour, line_pixels)
    # Last, for of very dense teams there is no room for all; robots and packets go first.
    room = scene.maxgeom - scene.ngeom
    height_m = ROBOT_HEIGHT * ROBOT * picture_m
    lines_m = np.pad(contents.lines_m, ((0, 0), (0, 0), (0, 1)), constant_values=height_m)
    for (start, end), colour in zip(lines_m[:room], contents.line_colour[:room], strict=True):
        _add_line(scene, start, end, colour, line_pixels)


def _draw_robots(scene: MjvScene, contents: Contents, picture_m: float, line_pixels: float) -> None:
    """Draw a disc for each robot, as large on the picture whatever the area; and its heading."""
    speed = np.linalg.norm(contents.velocity_mps, axis=1, keepdims=True)
    way_m = HEADING * picture_m * contents.velocity_mps / np.maximum(speed, 1e-9)
    for i, (where, way) in enumerate(zip(contents.position_m, way_m, strict=True)):
        radius_m = (OBSERVER if i == contents.observer else ROBOT) * picture_m
        height_m = ROBOT_HEIGHT * radius_m
        _add_disc(scene, np.append(where, height_m), radius_m, radius_m, contents.colour[i])
        if contents.is_cut_off[i]:
            flat_m, colour = HALO_HEIGHT * radius_m, np.array(palette.CUT_OFF)
            _add_disc(scene, np.append(where, flat_m), HALO * radius_m, flat_m, colour)
        if np.any(way):
            start, end = np.append(where, height_m), np.append(where + way, height_m)
            _add_line(scene, start, end, np.array(palette.HEADING), line_pixels)


def _add_disc(
    scene: MjvScene, where: np.ndarray, radius_m: float, half_m: float, colour: np.ndarray
) -> None:
    size, kind = np.array([radius_m, half_m, 0.0]), mjtGeom.mjGEOM_CYLINDER.value
    mjv_initGeom(_next_geom(scene), kind, size, where, NO_TURN, _rgba(colour))


def _add_line(
    scene: MjvScene, start: np.ndarray, end: np.ndarray, colour: np.ndarray, pixels: float
) -> None:
    geom, kind = _next_geom(scene), mjtGeom.mjGEOM_LINE.value
    mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), NO_TURN, _rgba(colour))
    mjv_connector(geom, kind, pixels, start, end)


def _next_geom(scene: MjvScene) -> MjvGeom:
    scene.ngeom += 1
    return scene.geoms[scene.ngeom - 1]


def _rgba(colour: np.ndarray) -> Float[np.ndarray, "4"]:
    return np.append(colour / 255.0, 1.0).astype(np.float32)
