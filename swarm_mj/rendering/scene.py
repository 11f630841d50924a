"""Pictures of a mission's scene: MuJoCo draws floor, walls and robots, and packets between them."""

import itertools

import numpy as np
from jaxtyping import Float, UInt8
from mujoco._enums import mjtCamera, mjtCatBit, mjtFontScale, mjtFramebuffer, mjtGeom, mjtObj
from mujoco._functions import (
    mj_camlight,
    mj_comPos,
    mj_kinematics,
    mj_name2id,
    mjv_connector,
    mjv_initGeom,
    mjv_updateScene,
)
from mujoco._render import MjrContext, mjr_readPixels, mjr_render, mjr_setBuffer
from mujoco._specs import MjSpec
from mujoco._structs import MjData, MjModel, MjrRect, MjvCamera, MjvGeom, MjvOption, MjvScene

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import Scene, compose
from swarm_mj.rendering.camera import ELEVATION_DEG, FOV_Y_DEG, Camera, look_at
from swarm_mj.rendering.contents import Contents
from swarm_mj.rendering.opengl import make_context
from swarm_mj.replay import palette
from swarm_mj.replay.arcs import SEGMENTS, arcs

MAX_PIXELS = 4096  # of a picture's side
BEACONS = 2  # the group of the robots' own markers, assets/robot.xml: too small from afar
TILE_M = 200.0  # the floor's texture, two squares by two, assets/arena.xml
GROUND = 10.0  # an open floor's side, by the area's: a team that flies apart has left the area
# What faces up has its own colour exactly, what stands upright half of it.
AMBIENT, SUN = 0.5, 0.5
WALL_OPACITY = 0.3  # a wall in front hides no robot
# Sizes on the picture, of its height, whatever the size of the area.
ROBOT, OBSERVER, HEADING, LINE = 0.0085, 0.0115, 0.022, 0.0025
SMALLEST = 520  # [pixels] in height: robots are not drawn smaller than on such a picture
ROBOT_HEIGHT = 0.6  # of a marker, by its radius
SLICES, STACKS = 14, 5  # of round things
NO_TURN = np.eye(3).ravel()


