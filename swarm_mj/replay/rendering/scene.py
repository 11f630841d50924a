"""Pictures of a mission's scene, drawn by MuJoCo without a screen, and a window on it."""

import atexit
import threading
import warnings
from collections.abc import Sequence
from contextlib import ExitStack
from weakref import ref

import mujoco._functions as functions  # private: type checkers see it only there
import numpy as np
from jaxtyping import Float, UInt8
from mujoco._enums import mjtCamera, mjtCatBit, mjtFontScale, mjtFramebuffer, mjtObj
from mujoco._errors import FatalError
from mujoco._render import MjrContext, mjr_readPixels, mjr_render, mjr_setBuffer
from mujoco._specs import MjSpec
from mujoco._structs import MjData, MjModel, MjrRect, MjvCamera, MjvOption, MjvScene

from swarm_mj.mission import Mission
from swarm_mj.physics.obstacles import obstacle_geoms
from swarm_mj.physics.robots import RobotKind, kinds_of, pose_of
from swarm_mj.physics.scene import Scene, compose
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.links import lifted
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.rendering import markers
from swarm_mj.replay.rendering.opengl import make_context, unusable
from swarm_mj.replay.rendering.theme import DARK, Theme
from swarm_mj.replay.view import CHASE, MAP

BEACONS = 2  # the group of the robots' own markers, assets/robot.xml: too small from afar
TILE_M = 200.0  # the floor's texture, two squares by two, assets/arena.xml
SMALLER = 20.0  # times, seen from nearby: squares of 5 m say how fast a robot flies
GROUND = 10.0  # an open floor's side, by the area's: a team that flies apart has left the area
# What faces up has its own colour exactly, what stands upright half of it.
AMBIENT = 0.5
SUN = 0.5
NOON = (0.0, 0.0, -1.0)
AFTERNOON = (0.55, 0.45, -0.7)  # from nearby, it tells the sides of things apart
WALL_OPACITY = 0.3  # what stands in front hides no robot
OBSTACLE_OPACITY = 0.35  # likewise
NEAR_OPACITY = 0.75  # of obstacles seen from nearby
SLICES = 14  # of round things, around
STACKS = 5  # and along their axis
ROUNDER = 3  # times as many pieces, from nearby
WINDOW = (1280, 720)  # that sizes on the window are meant for [pixels]
NO_WINDOW = 'the window needs a display; without one, render_mode="rgb_array" draws pictures'
CLOSING_S = 5.0  # what the window may take to close


class SceneRenderer(ExitStack):
    """Draws pictures of one mission's scene, all of one size, until `close` frees OpenGL's memory.

    MuJoCo's own `Renderer` takes the back end that was chosen when MuJoCo was imported, and frees
    its memory in whichever context is current; with two renderers that is the wrong one.
    """

    def __init__(
        self,
        mission: Mission,
        width: int = 1280,
        height: int = 720,
        *,
        scene: Scene | None = None,
        theme: Theme = DARK,
        camera: str = MAP,
    ) -> None:
        """Compile the scene for pictures of this size [pixels] by a camera of `CAMERAS`.

        Raises OSError if no OpenGL works here.
        """
        super().__init__()
        self._size = (width, height)
        self._mission = mission
        self._theme = theme
        self._chases = camera == CHASE
        self._model = pictured(mission, scene, width, height, theme, is_near=self._chases)
        self._kinds = kinds_of(mission) if mission.has_bodies else []
        self._data = MjData(self._model)
        self._floor = functions.mj_name2id(self._model, mjtObj.mjOBJ_GEOM.value, "floor")
        num_geoms = self._model.ngeom + mission.num_robots * markers.GEOMS_PER_ROBOT
        self._scene = MjvScene(self._model, num_geoms)
        self._options = MjvOption()
        self._options.geomgroup[BEACONS] = 0
        self._opengl = make_context(width, height)
        try:
            self._opengl.make_current()
            self._context = MjrContext(self._model, mjtFontScale.mjFONTSCALE_100.value)
        except FatalError as error:  # GLFW without a screen says nothing before
            self._opengl.free()
            raise unusable(error) from error
        mjr_setBuffer(mjtFramebuffer.mjFB_OFFSCREEN.value, self._context)
        # The last comes first: else the memory would be freed in the context of another renderer.
        for step in (self._opengl.free, self._context.free, self._opengl.make_current):
            self.callback(step)
        atexit.register(_close, ref(self))  # before the back end ends, which registered earlier

    def camera(self, footage: Footage, moment: float = 0) -> markers.Camera:
        """Return the camera by which a picture is seen, at a moment in windows from 0."""
        if self._chases:
            return markers.chase(footage, moment, *self._size)
        return markers.look_at(footage.ground, round(moment), *self._size)

    def frame(self, footage: Footage, moment: float = 0) -> UInt8[np.ndarray, "H W 3"]:
        """Return the picture of a moment, in windows from 0: RGB, its first row on top."""
        width, height = self._size
        camera = self.camera(footage, moment)
        row = round(moment)
        footage = footage.moved_to(moment)
        data = self._data
        data.qpos[:] = _pose(footage, row, self._kinds)
        functions.mj_kinematics(self._model, data)
        functions.mj_comPos(self._model, data)
        functions.mj_camlight(self._model, data)
        if not self._mission.has_walls and self._floor >= 0:
            # By whole tiles, so that the pattern stands still under a team that flies on.
            tiles = np.round(footage.ground.centre_m[row] / TILE_M)
            data.geom_xpos[self._floor, :2] = TILE_M * tiles
        free = MjvCamera()
        camera.aim(free)
        kinds = mjtCatBit.mjCAT_ALL.value
        functions.mjv_updateScene(self._model, data, self._options, None, free, kinds, self._scene)
        markers.draw_markers(self._scene, footage, row, camera, self._theme)
        picture = np.empty((height, width, 3), np.uint8)
        whole = MjrRect(0, 0, width, height)
        self._opengl.make_current()  # there may be other renderers
        mjr_render(whole, self._scene, self._context)
        mjr_readPixels(picture, None, whole, self._context)
        return picture[::-1].copy()


