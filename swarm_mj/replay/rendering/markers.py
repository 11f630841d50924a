"""Robots and packets, drawn into a scene beside what MuJoCo's model holds."""

import itertools

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtGeom
from mujoco._functions import mjv_connector, mjv_initGeom
from mujoco._structs import MjvGeom, MjvScene

from swarm_mj.replay import palette
from swarm_mj.replay.packets import SEGMENTS, arcs
from swarm_mj.replay.rendering.camera import Camera
from swarm_mj.replay.rendering.contents import Contents

# Sizes on the picture, of its height, whatever the size of the area.
ROBOT, OBSERVER, HEADING, LINE = 0.0085, 0.0115, 0.022, 0.0025
SMALLEST = 520  # [pixels] in height: robots are not drawn smaller than on such a picture
ROBOT_HEIGHT = 0.6  # of a marker, by its radius
NO_TURN = np.eye(3).ravel()
HALO, HALO_HEIGHT = 1.7, 0.15  # of a robot that is cut off, by the robot's
STROKES_PER_ROBOT = 40  # lines of links that surprise; of very dense teams, some are left out
# A disc, a heading, a halo, arcs of all that a window can have, and lines.
GEOMS_PER_ROBOT = 3 + 4 * SEGMENTS + STROKES_PER_ROBOT


class Markers:
    """Draws robots as discs with their heading, and packets as arcs."""

    def __init__(self, scene: MjvScene, height: int) -> None:
        """Take the scene, with room for `GEOMS_PER_ROBOT`, and the picture's height [pixels]."""
        self._scene = scene
        self._enlarged = max(1.0, SMALLEST / height)
        self._line_pixels = self._enlarged * LINE * height

    def draw(self, contents: Contents, camera: Camera) -> None:
        """Add what is there, in sizes that this camera's picture asks for."""
        picture_m = self._enlarged * camera.pixel_m * camera.height
        self._draw_robots(contents, picture_m)
        self._draw_links(contents, picture_m)
        self._draw_strokes(contents, picture_m)

    def _draw_robots(self, contents: Contents, picture_m: float) -> None:
        """A disc for each robot, as large on the picture whatever the area; and its heading."""
        speed = np.linalg.norm(contents.velocity_mps, axis=1, keepdims=True)
        way_m = HEADING * picture_m * contents.velocity_mps / np.maximum(speed, 1e-9)
        for i, (where, way) in enumerate(zip(contents.position_m, way_m, strict=True)):
            radius_m = (OBSERVER if i == contents.observer else ROBOT) * picture_m
            height_m = ROBOT_HEIGHT * radius_m
            self._add_disc(np.append(where, height_m), radius_m, radius_m, contents.colour[i])
            if contents.is_cut_off[i]:
                flat_m = HALO_HEIGHT * radius_m
                colour = np.array(palette.CUT_OFF)
                self._add_disc(np.append(where, flat_m), HALO * radius_m, flat_m, colour)
            if np.any(way):
                ends = np.append(where, height_m), np.append(where + way, height_m)
                self._add_line(*ends, np.array(palette.HEADING))

    def _draw_links(self, contents: Contents, picture_m: float) -> None:
        """Packets as arcs."""
        lifted = arcs(contents.start_m, contents.end_m, ROBOT * picture_m)
        for points, colour in zip(lifted, contents.packet_colour, strict=True):
            for start, end in itertools.pairwise(points):
                self._add_line(start, end, colour)

    def _draw_strokes(self, contents: Contents, picture_m: float) -> None:
        """Links that surprise as straight lines, as many as there is room for."""
        room = self._scene.maxgeom - self._scene.ngeom
        height_m = ROBOT_HEIGHT * ROBOT * picture_m
        lifted = np.pad(contents.lines_m, ((0, 0), (0, 0), (0, 1)), constant_values=height_m)
        for (start, end), colour in zip(lifted[:room], contents.line_colour[:room], strict=True):
            self._add_line(start, end, colour)

    def _add_disc(
        self, where: Float[np.ndarray, "3"], radius_m: float, half_m: float, colour: np.ndarray
    ) -> None:
        """Return a disc that reaches so far above and below its middle."""
        size = np.array([radius_m, half_m, 0.0])
        kind = mjtGeom.mjGEOM_CYLINDER.value
        mjv_initGeom(self._next_geom(), kind, size, where, NO_TURN, _rgba(colour))

    def _add_line(self, start: np.ndarray, end: np.ndarray, colour: np.ndarray) -> None:
        geom, kind = self._next_geom(), mjtGeom.mjGEOM_LINE.value
        mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), NO_TURN, _rgba(colour))
        mjv_connector(geom, kind, self._line_pixels, start, end)

    def _next_geom(self) -> MjvGeom:
        """Return a geom more in the scene."""
        self._scene.ngeom += 1
        return self._scene.geoms[self._scene.ngeom - 1]


def _rgba(colour: np.ndarray) -> Float[np.ndarray, "4"]:
    return np.append(colour / 255.0, 1.0).astype(np.float32)
