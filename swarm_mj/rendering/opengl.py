"""OpenGL without a screen: which of MuJoCo's back ends works here, and a context of it.

MuJoCo settles on a back end when it is imported, and PyOpenGL when it is; both fail in many words
where there is no driver. So a back end that may fail is tried in a process of its own first.
"""

import importlib
import os
import sys
import tempfile
from functools import cache
from typing import Protocol, runtime_checkable

from swarm_mj.io.processes import running

CHOICE = "MUJOCO_GL"  # the variable by which people choose, and MuJoCo's renderer is told
OFF, ON = ("disable", "disabled", "off", "false", "0"), ("enable", "enabled", "on", "true", "1")
NAMES = ("egl", "osmesa", "glfw", "glx", "cgl", "wgl")  # each works on some systems
WITHOUT_SCREEN = ("egl", "osmesa")  # on Linux; EGL may have a graphics card, OSMesa never
TRIAL = "from mujoco.egl import GLContext; GLContext(8, 8).make_current()"
WAY_OUT = (
    "rendering needs OpenGL; on Debian and Ubuntu, `apt-get install libosmesa6` draws without a "
    "graphics card and a screen (`libegl1` with one)"
)


@runtime_checkable
class Context(Protocol):
    """What MuJoCo's back ends have in common."""

    def make_current(self) -> None:
        """Draws into this context from now on."""
        ...

    def free(self) -> None:
        """Gives its memory back."""
        ...


def make_context(width: int, height: int) -> Context:
    """A context to draw pictures of this size in.

    Raises:
        OSError: No OpenGL works here, or not the one that MUJOCO_GL names.
    """
    name = backend()
    os.environ[CHOICE] = name  # MuJoCo's renderer reads it when it makes its first context
    try:
        return importlib.import_module(f"mujoco.{name}").GLContext(width, height)
    except Exception as error:  # each back end has its own
        raise unusable(error) from error


def unusable(error: Exception) -> OSError:
    """What to raise when the back end in use turns out not to work."""
    return OSError(f"{backend()} does not work here ({type(error).__name__}); {WAY_OUT}")


def check_choice() -> str:
    """What MUJOCO_GL says, in lower case; MuJoCo cannot even be imported with a name it lacks.

    Raises:
        ValueError: It has no such back end.
    """
    chosen = os.environ.get(CHOICE, "").lower().strip()
    if chosen and chosen not in (*NAMES, *ON, *OFF):
        raise ValueError(
            f"the environment variable {CHOICE} must be one of {', '.join(NAMES)} or off, not "
            f"{chosen!r}; unset it"
        )
    return chosen


def backend() -> str:
    """The back end in use: the one that MUJOCO_GL names, or else the first that works here.

    Raises:
        OSError: MUJOCO_GL says that there is to be none.
    """
    chosen = check_choice()
    if chosen in OFF:
        raise OSError(f"{CHOICE}={chosen} switches rendering off; unset it")
    if chosen in ("", *ON):
        return _default()
    return "glfw" if chosen == "glx" else chosen


@cache
def _default() -> str:
    if sys.platform == "darwin":
        return "cgl"
    preset = os.environ.get("PYOPENGL_PLATFORM", "").lower()  # of whoever has drawn already
    if preset in WITHOUT_SCREEN:
        return preset
    return "egl" if _works(TRIAL) else "osmesa"


def _works(trial: str) -> bool:
    environment = {**os.environ, CHOICE: "egl"}
    with (
        tempfile.TemporaryFile("w+") as said,
        running([sys.executable, "-c", trial], environment=environment, output=said) as child,
    ):
        return child.wait() == 0
