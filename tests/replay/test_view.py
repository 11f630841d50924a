"""Replays open where there is a display, else in a browser; a video lasts as long as meant."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from types import SimpleNamespace

import pytest
from browsing import CHROMIUM, browser, page_of, share_of, until

from swarm_mj.replay import palette, view
from swarm_mj.replay.view import (
    LOOPBACK,
    VIEWER,
    VideoStyle,
    check_screen,
    default_seconds,
    fitted,
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


@pytest.fixture
def served(replay):
    """A replay's address, while it is served, and the file of what its server says."""
    command = [sys.executable, "-m", "swarm_mj", "replay", "--web", str(replay)]
    with tempfile.TemporaryFile("w+") as said:
        environment = {name: value for name, value in os.environ.items() if name != "RUST_LOG"}
        server = subprocess.Popen(command, stdout=said, stderr=said, text=True, env=environment)
        try:
            yield until(lambda: page_of(said)), said
        finally:
            server.terminate()
            server.communicate(timeout=30)
    assert server.returncode == 0


@pytest.mark.slow
def test_the_page_is_served_and_no_address_but_its_own_is_shown(served):
    address, said = served
    said.seek(0)
    assert said.read() == f"Open {address}\nCtrl-C ends it.\n"


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="it needs Chromium")
def test_a_browser_opens_with_our_layout(served, tmp_path):
    """Our plots have a ground of their own, which no view of rerun's automatic grid has."""
    with browser(served[0], tmp_path) as screenshot:
        until(lambda: share_of(palette.PLOT, screenshot()) > 0.1, limit_s=120.0)


def test_what_fails_is_said(tmp_path, capfd):
    assert run([*VIEWER, "--serve-web", str(tmp_path / "missing.rrd")]) == 1
    assert "missing.rrd" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("fps", "lasts_ms", "num_frames"),
    [(15, 70, 143), (25, 40, 250), (50, 20, 500), (1, 1000, 10), (40, 20, 500), (30, 30, 333)],
)
def test_a_gif_counts_in_hundredths_of_a_second(fps, lasts_ms, num_frames):
    """Ten seconds of pictures that last so long each."""
    style = fitted(VideoStyle(seconds=10.0, fps=fps), ".gif")
    assert 1000 / style.fps == pytest.approx(lasts_ms)
    assert style.num_frames == num_frames
    assert fitted(style, ".gif") == style
    assert abs(num_frames * lasts_ms - 10_000) <= lasts_ms / 2


def test_a_gif_cannot_be_as_fast_as_an_mp4():
    assert fitted(VideoStyle(fps=60), ".gif").fps == 50
    assert fitted(VideoStyle(fps=60), ".mp4").fps == 60


@pytest.mark.parametrize(("num_windows", "seconds"), [([3], 1.0), ([40, 25], 4.0), ([500], 10.0)])
def test_missions_are_shown_in_their_own_time_within_reason(num_windows, seconds):
    facts = SimpleNamespace(mission=SimpleNamespace(window_s=0.1))
    footages = [SimpleNamespace(window=range(number), facts=facts) for number in num_windows]
    assert default_seconds(footages) == pytest.approx(seconds)


def test_a_live_flight_needs_a_display_or_a_browser(monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(ValueError, match=r"no display .*; --live web"):
        check_screen("window")
    check_screen("web")


def test_a_viewer_that_does_not_open_is_said_in_a_line(monkeypatch):
    monkeypatch.setattr(view, "VIEWER", (sys.executable, "-c", "raise SystemExit(3)"))
    with pytest.raises(OSError, match=r"ended as it was opened \(exit code 3\); --live web"):
        view.live_viewer("window").__enter__()


def test_a_viewer_that_takes_no_data_is_given_up(monkeypatch):
    monkeypatch.setattr(view, "VIEWER", (sys.executable, "-c", "import time; time.sleep(60)"))
    monkeypatch.setattr(view, "OPENING_S", 0.3)
    with pytest.raises(OSError, match=r"took no data at port \d+ within 0.3 s"):
        view.live_viewer("window").__enter__()


@pytest.mark.slow
def test_the_server_of_a_live_flight_takes_data_and_ends_with_the_block():
    with view.live_viewer("web") as viewer:
        assert viewer.page.startswith("http://127.0.0.1:")
        assert viewer.address.split("/proxy")[0].split("//")[1] in viewer.page.replace(
            "%3A", ":"
        ).replace("%2F", "/")
        assert viewer.process.poll() is None
    assert viewer.process.poll() is not None
