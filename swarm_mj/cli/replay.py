"""`swarm-mj replay`: opens recorded missions, or makes a video of them."""

import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from swarm_mj.cli.machine import YES
from swarm_mj.cli.outputs import Output, check_outputs
from swarm_mj.cli.progress import WorkBar
from swarm_mj.cli.terminal import plain_console
from swarm_mj.fields import setting
from swarm_mj.io.atomic import write_bytes
from swarm_mj.io.interrupt import heard_interrupt
from swarm_mj.io.packages import need
from swarm_mj.parts import SHOWN_AS, OwnParts
from swarm_mj.replay.view import run as run_viewer
from swarm_mj.replay.view import serve_command, view_command

if TYPE_CHECKING:
    from swarm_mj.replay.footage import Footage

VIDEO = "video"  # a heading of the help
SUFFIXES = ".mp4|.gif"
SIZES = {".mp4": "1280x720", ".gif": "830x520"}
RATES = {".mp4": 25, ".gif": 15}  # pictures per second
LONGEST_S, SHORTEST_S = 10.0, 1.0  # of a video, unless told otherwise
PIXELS = (160, 3840)  # of a side


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of `swarm-mj replay`."""

    file: tuple[Path, ...] = setting(
        help=".rrd files that `swarm-mj fly` recorded", is_positional=True
    )
    web: bool = setting(
        False, "serve it to a browser, on this machine's loopback address only, until Ctrl-C"
    )
    video: Path | None = setting(
        None,
        "make a video instead, of one mission or of two side by side: FILE.mp4 or FILE.gif",
        group=VIDEO,
    )
    size: str | None = setting(
        None, "in pixels", group=VIDEO, metavar="WIDTHxHEIGHT", shown="1280x720; GIF: 830x520"
    )
    seconds: float | None = setting(
        None,
        "in which the whole mission is shown",
        group=VIDEO,
        unit="s",
        low=0.1,
        high=600.0,
        shown=f"the mission's own time, {LONGEST_S:g} at most",
    )
    fps: int | None = setting(
        None, "pictures per second", group=VIDEO, low=1, high=60, shown="25; GIF: 15"
    )
    scene: str | None = setting(
        None,
        "the scene of your own that the mission was flown in",
        group=VIDEO,
        metavar=SHOWN_AS,
        shown="the bare arena",
    )
    force: bool = setting(False, "replace an existing video", group=VIDEO)
    yes: bool = setting(False, YES, group=VIDEO)


def run(options: Options) -> int:
    """Runs the command; returns its exit code."""
    if options.video is not None:
        return _make_video(options, options.video)
    if options.size or options.seconds or options.fps or options.force or options.scene:
        raise ValueError(
            "--size, --seconds, --fps, --scene and --force are of videos; name one by --video"
        )
    from swarm_mj.replay.read import check_replay  # rerun takes its time to import

    for file in options.file:
        check_replay(file)
    if not options.web:
        return run_viewer(view_command(*options.file))
    command, address = serve_command(*options.file)
    plain_console().print(f"Open {address}\nCtrl-C ends it.")
    return run_viewer(command)


def _make_video(options: Options, video: Path) -> int:
    from swarm_mj.cli.estimates import check_fits, video_needs  # with all that flies

    if options.web:
        raise ValueError("--web is not allowed with --video; leave one out")
    check_outputs(
        Output("video", video, SUFFIXES), inputs=options.file, must_be_new=not options.force
    )
    suffix = video.suffix.lower()
    width, height = _size(options.size or SIZES[suffix], suffix)
    fps = options.fps or RATES[suffix]
    needs = video_needs(width, height, (options.seconds or LONGEST_S) * fps, suffix)
    check_fits(needs, video, "choose a smaller --size or fewer --seconds", is_forced=options.yes)
    for module in ("av", "PIL", "rerun"):
        need(module, "a video")
    from swarm_mj.rendering.movie import Style  # rerun and MuJoCo take their time to import
    from swarm_mj.rendering.video import check_video, make_video

    with heard_interrupt() as was_pressed:
        with Console(stderr=True, highlight=False).status("Reading ..."):
            footages, seconds = _read(options)
        style = Style(width=width, height=height, seconds=seconds, fps=fps)
        with WorkBar("Rendering", style.num_frames, "pictures") as bar:
            content = make_video(footages, suffix, style, bar.advance)
        if was_pressed():
            raise KeyboardInterrupt
    write_bytes(video, content, check=lambda part: check_video(part, suffix, style))
    shown = f"{style.num_frames / fps:.3g} s, {style.num_frames} pictures of {width} by {height}"
    name = shlex.quote(str(video))
    plain_console().print(f"Wrote {name}: {shown}, {len(content) / 1e6:.1f} MB")
    return 0


def _read(options: Options) -> tuple[list["Footage"], float]:
    """What is to be seen, and how long the video is [s]."""
    from swarm_mj.rendering.movie import MOST_MISSIONS
    from swarm_mj.replay.read import read_footage

    if len(options.file) > MOST_MISSIONS:
        raise ValueError(f"a video shows 1 or {MOST_MISSIONS} replays, not {len(options.file)}")
    footages = [_in_scene(read_footage(file), options.scene) for file in options.file]
    return footages, options.seconds or usual_seconds(footages)


def _in_scene(footage: "Footage", scene: str | None) -> "Footage":
    """With the scene named here: the name in a file is somebody else's, and is never loaded."""
    flown_in = footage.facts.scene
    if scene is not None:
        return replace(footage, **OwnParts(scene=scene).made(footage.facts.mission))
    if flown_in is not None:
        Console(stderr=True, highlight=False).print(
            f"The video shows the bare arena. The mission was flown in the scene {flown_in}; "
            "--scene shows it, too."
        )
    return footage


def usual_seconds(footages: "Sequence[Footage]") -> float:
    """In which a video shows whole missions: their own time, if that is neither short nor long."""
    flown_s = max(len(each.window) * each.facts.mission.window_s for each in footages)
    return min(LONGEST_S, max(SHORTEST_S, flown_s))


def _size(text: str, suffix: str) -> tuple[int, int]:
    """Width and height, as typed."""
    match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", text)
    width, height = (int(number) for number in match.groups()) if match else (0, 0)
    low, high = PIXELS
    if not (low <= width <= high and low <= height <= high):
        raise ValueError(f"size must be WIDTHxHEIGHT from {low}x{low} to {high}x{high}, not {text}")
    if suffix == ".mp4" and (width % 2 or height % 2):
        raise ValueError(f"size of an MP4 must be even numbers, not {text}")
    return width, height
