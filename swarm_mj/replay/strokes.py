"""Links that surprise, as lines between robots: whole, or broken in the middle if too weak."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int, UInt8

from swarm_mj.replay import palette
from swarm_mj.replay.looks import Surprises
from swarm_mj.replay.palette import Colour, dim

BROKEN = 0.36  # of a line's length, drawn at either end
# By kind; what is drawn first may be covered by what follows.
STROKES: dict[str, Colour] = {
    "unbelieved": palette.UNBELIEVED,
    "too_weak": dim(palette.TOO_WEAK, 0.7),
}
PIECES = {"unbelieved": 1, "too_weak": 2}  # that a line is drawn in


def strokes(
    kind: str, links: Surprises, position_m: Float[np.ndarray, "C N 2"]
) -> tuple[Float[np.ndarray, "S 2 2"], Int[np.ndarray, "S"]]:
    """Lines from start to end [m], and the link of each.

    Args:
        kind: One of `STROKES`.
        links: Of this kind.
        position_m: Where the robots are at each look [m].
    """
    start_m = position_m[links.row, links.sender]
    end_m = position_m[links.row, links.receiver]
    each = np.arange(len(links.row))
    if PIECES[kind] == 1:
        return np.stack([start_m, end_m], axis=1), each
    way_m = BROKEN * (end_m - start_m)
    pieces_m = np.stack([start_m, start_m + way_m, end_m - way_m, end_m], axis=1)
    return pieces_m.reshape(-1, 2, 2), np.repeat(each, PIECES[kind])


def strokes_at_once(
    links: Surprises, position_m: Float[np.ndarray, "N 2"]
) -> tuple[Float[np.ndarray, "S 2 2"], UInt8[np.ndarray, "S 3"]]:
    """Lines of one look's links of all kinds [m], and their colours."""
    here = replace(links, row=np.zeros(len(links.row), dtype=int))
    drawn = {
        kind: strokes(kind, found, position_m[None])[0] for kind, found in here.by_kind.items()
    }
    colours = [np.tile(np.array(STROKES[kind], np.uint8), (len(drawn[kind]), 1)) for kind in drawn]
    return np.concatenate(list(drawn.values())), np.concatenate(colours)
