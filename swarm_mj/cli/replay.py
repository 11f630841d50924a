"""`swarm-mj replay`: opens recorded missions, or makes a video of them."""

import re
import shlex
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from swarm_mj.mission.components import SHOWN_AS, Components, is_own
from swarm_mj.replay import view
from swarm_mj.replay.view import run as run_viewer
from swarm_mj.system.fields import setting
from swarm_mj.system.needs import YES, check_fits
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import WorkBar, plain_console
from swarm_mj.system.writing import Output, check_outputs, write_bytes

if TYPE_CHECKING:
    from swarm_mj.replay.footage import Footage

VIDEO = "video"  # a heading of the help
_video = partial(setting, group=VIDEO)
OWN_TIME = f"the mission's own time, {view.LONGEST_S:g} at most"
BARE = "the bare arena"
SUFFIXES = ".mp4|.gif"
PIXELS = (160, 3840)  # of a side


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
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
    size: str | None = _video(
        None, "in pixels", metavar="WIDTHxHEIGHT", shown="1280x720; GIF: 830x520"
    )
    seconds: float | None = _video(
        None, "in which the whole mission is shown", unit="s", low=0.1, high=600.0, shown=OWN_TIME
    )
    fps: int | None = _video(
        None, "pictures per second, of a GIF 50 at most", low=1, high=60, shown="25; GIF: 15"
    )
    scene: str | None = _video(
        None, "the scene of your own that the mission was flown in", metavar=SHOWN_AS, shown=BARE
    )
    force: bool = _video(False, "replace an existing video")
    yes: bool = _video(False, YES)


def run(options: ReplayOptions) -> int:
    """Run the command; return its exit code."""
    if options.video is not None:
        return _make_video(options, options.video)
    if options.size or options.seconds or options.fps or options.force or options.scene:
        raise ValueError(
            "--size, --seconds, --fps, --scene and --force are of videos; name one by --video"
        )
    from swarm_mj.replay.read import check_replay  # rerun is slow to import

    for file in options.file:
        check_replay(file)
    if not options.web:
        return run_viewer(view.view_command(*options.file))
    command, address = view.serve_command(*options.file)
    plain_console().print(f"Open {address}\nCtrl-C ends it.")
    return run_viewer(command)


def _make_video(options: ReplayOptions, video: Path) -> int:
    if options.web:
        raise ValueError("--web is not allowed with --video; leave one out")
    if len(options.file) > view.MAX_MISSIONS:
        raise ValueError(f"a video shows 1 or {view.MAX_MISSIONS} replays, not {len(options.file)}")
    check_outputs(
        Output("video", video, SUFFIXES), inputs=options.file, must_be_new=not options.force
    )
    suffix = video.suffix.lower()
    style = _style(options, suffix)
    needs = view.video_needs(style.width, style.height, style.num_frames, suffix)
    check_fits(needs, video, "choose a smaller --size or fewer --seconds", is_forced=options.yes)
    for module in ("av", "PIL", "rerun"):
        need(module, "a video")
    from swarm_mj.replay.read import read_footage
    from swarm_mj.replay.rendering.video import make_video  # MuJoCo is slow to import

    with Console(stderr=True, highlight=False).status("Reading ..."):
        footages = [_in_scene(read_footage(file), options.scene) for file in options.file]
    style = replace(style, seconds=options.seconds or view.default_seconds(footages))
    with WorkBar("Rendering", style.num_frames, "pictures") as bar:
        content = make_video(footages, suffix, style, bar.advance)
    write_bytes(video, content)
    number, name = style.num_frames, shlex.quote(str(video))
    plain_console().print(
        f"Wrote {name}: {number / style.fps:.3g} s, {number} pictures of {style.width} by "
        f"{style.height}, {len(content) / 1e6:.1f} MB"
    )
    return 0


def _style(options: ReplayOptions, suffix: str) -> view.VideoStyle:
    """Return the style asked for; raise ValueError for what the kind of file cannot have."""
    style = view.DEFAULTS[suffix]
    if options.size:
        match = re.fullmatch(r"(\d{1,5})x(\d{1,5})", options.size)
        width, height = (int(number) for number in match.groups()) if match else (0, 0)
        low, high = PIXELS
        if not (low <= width <= high and low <= height <= high):
            allowed = f"WIDTHxHEIGHT from {low}x{low} to {high}x{high}"
            raise ValueError(f"size must be {allowed}, not {options.size}")
        if suffix == ".mp4" and (width % 2 or height % 2):  # H.264 halves the colours' resolution
            raise ValueError(f"size of an MP4 must be even numbers, not {options.size}")
        style = replace(style, width=width, height=height)
    seconds, fps = options.seconds or style.seconds, options.fps or style.fps
    return view.fitted(replace(style, seconds=seconds, fps=fps), suffix)


def _in_scene(footage: "Footage", scene: str | None) -> "Footage":
    """Add the scene named here: the name in a file is somebody else's, and is never loaded."""
    flown_in = footage.facts.scene
    if scene is not None:
        return replace(footage, **Components(scene=scene).made(footage.facts.mission).given)
    if flown_in is not None:
        hint = "; --scene shows it, too." if is_own(flown_in) else "."
        text = f"The video shows {BARE}. The mission was flown in the scene {flown_in!r}"
        plain_console(is_error=True).print(text + hint)
    return footage
