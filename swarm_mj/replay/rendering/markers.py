"""Robots and packets, drawn into a scene next to the geoms of MuJoCo's model; and the camera."""

import itertools
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtCamera, mjtGeom  # private: type checkers see it only there
from mujoco._functions import mjv_connector, mjv_initGeom
from mujoco._structs import MjvCamera, MjvGeom, MjvScene

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage, Ground
from swarm_mj.replay.links import SEGMENTS, arcs, lifted
from swarm_mj.replay.rendering.theme import DARK, Theme

Shade: TypeAlias = np.ndarray | palette.Colour

# The camera above the ground, by the picture's height over its width: flat in wide pictures and
# steep in high ones, so that the square fills them. 90 would look straight down.
SHAPES = (0.5, 1.0)
ELEVATIONS_DEG = (45.0, 68.0)
FOV_Y_DEG = 32.0  # a long lens: what is near is hardly larger than what is far
SHIFTS = (0.21, -0.05)  # of what it looks at, from the square's centre south, by half the side
MARGIN = 0.94  # of the picture, for the square
TAN = float(np.tan(np.deg2rad(FOV_Y_DEG / 2.0)))

# Sizes on the picture, of its height, whatever the size of the area.
ROBOT = 0.0085  # a radius
OBSERVER = 0.0115  # likewise
HEADING = 0.022  # a length
LINE = 0.0025  # a width
SMALLEST = 520  # [pixels] in height: robots are not drawn smaller than on such a picture
ROBOT_HEIGHT = 0.6  # of a marker, by its radius
DISC = mjtGeom.mjGEOM_CYLINDER
NO_TURN = np.eye(3).ravel()
NOWHERE = np.zeros(3)
HALO_HEIGHT = 0.15  # around a robot that is cut off, by its radius
TRAIL_S = 6.0  # that trails go back
TRAIL_PIECES = 12
TRAIL_SHARE = 0.55  # of a robot's colour in its trail
RIM = 1.25  # the radius of a robot's rim, by the robot's
RIM_HEIGHT = 0.2  # likewise: below the robot's top
LINES_PER_ROBOT = 40  # mismatched links; of very dense teams, some are left out
# A disc with its rim, a heading, a halo, a trail, arcs of all that a window can have, and lines.
GEOMS_PER_ROBOT = 4 + TRAIL_PIECES + 4 * SEGMENTS + LINES_PER_ROBOT


class Camera(NamedTuple):
    """A perspective camera, north up; its picture has square pixels."""

    target_m: Float[np.ndarray, "2"]  # the point on the ground that is in the middle [m]
    distance_m: float  # from there [m]
    width: int  # [pixels]
    height: int

    @property
    def elevation_deg(self) -> float:
        """The angle at which the camera looks down."""
        return float(np.interp(self.height / self.width, SHAPES, ELEVATIONS_DEG))

    @property
    def pixel_m(self) -> float:
        """The ground that a pixel in the middle of the picture shows, across [m]."""
        return 2.0 * self.distance_m * TAN / self.height

    def pixels(self, point_m: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "K 2"]:
        """Return points' places in the picture: right and down from its upper left corner."""
        across, up, ahead = self.axes(point_m - np.append(self.target_m, 0.0))
        scale = self.height / (2.0 * TAN * (self.distance_m + ahead))
        return np.stack([self.width / 2 + across * scale, self.height / 2 - up * scale], axis=1)

    def axes(self, point_m: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "3 K"]:
        """Return points along the picture's axes from the target: right, up and ahead [m]."""
        x, y, z = point_m.T
        elevation = np.deg2rad(self.elevation_deg)
        sin = np.sin(elevation)
        cos = np.cos(elevation)
        return np.stack([x, sin * y + cos * z, cos * y - sin * z])

    def aim(self, free: MjvCamera) -> None:
        """Let a camera of MuJoCo's see the same."""
        free.type = mjtCamera.mjCAMERA_FREE.value
        free.lookat[:] = (*self.target_m, 0.0)
        free.distance = self.distance_m
        free.azimuth = 90.0
        free.elevation = -self.elevation_deg


