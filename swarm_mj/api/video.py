"""Videos of flights: as a file's content, and within a notebook."""

from dataclasses import replace
from typing import TYPE_CHECKING

from swarm_mj.replay.rendering.style import DEFAULTS, default_seconds, fitted
from swarm_mj.system.packages import need
from swarm_mj.system.progress import quiet_bar
from swarm_mj.system.terminal import plain_console

if TYPE_CHECKING:  # they load what draws
    from swarm_mj.replay.footage import Footage

ELSEWHERE = (
    "run.show() plays a video in a notebook. Here, run.save('flight.mp4') writes the video, and "
    "run.save('flight.rrd') a replay that `swarm-mj replay flight.rrd` opens."
)


def film(footage: "Footage", suffix: str) -> bytes:
    """Return the content of a video file of this ending, as `swarm-mj replay --video` makes it.

    Raises:
        OSError: No OpenGL works here; it says what to install.
        ModuleNotFoundError: A package that makes videos is not installed.
    """
    for module in ("av", "PIL"):
        need(module, "a video")
    from swarm_mj.replay.rendering.video import make_video

    style = fitted(replace(DEFAULTS[suffix], seconds=default_seconds([footage])), suffix)
    with quiet_bar("Drawing", style.num_frames, "pictures") as bar:
        return make_video([footage], suffix, style, bar.advance)


def play(content: bytes) -> None:
    """Show a video in the notebook."""
    from IPython.display import Video, display

    display(Video(data=content, embed=True, mimetype="video/mp4", html_attributes="controls loop"))


def tell_where() -> None:
    """Say what to do outside notebooks."""
    plain_console().print(ELSEWHERE)
