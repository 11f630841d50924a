"""Robots and packets, drawn into a scene next to the geoms of MuJoCo's model; and two cameras.

One looks down on the ground that is shown, north up. The other flies behind and above one robot.
"""

import itertools
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float
from mujoco._enums import mjtCamera, mjtGeom  # private: type checkers see it only there
from mujoco._functions import mjv_connector, mjv_initGeom
from mujoco._structs import MjvCamera, MjvGeom, MjvScene

from swarm_mj.physics.state import ROBOT_HEIGHT_M, ROBOT_RADIUS_M
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage, Ground
from swarm_mj.replay.links import RISE, SEGMENTS, arcs, lifted
from swarm_mj.replay.rendering.theme import DARK, Theme

Shade: TypeAlias = np.ndarray | palette.Colour

# The camera above the ground, by the picture's height over its width: flat in wide pictures and
# steep in high ones, so that the square fills them. 90 would look straight down.
SHAPES = (0.5, 1.0)
ELEVATIONS_DEG = (45.0, 68.0)
NORTH_DEG = 90.0  # up in the map's pictures
FOV_Y_DEG = 32.0  # a long lens: what is near is hardly larger than what is far
SHIFTS = (0.21, -0.05)  # of what it looks at, from the square's centre south, by half the side
MARGIN = 0.94  # of the picture, for the square

# Sizes on the picture, of its height, whatever the size of the area.
ROBOT = 0.0085  # a radius
OBSERVER = 0.0115  # likewise
HEADING = 0.022  # a length
LINE = 0.0025  # a width
SMALLEST = 520  # [pixels] in height: robots are not drawn smaller than on such a picture
ROBOT_HEIGHT = 0.6  # of a marker, by its radius
DISC = mjtGeom.mjGEOM_CYLINDER
BALL = mjtGeom.mjGEOM_SPHERE
NO_TURN = np.eye(3).ravel()
NOWHERE = np.zeros(3)
HALO_HEIGHT = 0.15  # around a robot that is cut off, by its radius
TRAIL_S = 6.0  # that trails go back
TRAIL_PIECES = 12
TRAIL_SHARE = 0.55  # of a robot's colour in its trail
RIM = 1.25  # the radius of a robot's rim, by the robot's
RIM_HEIGHT = 0.2  # likewise: below the robot's top
LINES_PER_ROBOT = 40  # mismatched links; of very dense teams, some are left out
STEM_SHARE = 0.35  # of the ground's opposite, in the line from a robot down to the floor
# The camera that follows a robot.
CHASE_M = 3.2  # behind one with a body
CHASE_POINT_M = 8.0  # behind a point, which is drawn as a ball of 1 m
CHASE_DEG = 9.0  # above it
CHASE_UP = 0.14  # of that distance: it looks above the robot, which leaves the view ahead free
CHASE_FOV_Y_DEG = 52.0  # a short lens, which sees the team around
CHASE_S = 2.0  # before and after: over which its course is the mean
# It looks along the course of these seconds; these count beside it, as that many metres of it do.
WAY_M = 0.1
TEAM_M = 0.01
NORTH_M = 1e-6
CHASE_RISE = 0.05  # of packets' arcs: higher ones would leave the view
CHASE_NEAR_M = 0.2  # nearer things are not drawn
COVER = 1.05  # the least radius of a point's ball, by that of the white ball that MuJoCo has of it
MARKER_M = 2.0  # from the camera: nearer ones are drawn as if there
# A disc with its rim, a heading, a halo, a trail, arcs of all that a window can have, and lines.
GEOMS_PER_ROBOT = 4 + TRAIL_PIECES + 4 * SEGMENTS + LINES_PER_ROBOT


