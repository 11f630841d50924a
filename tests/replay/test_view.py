"""Opening replays: in a window where there is a display, else to a browser on this machine."""

import os
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

from swarm_mj.replay.view import (
    LOOPBACK,
    VIEWER,
    quiet_environment,
    run,
    serve_command,
    view_command,
)

FILE = Path("some where") / "mission.rrd"


def test_a_window_needs_a_display(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(ValueError, match="no display"):
        view_command(FILE)
    monkeypatch.setenv("WAYLAND_DISPLAY", "wayland-0")
    assert view_command(FILE)[-1] == str(FILE)


def test_the_browser_s_server_binds_to_loopback_only():
    command, address = serve_command(FILE)
    assert command[command.index("--bind") + 1] == LOOPBACK == "127.0.0.1"
    ports = [command[command.index(name) + 1] for name in ("--port", "--web-viewer-port")]
    assert ports[0] != ports[1]
    assert address.startswith(f"http://127.0.0.1:{ports[1]}/")
    assert ports[0] in address


def test_a_viewer_s_way_out_of_this_machine_is_closed(monkeypatch):
    monkeypatch.setenv("https_proxy", "http://elsewhere:80")
    monkeypatch.setenv("NO_PROXY", "*")
    environment = quiet_environment()
    proxies = {name: value for name, value in environment.items() if "PROXY" in name.upper()}
    assert proxies == {"ALL_PROXY": "http://127.0.0.1:9"}
    assert environment["CI"]
    assert environment["PATH"] == os.environ["PATH"]


@pytest.mark.parametrize(
    ("end", "code"), [("sys.exit()", 0), ("sys.exit(101)", 1), ("os.kill(os.getpid(), 9)", 1)]
)
def test_a_viewer_that_fails_is_a_machine_that_fails(end, code):
    assert run([sys.executable, "-c", f"import os, sys; {end}"]) == code


def test_a_viewer_runs_nothing_of_the_folder_here(trapped):
    assert run([*VIEWER, "--version"]) == 0
    assert not trapped.exists()


def test_the_page_is_served(replay):
    command = [sys.executable, "-m", "swarm_mj", "replay", "--web", str(replay)]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    try:
        address = ""
        for line in server.stdout:
            address = address or (line.split()[1] if line.startswith("Open http") else "")
            if "Hosting a web-viewer" in line:
                break
        with urllib.request.urlopen(address, timeout=30) as page:
            assert page.status == 200
            assert b"rerun" in page.read().lower()
    finally:
        server.terminate()
        server.communicate(timeout=30)
    assert server.returncode == 0
