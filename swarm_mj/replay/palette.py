"""The colours of replays and videos: one ramp for every age, one colour for every packet's fate.

The ramp is viridis reversed (bright is fresh); the packets' colours are Okabe and Ito's, which stay
apart for colour-blind eyes. Maps, scenes, plots and legends share them.
"""

from typing import Literal, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, UInt8

Colour: TypeAlias = tuple[int, int, int]  # red, green and blue, 0 to 255
Ages: TypeAlias = Float[np.ndarray, "*S"]  # [windows]; nan: unknown

# What becomes of a packet: `links.fates` says when.
Fate: TypeAlias = Literal["overheard", "unanswered", "heard", "lost", "delivered", "answered"]
# How channel and belief differ on a link: it decodes without belief, or is believed but too weak.
LinkKind: TypeAlias = Literal["unbelieved", "too_weak"]
# What a robot does with its radio in a window.
RadioState: TypeAlias = Literal[
    "silent", "overhears", "answers", "is lost", "delivers", "hears", "transmits"
]


def dim(colour: Colour, share: float) -> Colour:
    """Return a darker shade: alpha on 2D lines only darkens, so darken plainly."""
    red, green, blue = colour
    return (int(red * share), int(green * share), int(blue * share))


# What stands still.
BACKGROUND: Colour = (13, 16, 22)
PLOT: Colour = (48, 54, 67)  # both a light and a dark time cursor are seen on it
GRID: Colour = (30, 36, 46)
WALL: Colour = (112, 122, 138)
OUTLINE: Colour = (44, 52, 66)
OBSTACLE: Colour = (34, 40, 51)
RANGE: Colour = (44, 55, 74)
TEXT: Colour = (255, 255, 255)

# Robots, and what is known of them; others have the colour of an age.
EGO: Colour = (255, 255, 255)
UNKNOWN: Colour = (84, 86, 94)
SWITCHED_OFF: Colour = (46, 48, 54)
HEADING: Colour = (205, 210, 220)
THRUST: Colour = (240, 200, 80)  # of bodies, in 3-D
TRAIL: Colour = (50, 60, 76)
TREE: Colour = (78, 90, 112)
BELIEF: Colour = (104, 118, 144)
BELIEF_ERROR: Colour = dim(BELIEF, 0.8)

# Packets.
DELIVERED: Colour = (0, 205, 145)
BROADCAST: Colour = (86, 180, 233)
SENT: Colour = (196, 203, 214)
LOST: Colour = (240, 98, 42)
LOST_REST: Colour = dim(LOST, 0.5)  # of the way that a lost packet did not come
OVERHEARD: Colour = (204, 121, 167)
ANSWERED: Colour = (86, 180, 233)

# Links on which channel and belief differ, and robots without any that works.
TOO_WEAK: Colour = (232, 70, 94)  # links that policies believe in, but that do not decode
UNBELIEVED: Colour = (0, 148, 108)  # links that decode, but that policies do not believe in
CUT_OFF: Colour = (150, 38, 56)
HALO = 1.7  # the radius around a robot that is cut off, by the robot's

# Curves.
MEAN_AGE: Colour = (53, 183, 121)
WORST_AGE: Colour = (150, 158, 172)
VARIANCE: Colour = (240, 200, 80)
AGREED: Colour = (255, 255, 255)
LEARNED: Colour = MEAN_AGE  # by the policy in training
REFERENCES: tuple[Colour, ...] = (VARIANCE, (86, 180, 233), (204, 121, 167), (196, 203, 214))
# The mean age in videos, of one flight and of a second: no colours of the ramp, which mean ages.
FILM_CURVES: tuple[Colour, Colour] = ((255, 255, 255), (255, 120, 190))


class PacketStyle(NamedTuple):
    """How packets with the same fate are drawn in space."""

    colour: Colour
    share: float = 1.0  # of the way to the receiver: a lost packet stops short of it


LOST_SHARE = 0.6
# What is drawn first may be covered by what follows.
PACKETS: dict[Fate, PacketStyle] = {
    "overheard": PacketStyle(colour=dim(OVERHEARD, 0.6)),
    "unanswered": PacketStyle(colour=dim(ANSWERED, 0.6), share=LOST_SHARE),
    "heard": PacketStyle(colour=BROADCAST),
    "lost": PacketStyle(colour=LOST, share=LOST_SHARE),
    "delivered": PacketStyle(colour=DELIVERED),
    "answered": PacketStyle(colour=ANSWERED),
}
# The fates that charts count, by their curves' colours.
COUNTED: dict[Fate, Colour] = {
    "delivered": DELIVERED,
    "lost": LOST,
    "overheard": OVERHEARD,
    "answered": ANSWERED,
}
# What a robot does with its radio if packets have an addressee.
ADDRESSED_STATES: dict[RadioState, Colour] = {
    "silent": BACKGROUND,
    "overhears": OVERHEARD,
    "answers": ANSWERED,
    "is lost": LOST,
    "delivers": DELIVERED,
}
# And what it does if they have none.
BROADCAST_STATES: dict[RadioState, Colour] = {
    "silent": BACKGROUND,
    "hears": RANGE,
    "transmits": BROADCAST,
}
# What is drawn first may be covered by what follows.
MISMATCH: dict[LinkKind, Colour] = {"unbelieved": UNBELIEVED, "too_weak": dim(TOO_WEAK, 0.7)}

# Nine equal steps of viridis (van der Walt and Smith, 2015, CC0), stale to fresh.
_RGB = bytes.fromhex("440154 472c7a 3b518b 2c718e 21908d 27ad81 5cc863 aadc32 fde725")
_VIRIDIS = np.frombuffer(_RGB, dtype=np.uint8).reshape(-1, 3)
_STALEST = 0.10  # the darkest end of viridis would vanish on the background
ROUND = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 10.0)


def age_colours(age_windows: Ages, full_scale: float) -> UInt8[np.ndarray, "*S 3"]:
    """RGB of ages: yellow is fresh, dark violet is `full_scale` or older, grey is unknown (nan)."""
    share = np.clip(np.nan_to_num(age_windows) / full_scale, 0.0, 1.0)
    place = (1.0 - (1.0 - _STALEST) * share) * (len(_VIRIDIS) - 1)
    steps = np.arange(len(_VIRIDIS))
    rgb = np.stack([np.interp(place, steps, _VIRIDIS[:, c]) for c in range(3)], axis=-1)
    rgb[np.isnan(age_windows)] = UNKNOWN
    return rgb.astype(np.uint8)


def robot_colours(
    age_windows: Ages, full_scale: float, is_on: Bool[np.ndarray, "*S"], ego: int
) -> UInt8[np.ndarray, "*S 3"]:
    """RGB of robots by the age of what the ego robot knows of them; it is white, dark ones off."""
    colours = age_colours(age_windows, full_scale)
    colours[..., ego, :] = EGO
    return np.where(is_on[..., None], colours, np.array(SWITCHED_OFF, np.uint8))


def nice_top(value: float) -> float:
    """Return the next round number, or 1, for an axis that has numbers at both ends."""
    if value <= 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(step * decade for step in ROUND if step * decade >= value))
