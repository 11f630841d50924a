"""`swarm-mj replay --video`: what is asked for is there, whole, or nothing is."""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import av
import pytest
from PIL import Image

from swarm_mj.cli import main, replay
from swarm_mj.replay.read import read_footage

SMALL = ("--size", "160x160", "--fps", "5")


pytestmark = pytest.mark.usefixtures("opengl")


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Two replays of the same mission."""
    folder = tmp_path_factory.mktemp("flown")
    for policy in ("tdma", "mst"):
        arguments = ["fly", "--robots", "5", "--windows", "12", "--range-ratio", "0.5"]
        record = ["--policy", policy, "--record", str(folder / f"{policy}.rrd")]
        assert main([*arguments, *record]) == 0
    return folder


@pytest.fixture
def tdma(flown):
    """One of them as an argument."""
    return str(flown / "tdma.rrd")


def shape(path):
    """Number of pictures, width and height."""
    if path.suffix == ".gif":
        with Image.open(path) as image:
            return image.n_frames, *image.size
    with av.open(str(path)) as container:
        stream = container.streams.video[0]
        return sum(1 for _ in container.decode(video=0)), stream.width, stream.height


def test_a_short_mission_lasts_as_long_as_it_did_and_replaces_a_video_by_force_only(
    tdma, here, capsys
):
    """12 windows of 100 ms at 5 pictures per second."""
    arguments = ["replay", tdma, "--video", "a.mp4", *SMALL]
    Path("a.mp4").write_text("old")
    assert main(arguments) == 2
    assert "exists" in capsys.readouterr().err
    assert Path("a.mp4").read_text() == "old"
    assert main([*arguments, "--force"]) == 0
    assert shape(here / "a.mp4") == (6, 160, 160)
    said = capsys.readouterr().out.strip()
    assert said.startswith("Wrote a.mp4: 1.2 s, 6 pictures of 160 by 160, 0.0")


def test_two_missions_make_one_gif(flown, here):
    files = [str(flown / f"{policy}.rrd") for policy in ("tdma", "mst")]
    assert main(["replay", *files, "--video", "a.gif", *SMALL, "--seconds", "2"]) == 0
    assert shape(here / "a.gif") == (10, 160, 160)


def test_a_video_by_the_chasing_camera_is_another_one(tdma, here):
    for camera in ("map", "chase"):
        arguments = ["replay", tdma, "--video", f"{camera}.mp4", "--camera", camera, *SMALL]
        assert main(arguments) == 0
        assert shape(here / f"{camera}.mp4") == (6, 160, 160)
    assert Path("map.mp4").read_bytes() != Path("chase.mp4").read_bytes()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        ("--video a.avi", "video must be named *.mp4 or *.gif, not a.avi"),
        ("--video a.mp4 --size big", "size must be WIDTHxHEIGHT from 160x160 to 3840x3840"),
        ("--video a.mp4 --size 161x160", "size of an MP4 must be even"),
        ("--video a.mp4 --web", "--web is not allowed with --video"),
        ("--seconds 5", "are of videos; name one by --video"),
        ("--theme light", "are of videos; name one by --video"),
        ("--camera chase", "are of videos; name one by --video"),
        ("--video a.mp4 --camera side", "camera must be one of map, chase, not"),
        ("--video a.mp4 --theme blue", "theme must be one of dark, light, not"),
        ("--picture a.png --video a.mp4", "--video is not allowed with --picture"),
        ("--picture a.jpg", "picture must be named *.png or *.svg or *.pdf, not a.jpg"),
        ("--picture a.png --size 320x200", "are of videos; name one by --video"),
        ("--window 3", "--window is of pictures; name one by --picture"),
        ("--force", "--scene and --force are of videos and pictures"),
        ("--picture a.png --window 999", "window must be from 1 to "),
        ("--video a.mp4 --fps 0", "fps"),
    ],
)
def test_bad_input_is_one_clear_line(tdma, here, capsys, arguments, complaint):
    assert main(["replay", tdma, *arguments.split()]) == 2
    said = capsys.readouterr().err
    assert complaint in said
    assert len(said.strip().splitlines()) == 1
    assert list(here.iterdir()) == []


def test_a_picture_of_one_window_needs_no_opengl(tdma, here, monkeypatch, capsys):
    monkeypatch.setenv("MUJOCO_GL", "off")
    for name, magic in (("a.svg", b"<?xml"), ("b.png", b"\x89PNG")):
        assert main(["replay", tdma, "--picture", name, "--window", "2"]) == 0
        assert (here / name).read_bytes().startswith(magic)
        assert capsys.readouterr().out == f"Wrote {name}\n"
    assert b"<!-- tdma -->" in (here / "a.svg").read_bytes()
    assert main(["replay", tdma, "--picture", "a.svg"]) == 2
    assert "a.svg exists" in capsys.readouterr().err


def test_an_interrupt_or_a_lack_of_opengl_leaves_nothing(tdma, here, monkeypatch, capsys):
    def interrupted(*_):
        raise KeyboardInterrupt

    arguments = ["replay", tdma, "--video", "a.mp4", *SMALL]
    with monkeypatch.context() as broken:
        broken.setattr("swarm_mj.replay.rendering.video.Movie.picture", interrupted)
        assert main(arguments) == 130
    monkeypatch.setenv("MUJOCO_GL", "off")
    assert main(arguments) == 1
    assert "MUJOCO_GL=off switches rendering off" in capsys.readouterr().err
    assert list(here.iterdir()) == []


@pytest.mark.slow
def test_the_first_picture_of_a_process_needs_no_variables(tdma, here):
    """MuJoCo is loaded long before a video chooses how to render."""
    code = (
        "import os, mujoco, swarm_mj.cli as cli; assert 'MUJOCO_GL' not in os.environ;"
        f"raise SystemExit(cli.main(['replay', {tdma!r}, '--video', 'a.mp4', *{SMALL}]))"
    )
    clean = {name: value for name, value in os.environ.items() if "GL" not in name}
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, env=clean, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert shape(here / "a.mp4")[0] == 6


PILLAR = """
import mujoco


