"""Takes a picture of a replay at one window, without a screen.

    python tools/picture.py replays/mission.rrd --window 250 --out mission.png

Runs rerun's own viewer headless, so what it shows is what people see. Needs a Vulkan driver; a
software one will do (Debian and Ubuntu: `apt-get install mesa-vulkan-drivers`).
"""

import io
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from PIL import Image
from rerun.experimental import ViewerClient

from swarm_mj.cli import script
from swarm_mj.replay.read import check_replay, windows
from swarm_mj.replay.view import LOOPBACK, VIEWER, free_ports, quiet_environment
from swarm_mj.system.fields import setting
from swarm_mj.system.processes import running
from swarm_mj.system.writing import Output, check_outputs, owned, write_bytes

START_TIMEOUT_S = 60.0
LOAD_TIMEOUT_S = 120.0
NOTICES_S = 6.0  # the viewer's notices fade after this time
TITLE_BAR_POINTS = 36.0
ZOOM_STEP = 0.1  # of the viewer's own zoom
SETTLE_S = 1.0  # after a jump in time, until everything is drawn


@dataclass(frozen=True, kw_only=True)
class Options:
    """What is shown, and how large."""

    replay: Path = setting(help="an .rrd file that `swarm-mj fly` recorded", is_positional=True)
    window: int | None = setting(None, "the window to show", shown="the middle one")
    out: Path = setting(Path("replay.png"), "the picture")
    force: bool = setting(False, "replace an existing picture")
    size: str = setting("2560x1400", "in pixels", metavar="WIDTHxHEIGHT")
    zoom: int = setting(6, "steps by which texts are enlarged", low=0, high=40)


def run(options: Options) -> int:
    """Take the picture; return the exit code."""
    check_outputs(Output("picture", options.out, ".png"), must_be_new=not options.force)
    with owned(options.out):
        take_picture(options.replay, options.window, options.out, options.size, options.zoom)
    print(options.out)
    return 0


def take_picture(replay: Path, window: int | None, out: Path, size: str, zoom: int) -> None:
    """Write a PNG of the replay's first tab at one window.

    Args:
        replay: The recording.
        window: The window to show; None is the middle one.
        out: The PNG.
        size: WIDTHxHEIGHT [pixels].
        zoom: Steps of the viewer's own zoom.

    Raises:
        ValueError: The file is no whole replay, or has no such window, or the size is malformed.
        OSError: A file cannot be read or written.
        TimeoutError: The viewer did not come up or did not load the file.
    """
    if not re.fullmatch(r"[1-9]\d{2,3}x[1-9]\d{2,3}", size):
        raise ValueError(f"size must be WIDTHxHEIGHT from 100x100 to 9999x9999, not {size!r}")
    check_replay(replay)
    flown = windows(replay)
    shown = int(flown[len(flown) // 2]) if window is None else window
    if not flown[0] <= shown <= flown[-1]:
        raise ValueError(f"window must be from {flown[0]} to {flown[-1]}, not {shown}")
    with _viewer(size) as client:
        client.open(str(replay.resolve()))
        _wait(lambda: not client.get_state().loading, LOAD_TIMEOUT_S, "the viewer did not load it")
        client.run_command("ui.toggle_top_panel")
        for _ in range(zoom):
            client.run_command("ui.zoom_in_ui")
        time.sleep(NOTICES_S)
        client.set_time("window", sequence=shown, play_state="paused")
        time.sleep(SETTLE_S)
        write_bytes(out, _without_title_bar(client.take_screenshot(), zoom))


def _without_title_bar(png: bytes, zoom: int) -> bytes:
    """Crop the window's empty title bar off."""
    cropped = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        top = round(TITLE_BAR_POINTS * (1.0 + ZOOM_STEP * zoom))
        box = (0, top, picture.width, picture.height)
        picture.crop(box).save(cropped, format="png", optimize=True)
    return cropped.getvalue()


@contextmanager
def _viewer(size: str) -> Iterator[ViewerClient]:
    """Return a headless viewer on a free port of this machine, gone afterwards."""
    (port,) = free_ports(1)
    command = [
        *(*VIEWER, "--headless", "--hide-welcome-screen", "--bind", LOOPBACK),
        *("--port", str(port), "--window-size", size),
    ]
    with (
        tempfile.TemporaryFile("w+") as said,
        running(command, environment=quiet_environment(), output=said) as viewer,
    ):
        try:
            yield _connect(viewer, port, said)
        except (RuntimeError, ConnectionError) as error:  # the client's, when the viewer is gone
            raise OSError(_complaint(said)) from error


def _connect(viewer: subprocess.Popen, port: int, said: IO[str]) -> ViewerClient:
    address = f"rerun+http://{LOOPBACK}:{port}/proxy"
    clients: list[ViewerClient] = []

    def is_up() -> bool:
        if viewer.poll() is not None:
            raise OSError(_complaint(said))
        try:
            client = ViewerClient.connect(address)
            client.get_state()
        except Exception:
            return False
        clients.append(client)
        return True

    _wait(is_up, START_TIMEOUT_S, "rerun's viewer did not start")
    return clients[0]


def _complaint(said: IO[str]) -> str:
    said.seek(0)
    return (
        "rerun's viewer stopped; without a graphics card it needs a software Vulkan driver "
        "(Debian and Ubuntu: apt-get install mesa-vulkan-drivers). It said: "
        + " ".join(said.read().split())[-400:]
    )


def _wait(is_done: Callable[[], bool], timeout_s: float, complaint: str) -> None:
    deadline = time.monotonic() + timeout_s
    while not is_done():
        if time.monotonic() > deadline:
            raise TimeoutError(f"{complaint} within {timeout_s:g} s")
        time.sleep(0.1)


if __name__ == "__main__":
    sys.exit(script(Options, run))
