"""Robots and packets, drawn into a scene beside what MuJoCo's model holds."""

import itertools

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtGeom
from mujoco._functions import mjv_connector, mjv_initGeom
from mujoco._structs import MjvGeom, MjvScene

from swarm_mj.rendering.camera import Camera
from swarm_mj.rendering.contents import Contents
from swarm_mj.replay import palette
from swarm_mj.replay.arcs import SEGMENTS, arcs

# Sizes on the picture, of its height, whatever the size of the area.
ROBOT, OBSERVER, HEADING, LINE = 0.0085, 0.0115, 0.022, 0.0025
SMALLEST = 520  # [pixels] in height: robots are not drawn smaller than on such a picture
ROBOT_HEIGHT = 0.6  # of a marker, by its radius
NO_TURN = np.eye(3).ravel()
GEOMS_PER_ROBOT = 2 + 4 * SEGMENTS  # a disc, a heading, and arcs of all that a window can have


class Markers:
    """Draws robots as discs with their heading, and packets as arcs."""

    def __init__(self, scene: MjvScene, height: int) -> None:
        """Takes the scene, with room for `GEOMS_PER_ROBOT`, and the picture's height [pixels]."""
        self._scene = scene
        self._enlarged = max(1.0, SMALLEST / height)
        self._line_pixels = self._enlarged * LINE * height

    def draw(self, contents: Contents, camera: Camera) -> None:
        """Adds what is there, in sizes that this camera's picture asks for."""
        picture_m = self._enlarged * camera.pixel_m * camera.height
        self._draw_robots(contents, picture_m)
        self._draw_links(contents, picture_m)

    def _draw_robots(self, contents: Contents, picture_m: float) -> None:
        """A disc for each robot, as large on the picture whatever the area; and its heading."""
        speed = np.linalg.norm(contents.velocity_mps, axis=1, keepdims=True)
        way_m = HEADING * picture_m * contents.velocity_mps / np.maximum(speed, 1e-9)
        for i, (where, way) in enumerate(zip(contents.position_m, way_m, strict=True)):
            radius_m = (OBSERVER if i == contents.observer else ROBOT) * picture_m
            height_m = ROBOT_HEIGHT * radius_m
            self._add_disc(np.append(where, height_m), radius_m, height_m, contents.colour[i])
            if np.any(way):
                ends = np.append(where, height_m), np.append(where + way, height_m)
                self._add_line(*ends, np.array(palette.HEADING))

    def _draw_links(self, contents: Contents, picture_m: float) -> None:
        """Packets as arcs."""
        lifted = arcs(contents.start_m, contents.end_m, ROBOT * picture_m)
        for points, colour in zip(lifted, contents.link_colour, strict=True):
            for start, end in itertools.pairwise(points):
                self._add_line(start, end, colour)

    def _add_disc(
        self, where: Float[np.ndarray, "3"], radius_m: float, height_m: float, colour: np.ndarray
    ) -> None:
        size = np.array([radius_m, radius_m, height_m])
        kind = mjtGeom.mjGEOM_CYLINDER.value
        mjv_initGeom(self._next_geom(), kind, size, where, NO_TURN, _rgba(colour))

    def _add_line(self, start: np.ndarray, end: np.ndarray, colour: np.ndarray) -> None:
        geom, kind = self._next_geom(), mjtGeom.mjGEOM_LINE.value
        mjv_initGeom(geom, kind, np.zeros(3), np.zeros(3), NO_TURN, _rgba(colour))
        mjv_connector(geom, kind, self._line_pixels, start, end)

    def _next_geom(self) -> MjvGeom:
        """A geom more in the scene."""
        self._scene.ngeom += 1
        return self._scene.geoms[self._scene.ngeom - 1]


def _rgba(colour: np.ndarray) -> Float[np.ndarray, "4"]:
    return np.append(colour / 255.0, 1.0).astype(np.float32)
