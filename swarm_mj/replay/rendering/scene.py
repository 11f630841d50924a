"""Pictures of a mission's scene: MuJoCo draws floor, walls and robots, and packets between them."""

import atexit
from contextlib import ExitStack
from weakref import ref

import numpy as np
from jaxtyping import UInt8
from mujoco._enums import mjtCamera, mjtCatBit, mjtFontScale, mjtFramebuffer, mjtObj
from mujoco._errors import FatalError
from mujoco._functions import (
    mj_camlight,
    mj_comPos,
    mj_kinematics,
    mj_name2id,
    mjv_updateScene,
)
from mujoco._render import MjrContext, mjr_readPixels, mjr_render, mjr_setBuffer
from mujoco._specs import MjSpec
from mujoco._structs import MjData, MjModel, MjrRect, MjvCamera, MjvOption, MjvScene

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import Scene, compose
from swarm_mj.physics.solid_geoms import obstacle_geoms
from swarm_mj.replay.rendering.camera import ELEVATION_DEG, FOV_Y_DEG, Camera, look_at
from swarm_mj.replay.rendering.contents import Contents
from swarm_mj.replay.rendering.markers import GEOMS_PER_ROBOT, Markers
from swarm_mj.replay.rendering.opengl import make_context, unusable

MAX_PIXELS = 4096  # of a picture's side
BEACONS = 2  # the group of the robots' own markers, assets/robot.xml: too small from afar
TILE_M = 200.0  # the floor's texture, two squares by two, assets/arena.xml
GROUND = 10.0  # an open floor's side, by the area's: a team that flies apart has left the area
# What faces up has its own colour exactly, what stands upright half of it.
AMBIENT, SUN = 0.5, 0.5
WALL_OPACITY, OBSTACLE_OPACITY = 0.3, 0.35  # what stands in front hides no robot
SLICES, STACKS = 14, 5  # of round things


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
        self._mission = mission
        spec = compose(mission, scene=scene)
        prepare(spec, mission)
        self._model = spec.compile()
        self._data = MjData(self._model)
        self._floor = mj_name2id(self._model, mjtObj.mjOBJ_GEOM.value, "floor")
        light(self._model, width, height)
        num_geoms = self._model.ngeom + mission.num_robots * GEOMS_PER_ROBOT
        self._scene = MjvScene(self._model, num_geoms)
        self._markers = Markers(self._scene, height)
        self._options = MjvOption()
        self._options.geomgroup[BEACONS] = 0
        with ExitStack() as stack:
            self._opengl = make_context(width, height)
            stack.callback(self._opengl.free)
            self._context = self._start()
            stack.pop_all()
        self._is_open = True
        atexit.register(_close, ref(self))  # before the back end ends, which registered earlier

    def _start(self) -> MjrContext:
        """MuJoCo's own part of OpenGL."""
        self._opengl.make_current()
        try:
            context = MjrContext(self._model, mjtFontScale.mjFONTSCALE_100.value)
        except FatalError as error:  # GLFW without a screen says nothing before
            raise unusable(error) from error
        mjr_setBuffer(mjtFramebuffer.mjFB_OFFSCREEN.value, context)
        return context

    def camera(self, contents: Contents) -> Camera:
        """Return the camera by which a picture of these contents is seen."""
        return look_at(contents.centre_m, contents.reach_m, self._width, self._height)

    def frame(self, contents: Contents) -> UInt8[np.ndarray, "H W 3"]:
        """Return the picture of these contents, RGB, its first row on top.

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
        free = MjvCamera()
        aim(free, camera)
        mjv_updateScene(
            self._model,
            self._data,
            self._options,
            None,
            free,
            mjtCatBit.mjCAT_ALL.value,
            self._scene,
        )
        self._markers.draw(contents, camera)
        return self._pixels()

    def close(self) -> None:
        """Give OpenGL's memory back; nothing can be drawn any more."""
        if not self._is_open:
            return
        self._is_open = False
        self._opengl.make_current()
        self._context.free()
        self._opengl.free()

    def __enter__(self) -> "SceneRenderer":
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _place(self, contents: Contents) -> None:
        """Put the robots' bodies, and an open area's floor, where they are seen."""
        self._data.qpos[:] = contents.position_m.ravel()
        mj_kinematics(self._model, self._data)
        mj_comPos(self._model, self._data)
        mj_camlight(self._model, self._data)
        if not self._mission.has_walls and self._floor >= 0:
            whole_tiles_m = np.round(contents.centre_m / TILE_M) * TILE_M
            self._data.geom_xpos[self._floor, :2] = whole_tiles_m

    def _pixels(self) -> UInt8[np.ndarray, "H W 3"]:
        picture = np.empty((self._height, self._width, 3), dtype=np.uint8)
        whole = MjrRect(0, 0, self._width, self._height)
        self._opengl.make_current()  # there may be other renderers
        mjr_render(whole, self._scene, self._context)
        mjr_readPixels(picture, None, whole, self._context)
        return picture[::-1].copy()


def _close(renderer: "ref[SceneRenderer]") -> None:
    """Close a renderer that is still there when Python ends: by then, OpenGL would fail."""
    if (left := renderer()) is not None:
        left.close()


def light(model: MjModel, width: int, height: int) -> None:
    """Light from above, obstacles of glass, and the size of the pictures."""
    visual = model.vis
    visual.global_.offwidth, visual.global_.offheight = width, height
    visual.global_.fovy = FOV_Y_DEG
    visual.quality.numslices, visual.quality.numstacks = SLICES, STACKS
    visual.headlight.ambient[:], visual.headlight.diffuse[:] = AMBIENT, 0.0
    model.light_diffuse[:], model.light_ambient[:] = SUN, 0.0
    model.light_dir[:] = (0.0, 0.0, -1.0)
    for g in obstacle_geoms(model):
        material = model.geom_matid[g]
        colour = model.geom_rgba[g] if material < 0 else model.mat_rgba[material]
        colour[3] = min(colour[3], OBSTACLE_OPACITY)


def prepare(spec: MjSpec, mission: Mission) -> None:
    """Make walls translucent, and an open area's floor as wide as a camera sees.

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


def aim(free: MjvCamera, camera: Camera) -> None:
    """Lets a camera of MuJoCo's see what this one does."""
    free.type = mjtCamera.mjCAMERA_FREE.value
    free.lookat[:] = (*camera.target_m, 0.0)
    free.distance, free.azimuth, free.elevation = camera.distance_m, 90.0, -ELEVATION_DEG