def look_at(ground: Ground, row: int, width: int, height: int) -> Camera:
    """Return the camera whose picture of this size [pixels] shows the ground in one window."""
    reach_m = ground.reach_m
    corners = reach_m * np.array([[x, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    # The near edge is seen under a wider angle than the far one: the target moves towards it.
    shift = float(np.interp(height / width, SHAPES, SHIFTS))
    south_m = np.array([0.0, shift * reach_m])
    camera = Camera(ground.centre_m[row] - south_m, 0.0, width, height)
    across, up, ahead = camera.axes(corners + np.append(south_m, 0.0))
    needed = np.maximum(np.abs(across) * height / width, np.abs(up)) / (MARGIN * TAN) - ahead
    return camera._replace(distance_m=float(np.max(needed)))


def draw_markers(
    scene: MjvScene, footage: Footage, row: int, camera: Camera, theme: Theme = DARK
) -> None:
    """Add one window's robots, packets and links to a scene with `GEOMS_PER_ROBOT` to spare."""
    picture_m = max(camera.height, SMALLEST) * camera.pixel_m
    line_pixels = LINE * max(camera.height, SMALLEST)
    _draw_trails(scene, footage, row, line_pixels, theme)
    _draw_robots(scene, footage, row, picture_m, line_pixels, theme)
    for fate, packets in footage.packets_at(row).items():
        style = palette.PACKETS[fate]
        for points in arcs(packets, ROBOT * picture_m, style.share):
            for start, end in itertools.pairwise(points):
                _add_line(scene, start, end, theme.shown(style.colour), line_pixels)
    # Last, for of very dense teams there is no room for all; robots and packets go first.
    room = scene.maxgeom - scene.ngeom
    lines_m, colours = footage.mismatch_lines(row)
    lines_m = lifted(lines_m, ROBOT_HEIGHT * ROBOT * picture_m)
    for (start, end), colour in zip(lines_m[:room], colours[:room], strict=True):
        _add_line(scene, start, end, colour, line_pixels)


def _draw_trails(
    scene: MjvScene, footage: Footage, row: int, line_pixels: float, theme: Theme
) -> None:
    """Draw where robots came from in the last seconds, in their colours over the ground's."""
    num_windows = round(TRAIL_S / footage.facts.mission.window_s)
    shown = np.linspace(max(0, row - num_windows), row, TRAIL_PIECES + 1)
    rows = np.unique(shown.round().astype(int))
    way_m = footage.position_m[rows]
    for i, colour in enumerate(footage.colours[row].tolist()):
        faint = theme.mixed(theme.ego if i == footage.ego else tuple(colour), TRAIL_SHARE)
        points_m = lifted(way_m[:, i], 0.0)
        for start, end in itertools.pairwise(points_m):
            if np.any(start != end):
                _add_line(scene, start, end, faint, line_pixels)


def _draw_robots(
    scene: MjvScene,
    footage: Footage,
    row: int,
    picture_m: float,
    line_pixels: float,
    theme: Theme,
) -> None:
    velocity_mps = footage.velocity_mps[row]
    colours = footage.colours[row]
    speed = np.linalg.norm(velocity_mps, axis=1, keepdims=True)
    way_m = HEADING * picture_m * velocity_mps / np.maximum(speed, 1e-9)
    for i, (where, way) in enumerate(zip(footage.position_m[row], way_m, strict=True)):
        radius_m = (OBSERVER if i == footage.ego else ROBOT) * picture_m
        up_m = 0.0 if footage.height_m is None else float(footage.height_m[row, i])
        height_m = up_m + ROBOT_HEIGHT * radius_m
        size_m = np.array([radius_m, radius_m, 0.0])
        colour = theme.ego if i == footage.ego else colours[i]
        if theme.rim is not None:
            flat_m = RIM_HEIGHT * radius_m
            rim_m = np.array([RIM * radius_m, flat_m, 0.0])
            _add(scene, DISC, theme.rim, rim_m, np.append(where, flat_m))
        _add(scene, DISC, colour, size_m, np.append(where, height_m))
        if footage.is_cut_off[row, i]:
            flat_m = HALO_HEIGHT * radius_m
            wide_m = palette.HALO * radius_m
            size_m = np.array([wide_m, flat_m, 0.0])
            _add(scene, DISC, palette.CUT_OFF, size_m, np.append(where, flat_m))
        if np.any(way):
            start = np.append(where, height_m)
            end = np.append(where + way, height_m)
            _add_line(scene, start, end, theme.heading, line_pixels)


def _add_line(
    scene: MjvScene, start: np.ndarray, end: np.ndarray, colour: Shade, pixels: float
) -> None:
    kind = mjtGeom.mjGEOM_LINE
    mjv_connector(_add(scene, kind, colour, NOWHERE, NOWHERE), kind.value, pixels, start, end)


def _add(
    scene: MjvScene, kind: mjtGeom, colour: Shade, size: np.ndarray, where: np.ndarray
) -> MjvGeom:
    scene.ngeom += 1
    geom = scene.geoms[scene.ngeom - 1]
    rgba = np.append(np.asarray(colour) / 255.0, 1.0)
    mjv_initGeom(geom, kind.value, size, where, NO_TURN, rgba.astype(np.float32))
    return geom
