"""The themes of videos: a dark one, as replays are, and a light one for pages that are white.

Ages and the packets' fates keep their colours of `replay.palette`; what is around them differs.
"""

from dataclasses import dataclass

from swarm_mj.replay import palette
from swarm_mj.replay.palette import Colour


@dataclass(frozen=True, kw_only=True)
class Theme:
    """The colours of a video's frame and ground."""

    background: Colour  # around the ground, and of the frame
    grid: Colour  # of the plot's field
    squares: tuple[Colour, Colour]  # of the floor
    wall: Colour
    text: Colour
    note: Colour  # of texts that matter less
    ego: Colour
    ego_name: str  # that colour, in a word
    heading: Colour
    rim: Colour | None  # around robots, where bright ones would be lost on the ground
    strength: float  # of packets' colours, which are darker on a bright ground
    curves: tuple[Colour, Colour]  # of the mean ages, of one flight and of a second

    def mixed(self, colour: Colour, share: float) -> Colour:
        """Return a share of a colour over the background, for what matters less."""
        red, green, blue = (
            round(share * ours + (1.0 - share) * behind)
            for ours, behind in zip(colour, self.background, strict=True)
        )
        return (red, green, blue)

    def shown(self, colour: Colour) -> Colour:
        """Return a packet's colour, strong enough for the ground."""
        return palette.dim(colour, self.strength)


DARK = Theme(
    background=palette.BACKGROUND,
    grid=palette.GRID,
    squares=((26, 31, 38), (31, 36, 46)),
    wall=(115, 128, 148),
    text=palette.TEXT,
    note=palette.SENT,
    ego=palette.EGO,
    ego_name="white",
    heading=palette.HEADING,
    rim=None,
    strength=1.0,
    curves=palette.FILM_CURVES,
)
LIGHT = Theme(
    background=(255, 255, 255),
    grid=(240, 242, 246),
    squares=((238, 240, 244), (230, 233, 239)),
    wall=(150, 160, 178),
    text=(24, 26, 32),
    note=(86, 92, 104),
    ego=(10, 10, 14),
    ego_name="black",
    heading=(70, 76, 88),
    rim=(92, 98, 110),
    strength=0.72,
    curves=((24, 26, 32), (196, 32, 118)),
)
THEMES = {"dark": DARK, "light": LIGHT}
