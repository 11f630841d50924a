"""Opens a replay in rerun's viewer: a window, or a browser on this machine."""

import os
import socket
import subprocess
import sys
from pathlib import Path

LOOPBACK = "127.0.0.1"


def view_command(path: Path) -> list[str]:
    """The command that opens a replay in a window.

    Raises:
        ValueError: There is no display to open a window on.
    """
    has_display = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    if sys.platform.startswith("linux") and not has_display:
        raise ValueError(
            "there is no display (DISPLAY and WAYLAND_DISPLAY are unset); use "
            "`swarm-mj replay --web FILE`, or tools/picture.py for a picture"
        )
    return [sys.executable, "-m", "rerun", str(path)]


def serve_command(path: Path) -> tuple[list[str], str]:
    """The command that serves a replay to this machine's browsers only, and the address to open."""
    data_port, page_port = _free_ports()
    command = [
        *(sys.executable, "-m", "rerun", "--serve-web", "--bind", LOOPBACK),
        *("--port", str(data_port), "--web-viewer-port", str(page_port), str(path)),
    ]
    source = f"rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data_port}%2Fproxy"
    return command, f"http://{LOOPBACK}:{page_port}/?url={source}"


def run(command: list[str]) -> int:
    """Runs a viewer until it is closed; returns its exit code, 0 after Ctrl-C."""
    viewer = subprocess.Popen(command)
    try:
        return viewer.wait()
    except KeyboardInterrupt:
        viewer.terminate()
        viewer.wait()
        return 0


def _free_ports() -> tuple[int, int]:
    with socket.socket() as first, socket.socket() as second:
        first.bind((LOOPBACK, 0))
        second.bind((LOOPBACK, 0))
        return first.getsockname()[1], second.getsockname()[1]