class SceneRenderer:
    """Draws pictures of one mission's scene, all of one size."""

    def __init__(
        self, mission: Mission, width: int = 1280, height: int = 720, *, scene: Scene | None = None
    ) -> None:
        """Compiles the scene and starts OpenGL.

        Args:
            mission: Whose scene it is.
            width: Of the pictures [pixels].
            height: Of the pictures [pixels].
            scene: What changes the arena, if anything does: `swarm.scene`.

        Raises:
            ValueError: The size is outside its range.
            OSError: No OpenGL works here; it says what to install.
        """
        for what, pixels in (("width", width), ("height", height)):
            if not 16 <= pixels <= MAX_PIXELS:
                raise ValueError(f"{what} must be from 16 to {MAX_PIXELS} pixels, not {pixels}")
        self._width, self._height = width, height
        self._enlarged = max(1.0, SMALLEST / height)
        self._mission = mission
        spec = compose(mission, scene=scene)
        _prepare(spec, mission)
        self._model = spec.compile()
        self._data = MjData(self._model)
        self._floor = mj_name2id(self._model, mjtObj.mjOBJ_GEOM.value, "floor")
        _light(self._model, width, height)
        num_geoms = self._model.ngeom + mission.num_robots * (2 + 4 * SEGMENTS)
        self._scene = MjvScene(self._model, num_geoms)
        self._options = MjvOption()
        self._options.geomgroup[BEACONS] = 0
        self._opengl = make_context(width, height)
        self._opengl.make_current()
        self._context = MjrContext(self._model, mjtFontScale.mjFONTSCALE_100.value)
        mjr_setBuffer(mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)

    def camera(self, contents: Contents) -> Camera:
        """The camera by which a picture of these contents is seen."""
        return look_at(contents.centre_m, contents.reach_m, self._width, self._height)

    def frame(self, contents: Contents) -> UInt8[np.ndarray, "H W 3"]:
        """The picture of these contents, RGB, its first row on top.

        Raises:
            ValueError: There is not one position per robot of the mission.
        """
        if len(contents.position_m) != self._mission.num_robots:
            raise ValueError(
                f"contents must have {self._mission.num_robots} robots, "
                f"not {len(contents.position_m)}"
            )
        camera = self.camera(contents)
        self._place(contents)
        mjv_updateScene(
            self._model,
            self._data,
            self._options,
            None,
            _free_camera(camera),
            mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        self._draw_robots(contents, camera)
        self._draw_links(contents, camera)
        return self._pixels()

    def close(self) -> None:
        """Gives OpenGL's memory back; nothing can be drawn any more."""
        self._opengl.make_current()
        self._context.free()
        self._opengl.free()

    def __enter__(self) -> "SceneRenderer":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _place(self, contents: Contents) -> None:
        """Puts the robots' bodies, and an open area's floor, where they are seen."""
        self._data.qpos[:] = contents.position_m.ravel()
        mj_kinematics(self._model, self._data)
        mj_comPos(self._model, self._data)
        mj_camlight(self._model, self._data)
        if not self._mission.has_walls and self._floor >= 0:
            whole_tiles_m = np.round(contents.centre_m / TILE_M) * TILE_M
            self._data.geom_xpos[self._floor, :2] = whole_tiles_m

    def _draw_robots(self, contents: Contents, camera: Camera) -> None:
        """A disc for each robot, as large on the picture whatever the area; and its heading."""
        picture_m = self._enlarged * camera.pixel_m * camera.height
        speed = np.linalg.norm(contents.velocity_mps, axis=1, keepdims=True)
        way_m = HEADING * picture_m * contents.velocity_mps / np.maximum(speed, 1e-9)
        for i, (where, way) in enumerate(zip(contents.position_m, way_m, strict=True)):
            radius_m = (OBSERVER if i == contents.observer else ROBOT) * picture_m
            height_m = ROBOT_HEIGHT * radius_m
            self._add_disc(np.append(where, height_m), radius_m, height_m, contents.colour[i])
            if np.any(way):
                ends = np.append(where, height_m), np.append(where + way, height_m)
                self._add_line(*ends, np.array(palette.HEADING))

    def _draw_links(self, contents: Contents, camera: Camera) -> None:
        """Packets as arcs."""
        base_m = self._enlarged * ROBOT * camera.pixel_m * camera.height
        for points, colour in zip(
            arcs(contents.start_m, contents.end_m, base_m), contents.link_colour, strict=True
        ):
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
        mjv_connector(geom, kind, self._enlarged * LINE * self._height, start, end)

    def _next_geom(self) -> MjvGeom:
        """A geom more in the scene; there is room for all that a window can have."""
        self._scene.ngeom += 1
        return self._scene.geoms[self._scene.ngeom - 1]

    def _pixels(self) -> UInt8[np.ndarray, "H W 3"]:
        picture = np.empty((self._height, self._width, 3), dtype=np.uint8)
        whole = MjrRect(0, 0, self._width, self._height)
        self._opengl.make_current()  # there may be other renderers
        mjr_render(whole, self._scene, self._context)
        mjr_readPixels(picture, None, whole, self._context)
        return picture[::-1].copy()


def _light(model: MjModel, width: int, height: int) -> None:
    """Light from above, and the size of the pictures."""
    visual = model.vis
    visual.global_.offwidth, visual.global_.offheight = width, height
    visual.global_.fovy = FOV_Y_DEG
    visual.quality.numslices, visual.quality.numstacks = SLICES, STACKS
    visual.headlight.ambient[:], visual.headlight.diffuse[:] = AMBIENT, 0.0
    model.light_diffuse[:], model.light_ambient[:] = SUN, 0.0
    model.light_dir[:] = (0.0, 0.0, -1.0)


def _prepare(spec: MjSpec, mission: Mission) -> None:
    """Makes walls translucent, and an open area's floor as wide as a camera sees.

    A scene of one's own may have neither.
    """
    half_m = float(np.ceil(GROUND * mission.half_side_m / TILE_M) * TILE_M)
    for material in spec.materials:
        if material.name == "wall":
            material.rgba[3] = WALL_OPACITY
        elif material.name == "floor" and not mission.has_walls:
            material.texrepeat = [2.0 * half_m / TILE_M] * 2
    for geom in spec.geoms:
        if geom.name == "floor" and not mission.has_walls:
            geom.size = [half_m, half_m, half_m / 10.0]  # drawn in 20 by 20 pieces


def _free_camera(camera: Camera) -> MjvCamera:
    free = MjvCamera()
    free.type = mjtCamera.mjCAMERA_FREE.value
    free.lookat[:] = (*camera.target_m, 0.0)
    free.distance, free.azimuth, free.elevation = camera.distance_m, 90.0, -ELEVATION_DEG
    return free


def _rgba(colour: np.ndarray) -> Float[np.ndarray, "4"]:
    return np.append(colour / 255.0, 1.0).astype(np.float32)
