"""How a replay is seen: in rerun's viewer or a browser, or as a video of some size and length."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from swarm_mj.system.interrupt import answer_interrupt
from swarm_mj.system.processes import PYTHON, running

if TYPE_CHECKING:  # what draws is slow to import
    from swarm_mj.replay.footage import Footage

LOOPBACK = "127.0.0.1"
# Light, unlike `python -m rerun`; and unlike `python -m rerun_cli` it tells the exit code.
START = "import sys; from rerun_cli.__main__ import main; sys.exit(main())"
VIEWER = (*PYTHON, "-c", START)
NOWHERE = f"http://{LOOPBACK}:9"  # a proxy that is not there
# With CI set rerun does not count its users; its search for newer versions has no switch.
REPLACED = ("CI", "FORCE_RERUN_ANALYTICS", "ALL_PROXY", "HTTPS_PROXY", "HTTP_PROXY", "NO_PROXY")

# Where a flight or a training is shown while it goes on.
WINDOW = "window"
WEB = "web"
OPENING_S = 60.0  # that a viewer may take to open

LONGEST_S = 10.0  # of a video, unless its length is given
SHORTEST_S = 1.0  # likewise
GIF = ".gif"
TICKS_HZ = 100  # a GIF counts in hundredths of a second
MIN_TICKS = 2  # viewers show what is shorter much longer


def quiet_environment() -> dict[str, str]:
    """Return an environment in which rerun's viewer is quiet, and reaches this machine only."""
    kept = {name: value for name, value in os.environ.items() if name.upper() not in REPLACED}
    return {"RUST_LOG": "error"} | kept | {"CI": "true", "ALL_PROXY": NOWHERE}


def has_display() -> bool:
    """Tell whether the environment names a screen for windows."""
    is_named = os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    return not sys.platform.startswith("linux") or bool(is_named)


def need_display(ways: str) -> None:
    """Raise ValueError without a screen for windows; `ways` says what to do then."""
    if not has_display():
        raise ValueError(f"there is no display (DISPLAY and WAYLAND_DISPLAY are unset); {ways}")


def view_command(*paths: Path) -> list[str]:
    """Return the command that opens replays in a window; raise ValueError without a display."""
    need_display("use `swarm-mj replay --web FILE`, or `--video FILE.mp4` for a video")
    return [*VIEWER, *map(str, paths)]


def serve_command(*paths: Path) -> tuple[list[str], str]:
    """Return the command that serves replays to this machine's browsers, and the address."""
    data_port, page_port = free_ports(2)
    ports = ["--port", str(data_port), "--web-viewer-port", str(page_port)]
    command = [*VIEWER, "--serve-web", "--bind", LOOPBACK, *ports, *map(str, paths)]
    source = f"rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data_port}%2Fproxy"
    # As in a notebook, the page counts no users.
    return command, f"http://{LOOPBACK}:{page_port}/?url={source}&notebook=1"


class LiveViewer(NamedTuple):
    """A viewer that waits for data while a flight goes on."""

    process: subprocess.Popen[bytes]
    address: str  # where it takes data, as rerun names it
    page: str | None  # what a browser opens; None: it is a window

    def wait(self) -> int:
        """Wait until it is closed; return 1 if it failed, 0 after Ctrl-C."""
        try:
            return int(self.process.wait() != 0)
        except KeyboardInterrupt:
            answer_interrupt()
            return 0


def check_screen(where: str) -> None:
    """Raise ValueError where a window was asked for, and there is no screen."""
    if where == WINDOW:
        need_display('--live web (in Python live="web") serves it to a browser')


@contextmanager
def live_viewer(where: str) -> Iterator[LiveViewer]:
    """Start rerun's viewer for the data of a flight: a window, or a server for a browser.

    It ends with the block. Raises OSError if it cannot be started.
    """
    # Of this process, too: rerun's would say when a viewer is closed.
    os.environ.setdefault("RUST_LOG", "off")
    if where == WEB:
        command, page = serve_command()
        port = command[command.index("--port") + 1]
    else:
        page = None
        (port,) = map(str, free_ports(1))
        command = [*VIEWER, "--bind", LOOPBACK, "--port", port, "--expect-data-soon"]
    with running(command, environment=quiet_environment()) as process:
        _await_port(process, int(port))
        address = f"rerun+http://{LOOPBACK}:{port}/proxy"
        yield LiveViewer(process=process, address=address, page=page)


def _await_port(process: subprocess.Popen[bytes], port: int) -> None:
    """Wait until a viewer takes data; raise OSError if it ends before, or takes too long."""
    deadline_s = time.monotonic() + OPENING_S
    while time.monotonic() < deadline_s:
        code = process.poll()
        if code is not None:
            lack = f"rerun's viewer ended as it was opened (exit code {code})"
            raise OSError(f"{lack}; --live web needs no window, and without --live none opens")
        with suppress(OSError), socket.create_connection((LOOPBACK, port), timeout=1.0):
            return
        time.sleep(0.05)
    raise OSError(f"rerun's viewer took no data at port {port} within {OPENING_S:g} s")


def run(command: list[str]) -> int:
    """Run a viewer until it is closed; return 1 if it failed, 0 after Ctrl-C."""
    try:
        with running(command, environment=quiet_environment()) as viewer:
            return int(viewer.wait() != 0)  # its own codes, or a signal's, mean nothing here
    except KeyboardInterrupt:
        answer_interrupt()
        return 0


def free_ports(number: int) -> list[int]:
    """Return ports of this machine that no process listens on."""
    with ExitStack() as stack:
        # All are open at once, so that no port is found twice.
        servers = [stack.enter_context(socket.create_server((LOOPBACK, 0))) for _ in range(number)]
        return [server.getsockname()[1] for server in servers]


# Where a video is seen from.
MAP = "map"
CHASE = "chase"
CAMERAS = (MAP, CHASE)


@dataclass(frozen=True, kw_only=True)
class VideoStyle:
    """How a video is made."""

    width: int = 1280  # [pixels]
    height: int = 720
    seconds: float = LONGEST_S  # in which the whole mission is shown
    fps: int | float = 25  # pictures per second
    theme: str = "dark"  # a name of `rendering.theme.THEMES`
    camera: str = MAP  # one of CAMERAS

    def __post_init__(self) -> None:
        if self.camera not in CAMERAS:
            raise ValueError(f"camera must be {' or '.join(CAMERAS)}, not {self.camera!r}")

    @property
    def num_frames(self) -> int:
        """The number of pictures."""
        return max(1, round(self.seconds * self.fps))


DEFAULTS = {".mp4": VideoStyle(), GIF: VideoStyle(width=830, height=520, fps=15)}


def fitted(style: VideoStyle, suffix: str) -> VideoStyle:
    """Adapt a style to a kind of file: a GIF's pictures last whole hundredths of a second."""
    if suffix != GIF:
        return style
    return replace(style, fps=TICKS_HZ / max(MIN_TICKS, round(TICKS_HZ / style.fps)))


def default_seconds(footages: "Sequence[Footage]") -> float:
    """Return the missions' own time, if that is neither short nor long."""
    flown_s = max(len(each.window) * each.facts.mission.window_s for each in footages)
    return min(LONGEST_S, max(SHORTEST_S, flown_s))