class Camera(NamedTuple):
    """A perspective camera; its picture has square pixels."""

    target_m: Float[np.ndarray, "3"]  # the point that is in the middle [m]
    distance_m: float  # from there [m]
    width: int  # [pixels]
    height: int
    elevation_deg: float  # at which it looks down
    azimuth_deg: float = NORTH_DEG  # in which it looks, from the east towards the north
    fov_y_deg: float = FOV_Y_DEG  # that it sees from top to bottom
    chased: int | None = None  # the robot that it follows; None: it shows the map

    @property
    def slope(self) -> float:
        """Half the picture's height, by the distance."""
        return float(np.tan(np.deg2rad(self.fov_y_deg / 2.0)))

    @property
    def pixel_m(self) -> float:
        """The ground that a pixel in the middle of the picture shows, across [m]."""
        return 2.0 * self.distance_m * self.slope / self.height

    def heights_m(self, point_m: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "K"]:
        """Return how high the picture is, of which markers at points are a share [m].

        The map's are as large whatever their distance, as on a map; others as large on the picture.
        """
        least = max(self.height, SMALLEST) / self.height
        if self.chased is None:
            return np.full(len(point_m), least * self.height * self.pixel_m)
        _, _, ahead = self.axes(point_m - self.target_m)
        return 2.0 * least * self.slope * np.maximum(self.distance_m + ahead, MARKER_M)

    def pixels(self, point_m: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "K 2"]:
        """Return points' places in the picture: right and down from its upper left corner."""
        across, up, ahead = self.axes(point_m - self.target_m)
        scale = self.height / (2.0 * self.slope * (self.distance_m + ahead))
        return np.stack([self.width / 2 + across * scale, self.height / 2 - up * scale], axis=1)

    def axes(self, point_m: Float[np.ndarray, "K 3"]) -> Float[np.ndarray, "3 K"]:
        """Return points along the picture's axes from the target: right, up and ahead [m]."""
        east, north, z = point_m.T
        turn = np.deg2rad(self.azimuth_deg - NORTH_DEG)
        x = np.cos(turn) * east + np.sin(turn) * north
        y = np.cos(turn) * north - np.sin(turn) * east
        elevation = np.deg2rad(self.elevation_deg)
        sin = np.sin(elevation)
        cos = np.cos(elevation)
        return np.stack([x, sin * y + cos * z, cos * y - sin * z])

    def aim(self, free: MjvCamera) -> None:
        """Let a camera of MuJoCo's see the same."""
        free.type = mjtCamera.mjCAMERA_FREE.value
        free.lookat[:] = self.target_m
        free.distance = self.distance_m
        free.azimuth = self.azimuth_deg
        free.elevation = -self.elevation_deg


def look_at(ground: Ground, row: int, width: int, height: int) -> Camera:
    """Return the camera whose picture of this size [pixels] shows the ground in one window."""
    reach_m = ground.reach_m
    corners = reach_m * np.array([[x, y, 0.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)])
    # The near edge is seen under a wider angle than the far one: the target moves towards it.
    shift = float(np.interp(height / width, SHAPES, SHIFTS))
    south_m = np.array([0.0, shift * reach_m, 0.0])
    target_m = np.append(ground.centre_m[row], 0.0) - south_m
    elevation_deg = float(np.interp(height / width, SHAPES, ELEVATIONS_DEG))
    camera = Camera(target_m, 0.0, width, height, elevation_deg)
    across, up, ahead = camera.axes(corners + south_m)
    needed = (
        np.maximum(np.abs(across) * height / width, np.abs(up)) / (MARGIN * camera.slope) - ahead
    )
    return camera._replace(distance_m=float(np.max(needed)))


def chase(footage: Footage, moment: float, width: int, height: int) -> Camera:
    """Return the camera behind and above the observer, at a moment in windows from 0.

    It looks where the robot flies, on the mean over some seconds before and after: a robot that
    turns at once lets it swing round.
    """
    robot = footage.ego
    row = round(moment)
    place_m = footage.moved_to(moment).place_m(row)
    reach = CHASE_S / footage.facts.mission.window_s
    last = len(footage.window) - 1
    course_m = np.zeros(2)
    for sign in (-1.0, 1.0):
        other = min(max(0.0, moment + sign * reach), float(last))
        course_m += sign * footage.moved_to(other).position_m[round(other), robot]
    # Of less and less weight: where a robot that hardly moves goes, where the team of one at rest
    # is, and north of one that is alone.
    course_m += WAY_M * _unit(footage.velocity_mps[row, robot])
    course_m += TEAM_M * _unit(np.mean(place_m[:, :2], axis=0) - place_m[robot, :2])
    course_m += (0.0, NORTH_M)
    distance_m = CHASE_POINT_M if footage.height_m is None else CHASE_M
    target_m = place_m[robot] + (0.0, 0.0, CHASE_UP * distance_m)
    return Camera(
        target_m=target_m,
        distance_m=distance_m,
        width=width,
        height=height,
        elevation_deg=CHASE_DEG,
        azimuth_deg=float(np.rad2deg(np.arctan2(course_m[1], course_m[0]))),
        fov_y_deg=CHASE_FOV_Y_DEG,
        chased=robot,
    )


def _unit(vector: Float[np.ndarray, "2"]) -> Float[np.ndarray, "2"]:
    """Return a vector at length 1, or 0 if it has none."""
    length = float(np.linalg.norm(vector))
    return vector / length if length > 0.0 else vector