def _close(renderer: "ref[SceneRenderer]") -> None:
    # A renderer that is still there when Python ends: later, OpenGL would fail.
    if (left := renderer()) is not None:
        left.close()


def _base_of(robot: int, kinds: Sequence[RobotKind]) -> int:
    """Return MuJoCo's number of a robot's base; points, which have no kinds, are one body each."""
    sizes = [1] * robot
    for kind in kinds:
        each = kind.model.nbody - 1  # without the world
        sizes[kind.first : kind.first + kind.num_robots] = [each] * kind.num_robots
    return 1 + sum(sizes[:robot])


def _pose(footage: Footage, row: int, kinds: Sequence[RobotKind]) -> Float[np.ndarray, "Q"]:
    """Return MuJoCo's coordinates of a window's robots."""
    if footage.height_m is None or footage.attitude is None:
        return footage.position_m[row].ravel()
    place_m = lifted(footage.position_m[row], footage.height_m[row])
    return pose_of(kinds, place_m, footage.attitude[row])


def pictured(
    mission: Mission,
    scene: Scene | None,
    width: int,
    height: int,
    theme: Theme = DARK,
    *,
    is_near: bool = False,
) -> MjModel:
    """Compile a mission's scene for pictures of this size [pixels].

    Light comes from above, walls and obstacles are of glass, and an open area's floor is as wide
    as a camera sees. From nearby, its squares are smaller.
    """
    spec = compose(mission, scene=scene)
    _paint(spec, theme)
    _widen_floor(spec, mission, times=SMALLER if is_near else 1.0)
    model = spec.compile()
    visual = model.vis
    visual.global_.offwidth = width
    visual.global_.offheight = height
    _set_view(model, is_near=is_near)
    for g in obstacle_geoms(model):
        material = model.geom_matid[g]
        colour = model.geom_rgba[g] if material < 0 else model.mat_rgba[material]
        colour[3] = min(colour[3], NEAR_OPACITY if is_near else OBSTACLE_OPACITY)
    return model


def _widen_floor(spec: MjSpec, mission: Mission, times: float) -> None:
    """Make an open area's floor wide, and walls of glass; squares are `times` smaller."""
    half_m = float(np.ceil(GROUND * mission.half_side_m / TILE_M) * TILE_M)
    # By name, if they are there: a user's scene may have neither.
    for material in spec.materials:
        if material.name == "wall":
            material.rgba[3] = WALL_OPACITY
        elif material.name == "floor":
            repeats = np.array(material.texrepeat)
            if not mission.has_walls:
                repeats = np.full(2, 2.0 * half_m / TILE_M)
            material.texrepeat = (times * repeats).tolist()
    for geom in spec.geoms:
        if geom.name == "floor" and not mission.has_walls:
            geom.size = [half_m, half_m, half_m / 10.0]  # drawn in 20 by 20 pieces


