"""The colours of replays and videos: one ramp for every age, one colour for every packet's fate.

The ramp is viridis reversed (bright is fresh); the packets' colours are Okabe and Ito's, which stay
apart for colour-blind eyes. Maps, scenes, plots and legends share them. Those with a name stand in
`palette.toml`, and are attributes of this module, such as `palette.LOST`.
"""

import tomllib
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float, UInt8

Colour: TypeAlias = tuple[int, int, int]
Ages: TypeAlias = Float[np.ndarray, "*S"]  # [windows]; nan: unknown

_TEXT = Path(__file__).with_suffix(".toml").read_text("utf-8")
_SAID: dict[str, dict[str, Any]] = tomllib.loads(_TEXT)
COLOURS: dict[str, Colour] = {name: tuple(rgb) for name, rgb in _SAID["colours"].items()}
HALO = 1.7  # the radius around a robot that is cut off, by the robot's
# The mean age in videos, of one flight and of a second: no colours of the ramp, which mean ages.
FILM_CURVES = COLOURS["FILM_CURVE"], COLOURS["SECOND_FILM_CURVE"]


def __getattr__(name: str) -> Colour:
    """Return a colour by its name."""
    if name not in COLOURS:
        raise AttributeError(f"the palette has no {name}")
    return COLOURS[name]


def dim(colour: Colour, share: float) -> Colour:
    """Return a darker shade: alpha on 2D lines only darkens, so darken plainly."""
    return (int(colour[0] * share), int(colour[1] * share), int(colour[2] * share))


class PacketStyle(NamedTuple):
    """How packets with the same fate are drawn in space."""

    colour: Colour
    share: float = 1.0  # of the way to the receiver: a lost packet stops short of it


def _by(use: str) -> dict[str, Colour]:
    return {name: COLOURS[colour] for name, colour in _SAID[use].items()}


LOST_SHARE = 0.6
# By fate. What is drawn first may be covered by what follows.
PACKETS = {
    fate: PacketStyle(dim(COLOURS[colour], shade), LOST_SHARE if stops_short else 1.0)
    for fate, (colour, shade, stops_short) in _SAID["packets"].items()
}
# The fates that charts count, by their curves' colours.
COUNTED = _by("counted")
# What a robot does with its radio in a window, if packets have an addressee and if not.
SILENT = "silent"
ADDRESSED_STATES, BROADCAST_STATES = _by("addressed_states"), _by("broadcast_states")
# Links on which channel and belief differ, by kind, in the same order.
MISMATCH = {"unbelieved": COLOURS["UNBELIEVED"], "too_weak": dim(COLOURS["TOO_WEAK"], 0.7)}

# Nine equal steps of viridis (van der Walt and Smith, 2015, CC0), stale to fresh.
_RGB = bytes.fromhex("440154 472c7a 3b518b 2c718e 21908d 27ad81 5cc863 aadc32 fde725")
_VIRIDIS = np.frombuffer(_RGB, dtype=np.uint8).reshape(-1, 3)
ROUND = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 10.0)
_STALEST = 0.10  # the darkest end of viridis would vanish on the background


def age_colours(age_windows: Ages, full_scale: float) -> UInt8[np.ndarray, "*S 3"]:
    """RGB of ages: yellow is fresh, dark violet is `full_scale` or older, grey is unknown (nan)."""
    share = np.clip(np.nan_to_num(age_windows) / full_scale, 0.0, 1.0)
    place = (1.0 - (1.0 - _STALEST) * share) * (len(_VIRIDIS) - 1)
    steps = np.arange(len(_VIRIDIS))
    rgb = np.stack([np.interp(place, steps, _VIRIDIS[:, c]) for c in range(3)], axis=-1)
    rgb[np.isnan(age_windows)] = COLOURS["UNKNOWN"]
    return rgb.astype(np.uint8)


def robot_colours(
    age_windows: Ages, full_scale: float, is_on: Bool[np.ndarray, "*S"], ego: int
) -> UInt8[np.ndarray, "*S 3"]:
    """RGB of robots by the age of what the ego robot knows of them; it is white, dark ones off."""
    colours = age_colours(age_windows, full_scale)
    colours[..., ego, :] = COLOURS["EGO"]
    return np.where(is_on[..., None], colours, np.array(COLOURS["SWITCHED_OFF"], np.uint8))


def nice_scale(age_windows: Ages) -> float:
    """Return a round number of windows that 19 ages in 20 lie below."""
    # Without the oldest: robots that are hardly ever reached would make all others look alike.
    return nice_top(max(1.0, float(np.percentile(age_windows, 95))))


def nice_top(value: float) -> float:
    """Return the next round number, or 1, for an axis that has numbers at both ends."""
    if value <= 0.0:
        return 1.0
    decade = 10.0 ** np.floor(np.log10(value))
    return float(next(step * decade for step in ROUND if step * decade >= value))
