"""How large, how long and how smooth a video is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # it loads what draws
    from swarm_mj.replay.footage import Footage

LONGEST_S, SHORTEST_S = 10.0, 1.0  # unless told otherwise
GIF = ".gif"
TICKS_HZ = 100  # a GIF counts in hundredths of a second
LEAST_TICKS = 2  # viewers show what is shorter much longer


@dataclass(frozen=True, kw_only=True)
class Style:
    """How a video is made."""

    width: int = 1280  # [pixels]
    height: int = 720
    seconds: float = LONGEST_S  # in which the whole mission is shown
    fps: int | float = 25  # pictures per second

    @property
    def num_frames(self) -> int:
        """How many pictures there are."""
        return max(1, round(self.seconds * self.fps))


USUAL = {".mp4": Style(), GIF: Style(width=830, height=520, fps=15)}


def fitted(style: Style, suffix: str) -> Style:
    """A style as a kind of file can have it: a GIF's pictures last whole hundredths of a second.

    Args:
        style: What is asked for.
        suffix: `.mp4` or `.gif`.

    Raises:
        ValueError: A GIF cannot show so many pictures per second.
    """
    if suffix != GIF:
        return style
    most = TICKS_HZ // LEAST_TICKS
    if style.fps > most:
        raise ValueError(f"fps of a GIF must be at most {most}, not {style.fps:g}; or make an MP4")
    return replace(style, fps=TICKS_HZ / round(TICKS_HZ / style.fps))


def usual_seconds(footages: "Sequence[Footage]") -> float:
    """In which a video shows whole missions: their own time, if that is neither short nor long."""
    flown_s = max(len(each.window) * each.facts.mission.window_s for each in footages)
    return min(LONGEST_S, max(SHORTEST_S, flown_s))