def _set_view(model: MjModel, *, is_near: bool) -> None:
    """Set lens, light and roundness, from nearby or for the map."""
    visual = model.vis
    visual.global_.fovy = markers.CHASE_FOV_Y_DEG if is_near else markers.FOV_Y_DEG
    if is_near:
        visual.map.znear = markers.CHASE_NEAR_M / model.stat.extent
    rounder = ROUNDER if is_near else 1
    visual.quality.numslices = rounder * SLICES
    visual.quality.numstacks = rounder * STACKS
    visual.headlight.ambient[:] = AMBIENT
    visual.headlight.diffuse[:] = 0.0
    model.light_diffuse[:] = SUN
    model.light_ambient[:] = 0.0
    model.light_dir[:] = AFTERNOON if is_near else NOON


def _paint(spec: MjSpec, theme: Theme) -> None:
    """Give sky, floor and walls their colours, where a scene has them."""
    for texture in spec.textures:
        if texture.name == "sky":
            texture.rgb1 = texture.rgb2 = _shares(theme.background)
        elif texture.name == "squares":
            first, second = theme.squares
            texture.rgb1 = _shares(first)
            texture.rgb2 = _shares(second)
    for material in spec.materials:
        if material.name == "wall":
            material.rgba[:3] = _shares(theme.wall)


def _shares(colour: Colour) -> list[float]:
    return [share / 255.0 for share in colour]


class SceneViewer:
    """MuJoCo's passive viewer, with robots and packets; to close the window ends the view alone."""

    def __init__(self, mission: Mission, *, scene: Scene | None = None, camera: str = MAP) -> None:
        """Open the window; raise OSError without a display, or if it is closed already.

        It is first seen by a camera of `CAMERAS`. One that chases stays with its robot, while the
        user turns it and comes nearer.
        """
        import glfw  # both look for a display when they are imported
        from mujoco import viewer

        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if not glfw.init():  # MuJoCo's viewer would wait forever
                raise OSError(NO_WINDOW)
        self._chases = camera == CHASE
        self._model = pictured(mission, scene, *WINDOW, is_near=self._chases)
        self._kinds = kinds_of(mission) if mission.has_bodies else []
        self._data = MjData(self._model)
        others = set(threading.enumerate())
        try:
            self._window = viewer.launch_passive(
                self._model, self._data, show_left_ui=False, show_right_ui=False
            )
        except RuntimeError as error:  # macOS opens windows for `mjpython` only
            raise OSError(f"{error}; {NO_WINDOW}") from error
        self._threads = set(threading.enumerate()) - others
        markers = self._window.user_scn
        if markers is None:
            raise OSError("the window was closed before the mission began; open it again")
        self._markers = markers
        self._is_aimed = False

    @property
    def is_open(self) -> bool:
        """True until the window is closed."""
        return self._window.is_running()

    def show(self, footage: Footage, moment: float = 0) -> None:
        """Show a moment of the footage from now on, in windows from 0."""
        if not self.is_open:
            return
        row = round(moment)
        footage = footage.moved_to(moment)
        with self._window.lock():
            camera = self._camera(footage, row)
            self._data.qpos[:] = _pose(footage, row, self._kinds)
            functions.mj_forward(self._model, self._data)
            self._markers.ngeom = 0
            markers.draw_markers(self._markers, footage, row, camera)
        self._window.sync()

    def _camera(self, footage: Footage, row: int) -> markers.Camera:
        """Return the camera by which markers are drawn; the first time, aim the window's so."""
        free = self._window.cam
        if not self._chases:
            camera = markers.look_at(footage.ground, row, *WINDOW)
        else:
            camera = markers.chase(footage, row, *WINDOW)
        if not self._is_aimed:  # from then on it is the user's
            camera.aim(free)
            if self._chases:
                free.type = mjtCamera.mjCAMERA_TRACKING.value
                free.trackbodyid = _base_of(footage.ego, self._kinds)
            self._window.opt.geomgroup[BEACONS] = 0
            self._is_aimed = True
        if self._chases:
            camera = camera._replace(
                distance_m=free.distance, azimuth_deg=free.azimuth, elevation_deg=-free.elevation
            )
        return camera

    def close(self) -> None:
        """Close the window and wait for its threads: a process that ends earlier may crash."""
        self._window.close()
        for thread in self._threads:
            thread.join(CLOSING_S)
