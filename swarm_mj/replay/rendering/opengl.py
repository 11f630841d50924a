"""OpenGL without a screen: which of MuJoCo's back ends works here, and a context of it.

MuJoCo settles on a back end when it is imported, and PyOpenGL when it is; both fail in many words
where there is no driver. So a back end that may fail is tried in a process of its own first.
"""

import importlib
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Protocol, runtime_checkable

from swarm_mj.system.processes import PYTHON, running

CHOICE = "MUJOCO_GL"  # the variable by which people choose, and MuJoCo's renderer is told
PYOPENGL = "PYOPENGL_PLATFORM"  # PyOpenGL's own, which MuJoCo and dm_control set
OFF, ON = ("disable", "disabled", "off", "false", "0"), ("enable", "enabled", "on", "true", "1")
NAMES = ("egl", "osmesa", "glfw", "glx", "cgl", "wgl")  # each works on some systems
WITHOUT_SCREEN = ("egl", "osmesa")  # on Linux; EGL may have a graphics card, OSMesa never
TRIAL = "from mujoco.{} import GLContext; GLContext(8, 8).make_current()"
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
        """Give its memory back."""
        ...


def make_context(width: int, height: int) -> Context:
    """Return a context to draw pictures of this size in.

    Raises:
        OSError: No OpenGL works here, or not the one that MUJOCO_GL names.
    """
    name = backend()
    try:
        return importlib.import_module(f"mujoco.{name}").GLContext(width, height)
    except Exception as error:  # each back end has its own
        raise unusable(error) from error


@contextmanager
def chosen() -> Iterator[None]:
    """Within it MuJoCo's renderer may start: it asks for the back end once, by the variable."""
    before = os.environ.get(CHOICE)
    os.environ[CHOICE] = backend()
    try:
        yield
    finally:
        if before is None:
            del os.environ[CHOICE]
        else:
            os.environ[CHOICE] = before


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
    """Return the back end in use: the one that MUJOCO_GL names, or else the first that works here.

    Raises:
        OSError: MUJOCO_GL says that there is to be none, or somebody else has settled on one that
            does not work.
    """
    named = check_choice()
    if named in OFF:
        raise OSError(f"{CHOICE}={named} switches rendering off; unset it")
    if named in ("", *ON):
        return _default()
    return "glfw" if named == "glx" else named


@cache
def _default() -> str:
    if sys.platform == "darwin":
        return "cgl"
    preset = os.environ.get(PYOPENGL, "").lower()  # of whoever has drawn already, or means to
    if preset in WITHOUT_SCREEN and _works(preset):
        return preset
    found = "egl" if preset != "egl" and _works("egl") else "osmesa"
    if preset in WITHOUT_SCREEN:
        if "OpenGL.platform" in sys.modules:  # which settles for good
            raise OSError(
                f"another library has chosen {preset}, which does not work here; "
                f"set {CHOICE}={found} before Python starts"
            )
        del os.environ[PYOPENGL]
    return found


def _works(name: str) -> bool:
    """Whether a back end makes a context, in a process of its own."""
    command = [*PYTHON, "-c", TRIAL.format(name)]
    environment = {**os.environ, CHOICE: name, PYOPENGL: name}
    with (
        tempfile.TemporaryFile("w+") as said,
        running(command, environment=environment, output=said) as child,
    ):
        return child.wait() == 0
