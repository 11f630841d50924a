"""The headless picture as a process; taking one needs a Vulkan driver."""

import ctypes.util
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

TOOL = Path(__file__).parent.parent.parent / "tools" / "picture.py"
DRIVERS = [*Path("/usr/share/vulkan/icd.d").glob("*.json"), *Path("/etc/vulkan/icd.d").glob("*")]


@pytest.fixture
def picture(forks, tmp_path):
    """Runs the tool in an empty folder; returns the finished process."""
    return partial(forks.run, tmp_path, TOOL)


@pytest.fixture(scope="module")
def replay(forks, tmp_path_factory):
    folder = tmp_path_factory.mktemp("replay")
    flown = forks.run(folder, "swarm_mj", "fly", "--windows", 30, "--record", "a.rrd")
    assert flown.returncode == 0, flown.stderr
    return folder / "a.rrd"


@pytest.mark.skipif(
    not DRIVERS or not ctypes.util.find_library("vulkan"), reason="no Vulkan driver on this machine"
)
def test_a_picture_shows_something(replay, tmp_path):
    """In a process of its own: a fork lacks the threads by which rerun talks to its viewer."""
    line = [sys.executable, TOOL, replay, "--window", "20", "--out", "a.png", "--size", "1280x720"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    with Image.open(tmp_path / "a.png") as image:
        pixels = np.asarray(image.convert("RGB"))
    assert pixels.shape[1] == 1280
    # Bright robots on a dark floor: neither an empty window nor a single colour.
    assert (pixels.max(axis=2) > 180).mean() > 0.002
    assert (pixels.max(axis=2) < 40).mean() > 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--window", "31"], "window must be from 1 to 30, not 31"),
        (["--window", "0"], "window must be from 1 to 30, not 0"),
        (["--size", "big"], "size must be WIDTHxHEIGHT"),
        (["--out", "a.jpg"], "picture must be named *.png, not a.jpg"),
        (["--out", "."], "picture . is a folder"),
    ],
)
def test_bad_input_is_one_clear_line(picture, replay, tmp_path, arguments, complaint):
    done = picture(replay, *arguments)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []
