"""The size, length, smoothness and cost of a video; imported without what draws."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from swarm_mj.system.needs import ADDRESSES, LIBRARIES, OF_RERUN, Needs

if TYPE_CHECKING:
    from swarm_mj.replay.footage import Footage

LONGEST_S, SHORTEST_S = 10.0, 1.0  # unless given
GIF = ".gif"
TICKS_HZ = 100  # a GIF counts in hundredths of a second
MIN_TICKS = 2  # viewers show what is shorter much longer
MAX_MISSIONS = 2  # side by side


@dataclass(frozen=True, kw_only=True)
class VideoStyle:
    """How a video is made."""

    width: int = 1280  # [pixels]
    height: int = 720
    seconds: float = LONGEST_S  # in which the whole mission is shown
    fps: int | float = 25  # pictures per second

    @property
    def num_frames(self) -> int:
        """The number of pictures."""
        return max(1, round(self.seconds * self.fps))


DEFAULTS = {".mp4": VideoStyle(), GIF: VideoStyle(width=830, height=520, fps=15)}


def fitted(style: VideoStyle, suffix: str) -> VideoStyle:
    """Adapt a style to a kind of file: a GIF's pictures last whole hundredths of a second.

    Raise ValueError for more pictures per second than a GIF can show.
    """
    if suffix != GIF:
        return style
    max_fps = TICKS_HZ // MIN_TICKS
    if style.fps > max_fps:
        raise ValueError(
            f"fps of a GIF must be at most {max_fps}, not {style.fps:g}; or make an MP4"
        )
    return replace(style, fps=TICKS_HZ / round(TICKS_HZ / style.fps))


def default_seconds(footages: "Sequence[Footage]") -> float:
    """Return the missions' own time, if that is neither short nor long."""
    flown_s = max(len(each.window) * each.facts.mission.window_s for each in footages)
    return min(LONGEST_S, max(SHORTEST_S, flown_s))


def video_needs(width: int, height: int, num_pictures: int | float, suffix: str) -> Needs:
    """Return what `replay --video` takes; a GIF's pictures are kept until the last is drawn."""
    pixels = width * height
    kept = num_pictures if suffix == GIF else 0.0
    return Needs(
        memory=3.0 * LIBRARIES + (130.0 + 1.5 * kept) * pixels,
        addresses=ADDRESSES + OF_RERUN,
        file=0.1e6 + 0.05 * num_pictures * pixels,
    )
