"""Packets as they are drawn in space: from where to where, and in which colour."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int, UInt8

from swarm_mj.replay import palette
from swarm_mj.replay.links import Links
from swarm_mj.replay.palette import Colour, dim

LOST_SHARE = 0.6  # a lost packet stops short of its receiver
# What is drawn first may be covered by what follows.
LOOKS: dict[str, tuple[Colour, float]] = {
    "overheard": (dim(palette.OVERHEARD, 0.6), 1.0),
    "unanswered": (dim(palette.ANSWERED, 0.6), LOST_SHARE),
    "heard": (palette.BROADCAST, 1.0),
    "lost": (palette.LOST, LOST_SHARE),
    "delivered": (palette.DELIVERED, 1.0),
    "answered": (palette.ANSWERED, 1.0),
}


@dataclass(frozen=True, kw_only=True)
class Shots:
    """L packets."""

    row: Int[np.ndarray, "L"]  # the window of each, from 0
    start_m: Float[np.ndarray, "L 2"]  # [m]
    end_m: Float[np.ndarray, "L 2"]
    colour: UInt8[np.ndarray, "L 3"]


def ends_of(
    fate: str, links: Links, position_m: Float[np.ndarray, "T N 2"]
) -> tuple[Float[np.ndarray, "L 2"], Float[np.ndarray, "L 2"]]:
    """From where to where packets with this fate are drawn [m]."""
    start = position_m[links.row, links.sender]
    return start, start + LOOKS[fate][1] * (position_m[links.row, links.receiver] - start)


def shots(packets: dict[str, Links], position_m: Float[np.ndarray, "T N 2"]) -> Shots:
    """Packets of all fates, sorted by window; a packet that was lost stops on its way."""
    rows, starts, ends, colours = [], [], [], []
    for fate, (colour, _) in LOOKS.items():
        if fate not in packets:
            continue
        start, end = ends_of(fate, packets[fate], position_m)
        rows.append(packets[fate].row)
        starts.append(start)
        ends.append(end)
        colours.append(np.tile(np.array(colour, dtype=np.uint8), (len(start), 1)))
    return in_order(rows, starts, ends, colours)


def in_order(
    rows: Sequence[np.ndarray],
    starts: Sequence[np.ndarray],
    ends: Sequence[np.ndarray],
    colours: Sequence[np.ndarray],
) -> Shots:
    """Packets of several fates, sorted by window."""
    row = np.concatenate(rows)
    order = np.argsort(row, kind="stable")
    start_m, end_m, colour = (np.concatenate(each)[order] for each in (starts, ends, colours))
    return Shots(row=row[order], start_m=start_m, end_m=end_m, colour=colour)
