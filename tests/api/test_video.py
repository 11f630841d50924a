"""A flight is a video in a notebook and in files; elsewhere one is told how to see it."""

import sys
from types import SimpleNamespace

import pytest

import swarm_mj
from swarm_mj.api import video
from swarm_mj.replay.rendering.style import VideoStyle

TINY = {"num_robots": 4, "num_windows": 3, "range_ratio": 2.0}


@pytest.fixture
def small(monkeypatch):
    """Small pictures, of which there are few."""
    for suffix in (".mp4", ".gif"):
        monkeypatch.setitem(video.DEFAULTS, suffix, VideoStyle(width=320, height=200, fps=4))


@pytest.mark.usefixtures("opengl", "small")
@pytest.mark.parametrize("suffix", [".mp4", ".gif"])
def test_a_flight_is_saved_as_a_video(tmp_path, suffix):
    run = swarm_mj.fly("stationary", policy="tdma", **TINY)
    path = run.save(tmp_path / f"a{suffix}")
    header = {".mp4": (4, b"ftyp"), ".gif": (0, b"GIF89a")}
    at, magic = header[suffix]
    assert path.read_bytes()[at:].startswith(magic)


@pytest.mark.usefixtures("opengl", "small")
def test_a_notebook_plays_it(monkeypatch):
    shown = []
    shell = SimpleNamespace(kernel=None)
    display = SimpleNamespace(
        Video=lambda **video: SimpleNamespace(**video), display=lambda video: shown.append(video)
    )
    ipython = SimpleNamespace(get_ipython=lambda: shell, display=display)
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    swarm_mj.fly("stationary", policy="tdma", **TINY).show()
    (video,) = shown
    assert video.data[4:8] == b"ftyp"  # as every MP4 begins
    assert video.embed is True
    assert video.mimetype == "video/mp4"


def test_elsewhere_nothing_opens(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "IPython", SimpleNamespace(get_ipython=lambda: None))
    swarm_mj.fly("stationary", policy="tdma", record=False, **TINY).show()
    assert "run.save('flight.mp4') writes the video" in capsys.readouterr().out


def test_what_was_not_recorded_cannot_be_shown(monkeypatch):
    monkeypatch.setattr("swarm_mj.api.run.is_notebook", lambda: True)
    run = swarm_mj.fly("stationary", policy="tdma", record=False, **TINY)
    with pytest.raises(ValueError, match="fly with record=True"):
        run.show()
