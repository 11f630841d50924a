"""`swarm-mj replay`: opens recorded missions, or makes a video or a picture of them."""

import re
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from swarm_mj.evaluation.figures import quiet_matplotlib
from swarm_mj.replay import view
from swarm_mj.replay.rendering.theme import THEMES
from swarm_mj.simulation.components import SHOWN_AS, Components
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import GONE_IN, files_read, setting, the_file
from swarm_mj.system.interrupt import raise_if_interrupted
from swarm_mj.system.packages import need
from swarm_mj.system.terminal import WorkBar, plain_console, say_written
from swarm_mj.system.user_code import files_named, is_own
from swarm_mj.system.writing import Output, check_outputs, write_bytes

if TYPE_CHECKING:
    from swarm_mj.replay.footage import Footage

# Headings of the help.
VIDEO = "video"
PICTURE = "picture"
_video = partial(setting, group=VIDEO)
OWN_TIME = f"the mission's own time, {view.LONGEST_S:g} at most"
BARE = "the bare arena"


@dataclass(frozen=True, kw_only=True)
class ReplayOptions:
    """The options of `swarm-mj replay`."""

    file: tuple[Path, ...] = setting(
        help=".rrd files that `swarm-mj fly` recorded", is_positional=True, reads=the_file
    )
    web: bool = setting(
        False, "serve it to a browser, on this machine's loopback address only, until Ctrl-C"
    )
    video: Path | None = setting(
        None,
        "make a video instead, of one mission or of two side by side: FILE.mp4 or FILE.gif",
        group=VIDEO,
    )
    picture: Path | None = setting(
        None,
        "draw the map of one window instead, for a slide",
        metavar="FILE.png|.svg|.pdf",
        group=PICTURE,
    )
    window: int | None = setting(
        None, "which window; 1 is the first", low=1, high=10**9, shown="the last", group=PICTURE
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
    theme: str = _video("dark", "colours of the frame and the ground", choices=tuple(THEMES))
    camera: str = setting(
        view.MAP,
        "where it is seen from: above, or by one that flies behind the observer",
        choices=view.CAMERAS,
        group=VIDEO,
    )
    scene: str | None = _video(
        None,
        "the scene of your own that the mission was flown in; of a picture, too",
        metavar=SHOWN_AS,
        shown=BARE,
        reads=files_named,
    )
    force: bool = _video(False, "replace an existing video or picture")
    yes: bool = _video(False, f"ignored: videos need no estimate; removed in {GONE_IN}")


def run(options: ReplayOptions) -> int:
    """Run the command; return its exit code."""
    _check_together(options)
    if options.video is not None:
        return _make_video(options, options.video)
    if options.picture is not None:
        return _draw_picture(options, options.picture)
    from swarm_mj.replay.read import check_replay  # rerun is slow to import

    for file in options.file:
        check_replay(file)
    if not options.web:
        return view.run(view.view_command(*options.file))
    command, address = view.serve_command(*options.file)
    plain_console().print(f"Open {address}\nCtrl-C ends it.")
    return view.run(command)


def _check_together(options: ReplayOptions) -> None:
    """Raise ValueError for options that have no use together, or no use alone."""
    ways = {"--web": options.web, "--video": options.video, "--picture": options.picture}
    named: list[str] = []
    for way, value in ways.items():
        if value:
            named.append(way)
    if len(named) > 1:
        raise ValueError(f"{named[0]} is not allowed with {named[1]}; leave one out")
    is_styled = options.size or options.seconds or options.fps or options.theme != "dark"
    is_styled = is_styled or options.camera != view.MAP
    if not options.video and is_styled:
        raise ValueError(
            "--size, --seconds, --fps, --theme and --camera are of videos; name one by --video"
        )
    if not options.picture and options.window:
        raise ValueError("--window is of pictures; name one by --picture")
    if not (options.video or options.picture) and (options.force or options.scene):
        raise ValueError(
            "--scene and --force are of videos and pictures; name one by --video or --picture"
        )


def _draw_picture(options: ReplayOptions, picture: Path) -> int:
    file, *others = options.file
    if others:
        raise ValueError(f"a picture shows 1 replay, not {len(options.file)}; name one")
    written = Output("picture", picture, ".png|.svg|.pdf")
    check_outputs(written, inputs=files_read(options), must_be_new=not options.force)
    for module in ("matplotlib", "rerun"):
        need(module, "a picture")
    quiet_matplotlib()
    with Console(stderr=True, highlight=False).status("Drawing ..."):
        from swarm_mj.api.picture import draw_picture
        from swarm_mj.evaluation.figures.style import save
        from swarm_mj.replay.read import read_footage

        footage = _in_scene(read_footage(file), options.scene)
        save(draw_picture(footage, options.window), picture)
    say_written(picture)
    return DONE


def _make_video(options: ReplayOptions, video: Path) -> int:
    written = Output("video", video, ".mp4|.gif")
    check_outputs(written, inputs=files_read(options), must_be_new=not options.force)
    suffix = video.suffix.lower()
    style = _style(options, suffix)
    for module in ("av", "PIL", "rerun"):
        need(module, "a video")
    from swarm_mj.replay.read import read_footage
    from swarm_mj.replay.rendering.video import make_video  # MuJoCo is slow to import

    with Console(stderr=True, highlight=False).status("Reading ..."):
        footages = [_in_scene(read_footage(file), options.scene) for file in options.file]
    style = replace(style, seconds=options.seconds or view.default_seconds(footages))
    with WorkBar("Rendering", style.num_frames, "pictures") as bar:
        content = make_video(footages, suffix, style, bar.advance)
    raise_if_interrupted()  # an encoder may have swallowed it
    write_bytes(video, content)
    number = style.num_frames
    about = f"{number / style.fps:.3g} s, {number} pictures of {style.width} by {style.height}"
    say_written(video, f"{about}, {len(content) / 1e6:.1f} MB")
    return DONE


def _style(options: ReplayOptions, suffix: str) -> view.VideoStyle:
    """Return the style asked for; raise ValueError for what the kind of file cannot have."""
    style = view.DEFAULTS[suffix]
    if options.size:
        low = 160  # of a side
        high = 3840
        width = 0  # of what is no size
        height = 0
        match = re.fullmatch(r"(?P<width>\d{1,5})x(?P<height>\d{1,5})", options.size)
        if match:
            width = int(match["width"])
            height = int(match["height"])
        if not (low <= width <= high and low <= height <= high):
            allowed = f"WIDTHxHEIGHT from {low}x{low} to {high}x{high}"
            raise ValueError(f"size must be {allowed}, not {options.size}")
        if suffix == ".mp4" and (width % 2 or height % 2):  # H.264 halves the colours' resolution
            raise ValueError(f"size of an MP4 must be even numbers, not {options.size}")
        style = replace(style, width=width, height=height)
    seconds = options.seconds or style.seconds
    fps = options.fps or style.fps
    style = replace(style, seconds=seconds, fps=fps, theme=options.theme, camera=options.camera)
    return view.fitted(style, suffix)


def _in_scene(footage: "Footage", scene: str | None) -> "Footage":
    """Add the scene named here: the name in a file is somebody else's, and is never loaded."""
    flown_in = footage.facts.scene
    if scene is not None:
        return replace(footage, **Components(scene=scene).made(footage.facts.mission).given)
    if flown_in is not None:
        hint = "; --scene shows it, too." if is_own(flown_in) else "."
        text = f"It shows {BARE}. The mission was flown in the scene {flown_in!r}"
        plain_console(is_error=True).print(text + hint)
    return footage
