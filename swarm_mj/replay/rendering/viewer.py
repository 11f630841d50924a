"""A window on a mission: MuJoCo's own viewer, with robots and packets as pictures have them."""

import threading
import warnings

import glfw
from mujoco import viewer
from mujoco._functions import mj_forward
from mujoco._structs import MjData

from swarm_mj.mission import Mission
from swarm_mj.physics.scene import Scene
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.rendering.markers import draw_markers, look_at
from swarm_mj.replay.rendering.scene import BEACONS, pictured

SIZE = 1280, 720  # that sizes on the window are meant for [pixels]
WAY_OUT = 'the window needs a display; without one, render_mode="rgb_array" draws pictures'
CLOSING_S = 5.0  # what the window may take to close


class SceneViewer:
    """MuJoCo's passive viewer; closing the window ends the view, and nothing else."""

    def __init__(self, mission: Mission, *, scene: Scene | None = None) -> None:
        """Open the window; raise OSError without a display, or if it is closed already."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            if not glfw.init():  # MuJoCo's viewer would wait forever
                raise OSError(WAY_OUT)
        self._model = pictured(mission, scene, *SIZE)
        self._data = MjData(self._model)
        others = set(threading.enumerate())
        try:
            self._window = viewer.launch_passive(
                self._model, self._data, show_left_ui=False, show_right_ui=False
            )
        except RuntimeError as error:  # macOS opens windows for `mjpython` only
            raise OSError(f"{error}; {WAY_OUT}") from error
        self._threads = set(threading.enumerate()) - others
        markers = self._window.user_scn
        if markers is None:
            raise OSError("the window was closed before the mission began; open it again")
        self._markers = markers
        self._is_aimed = False

    def show(self, footage: Footage) -> None:
        """Show this from now on."""
        if not self._window.is_running():
            return
        camera = look_at(footage.ground, 0, *SIZE)
        with self._window.lock():
            if not self._is_aimed:  # from then on it is the user's
                camera.aim(self._window.cam)
                self._window.opt.geomgroup[BEACONS] = 0
                self._is_aimed = True
            self._data.qpos[:] = footage.position_m[0].ravel()
            mj_forward(self._model, self._data)
            self._markers.ngeom = 0
            draw_markers(self._markers, footage, 0, camera)
        self._window.sync()

    def close(self) -> None:
        """Close the window and wait for its threads: a process that ends earlier may crash."""
        self._window.close()
        for thread in self._threads:
            thread.join(CLOSING_S)
