"""OpenGL without a screen: which of MuJoCo's back ends works here, and a context of it.

MuJoCo and dm_control settle on a back end when they are imported, PyOpenGL when it is, and all fail
in many words where there is no driver. So a back end that may fail is first tried in a process of
its own, and what works is written to `MUJOCO_GL`: libraries that are imported later and processes
that are started later draw by the same.
"""

import importlib
import os
import sys
from typing import Any

from swarm_mj.system.processes import attempt

CHOICE = "MUJOCO_GL"  # the variable by which users and MuJoCo's renderer choose OpenGL's backend
PYOPENGL = "PYOPENGL_PLATFORM"  # PyOpenGL's own, which MuJoCo and dm_control set
OFF = ("disable", "disabled", "off", "false", "0")
ON = ("enable", "enabled", "on", "true", "1")
NAMES = ("egl", "osmesa", "glfw", "glx", "cgl", "wgl")  # each works on some systems
WITHOUT_SCREEN = ("egl", "osmesa")  # on Linux; EGL may have a graphics card, OSMesa never
# In words, as a process that imports this package takes a second to start.
TRIAL = "from mujoco.{} import GLContext; GLContext(8, 8).make_current()"
WAY_OUT = (
    "rendering needs OpenGL; on Debian and Ubuntu, `apt-get install libosmesa6` draws without a "
    "graphics card and a screen (`libegl1` with one)"
)


def make_context(width: int, height: int) -> Any:  # noqa: ANN401 - each back end has its own
    """Return MuJoCo's `GLContext` for pictures of this size; OSError if no OpenGL works here."""
    name = backend()
    try:
        return importlib.import_module(f"mujoco.{name}").GLContext(width, height)
    except Exception as error:  # each back end has its own
        raise unusable(error) from error


def unusable(error: Exception) -> OSError:
    """Return what to raise when the back end in use turns out not to work."""
    return OSError(f"{backend()} does not work here ({type(error).__name__}); {WAY_OUT}")


def chosen_backend() -> str:
    """Return MUJOCO_GL in lower case; raise ValueError for a name by which MuJoCo cannot load."""
    chosen = os.environ.get(CHOICE, "").lower().strip()
    if chosen and chosen not in (*NAMES, *ON, *OFF):
        rule = f"the environment variable {CHOICE} must be one of {', '.join(NAMES)} or off"
        raise ValueError(f"{rule}, not {chosen!r}; unset it")
    return chosen


def backend() -> str:
    """Return the back end in use: the one that MUJOCO_GL names, or else the first that works here.

    What works is found once and written to MUJOCO_GL. Raise OSError if none works, or MUJOCO_GL
    says that there is to be none.
    """
    named = chosen_backend()
    if named in OFF:
        raise OSError(f"{CHOICE}={named} switches rendering off; unset it")
    if named in ("", *ON):
        named = "cgl" if sys.platform == "darwin" else _first_that_works()
    os.environ[CHOICE] = "glfw" if named == "glx" else named
    return os.environ[CHOICE]


def _first_that_works() -> str:
    # What PyOpenGL draws by in this process, if it is loaded, cannot change. dm_control's viewer
    # loads it without a choice. Without a screen it then takes GLX, and EGL finds no display in
    # this process any more, although it does in a fresh one.
    loaded: Any = sys.modules.get("OpenGL.platform")
    settled = loaded and type(loaded.PLATFORM).__name__.removesuffix("Platform").lower()
    preset = settled or os.environ.get(PYOPENGL, "").lower()
    candidates = sorted(WITHOUT_SCREEN, key=lambda name: name != preset)  # EGL before OSMesa
    found = next(filter(_works, candidates), None)
    if found is None:
        raise OSError(f"neither EGL nor OSMesa works here; {WAY_OUT}")
    if settled and found != settled:
        way_on = f"set {CHOICE}={found} before Python starts"
        raise OSError(f"another library has chosen {settled}, which does not work here; {way_on}")
    if preset != found:  # MuJoCo refuses to draw by another back end than PyOpenGL's
        os.environ.pop(PYOPENGL, None)
    return found


def variables_of(name: str) -> dict[str, str]:
    """Return the environment variables by which a process draws with this back end alone."""
    # What else is set for PyOpenGL would bind it to another.
    return {CHOICE: name, PYOPENGL: name}


def render_nothing() -> None:
    """Draw an empty scene by the back end that MUJOCO_GL names; raises what that raises."""
    from mujoco import Renderer  # which settles on a back end
    from mujoco._structs import MjModel

    with Renderer(MjModel.from_xml_string("<mujoco/>"), 32, 32) as renderer:
        renderer.render()


def _works(name: str) -> bool:
    works, _ = attempt(TRIAL.format(name), variables_of(name))
    return works