def pillar(spec, mission):
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_BOX, size=[60, 60, 20], rgba=[1, 0, 0, 1], pos=[0, 0, 20]
    )
"""


@pytest.mark.parametrize("name", ["x[/b]", "line\nbreak", "\x1b[31mred", "long " * 40])
def test_a_scene_s_name_in_a_file_is_text_and_no_more(tdma, capsys, name):
    footage = read_footage(Path(tdma))
    elsewhere = replace(footage, facts=replace(footage.facts, scene=name))
    assert replay._in_scene(elsewhere, None) is elsewhere
    said = capsys.readouterr().err
    assert said.endswith(f"The mission was flown in the scene {name!r}.\n")
    assert said.count("\n") == 1


def num_red(path):
    """Pixels of the pillar in the first picture."""
    with av.open(str(path)) as container:
        picture = next(container.decode(video=0)).to_ndarray(format="rgb24").astype(int)
    return int(((picture[..., 0] > 90) & (picture[..., 1:].max(axis=-1) < 60)).sum())


def test_a_scene_of_ones_own_is_shown_when_it_is_named_again(here, capsys):
    """The name in a replay's file may be anybody's: it is told, and not loaded."""
    Path("scene_of_a_replay.py").write_text(PILLAR)
    flight = ["fly", "--task", "stationary", "--robots", "5", "--windows", "6", "--range-ratio"]
    scene = ["--scene", "scene_of_a_replay:pillar"]
    assert main([*flight, "0.5", "--policy", "tdma", "--record", "a.rrd", *scene]) == 0
    video = ["replay", "a.rrd", "--video"]
    capsys.readouterr()
    assert main([*video, "bare.mp4", *SMALL]) == 0
    said = capsys.readouterr().err
    assert said.endswith("flown in the scene 'scene_of_a_replay:pillar'; --scene shows it, too.\n")
    assert main([*video, "whole.mp4", *SMALL, *scene]) == 0
    assert "bare arena" not in capsys.readouterr().err
    assert num_red(here / "bare.mp4") == 0
    assert num_red(here / "whole.mp4") > 20
    assert main([*video, "none.mp4", *SMALL, "--scene", "scene_of_a_replay:pilar"]) == 2
    assert "pillar" in capsys.readouterr().err