def draw_markers(
    scene: MjvScene, footage: Footage, row: int, camera: Camera, theme: Theme = DARK
) -> None:
    """Add one window's robots, packets and links to a scene with `GEOMS_PER_ROBOT` to spare."""
    picture_m = max(camera.height, SMALLEST) * camera.pixel_m
    line_pixels = LINE * max(camera.height, SMALLEST)
    _draw_trails(scene, footage, row, line_pixels, theme)
    above_m = ROBOT * picture_m
    rise = RISE
    if camera.chased is None:
        _draw_robots(scene, footage, row, picture_m, line_pixels, theme)
    else:
        above_m = ROBOT_HEIGHT_M if footage.height_m is None else 0.0
        rise = CHASE_RISE
        _draw_balls(scene, footage, row, camera, line_pixels, theme)
    for fate, packets in footage.packets_at(row).items():
        style = palette.PACKETS[fate]
        for points in arcs(packets, above_m, style.share, rise):
            for start, end in itertools.pairwise(points):
                _add_line(scene, start, end, theme.shown(style.colour), line_pixels)
    # Last, for of very dense teams there is no room for all; robots and packets go first.
    room = scene.maxgeom - scene.ngeom
    lines_m, colours = footage.mismatch_lines(row, ROBOT_HEIGHT * above_m)
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
    up_m = np.broadcast_to(footage.above(0.0), footage.is_on.shape)[rows]
    for i, colour in enumerate(footage.colours[row].tolist()):
        faint = theme.mixed(theme.ego if i == footage.ego else tuple(colour), TRAIL_SHARE)
        points_m = lifted(way_m[:, i], up_m[:, i])
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
    up_m = footage.heights_m(row)
    for i, (where, way) in enumerate(zip(footage.position_m[row], way_m, strict=True)):
        radius_m = (OBSERVER if i == footage.ego else ROBOT) * picture_m
        height_m = up_m[i] + ROBOT_HEIGHT * radius_m
        size_m = np.array([radius_m, radius_m, 0.0])
        colour = theme.ego if i == footage.ego else colours[i]
        if theme.rim is not None:
            flat_m = RIM_HEIGHT * radius_m
            rim_m = np.array([RIM * radius_m, flat_m, 0.0])
            _add(scene, DISC, theme.rim, rim_m, np.append(where, up_m[i] + flat_m))
        _add(scene, DISC, colour, size_m, np.append(where, height_m))
        if footage.is_cut_off[row, i]:
            flat_m = HALO_HEIGHT * radius_m
            wide_m = palette.HALO * radius_m
            size_m = np.array([wide_m, flat_m, 0.0])
            _add(scene, DISC, palette.CUT_OFF, size_m, np.append(where, up_m[i] + flat_m))
        if np.any(way):
            start = np.append(where, height_m)
            end = np.append(where + way, height_m)
            _add_line(scene, start, end, theme.heading, line_pixels)


def _draw_balls(
    scene: MjvScene,
    footage: Footage,
    row: int,
    camera: Camera,
    line_pixels: float,
    theme: Theme,
) -> None:
    """Draw robots from nearby: balls where they are, and stems down to the floor.

    The one that the camera follows has no ball, but its own body.
    """
    place_m = footage.place_m(row)
    height_m = camera.heights_m(place_m)
    least_m = COVER * ROBOT_RADIUS_M if footage.height_m is None else 0.0
    velocity_mps = footage.velocity_mps[row]
    speed = np.linalg.norm(velocity_mps, axis=1, keepdims=True)
    way_m = HEADING * height_m[:, None] * velocity_mps / np.maximum(speed, 1e-9)
    for i, where in enumerate(place_m):
        colour = theme.ego if i == footage.ego else tuple(footage.colours[row, i].tolist())
        stem = theme.mixed(colour, STEM_SHARE)
        _add_line(scene, where, where * (1.0, 1.0, 0.0), stem, line_pixels)
        if np.any(way_m[i]):
            end = where + np.append(way_m[i], 0.0)
            _add_line(scene, where, end, theme.heading, line_pixels)
        if i == camera.chased:
            continue
        radius_m = max(ROBOT * height_m[i], least_m)
        _add(scene, BALL, colour, np.full(3, radius_m), where)
        if footage.is_cut_off[row, i]:
            flat_m = HALO_HEIGHT * radius_m
            wide_m = palette.HALO * radius_m
            _add(scene, DISC, palette.CUT_OFF, np.array([wide_m, flat_m, 0.0]), where)


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
