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
FAINTEST, FAINTEST_DB = 0.35, -30.0  # of a link that is too weak by so much or more
BRIGHTEST = 0.85  # of one that is hardly too weak
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


def shades(kind: str, links: Surprises) -> UInt8[np.ndarray, "L 3"]:
    """The colours of links of this kind: the more is missing, the darker."""
    colour = np.tile(np.array(STROKES[kind], dtype=np.uint8), (len(links.row), 1))
    if kind != "too_weak":
        return colour
    shares = np.interp(links.margin_db, [FAINTEST_DB, 0.0], [FAINTEST, BRIGHTEST])
    return (shares[:, None] * np.array(palette.TOO_WEAK)).astype(np.uint8)


def strokes_at_once(
    links: Surprises, position_m: Float[np.ndarray, "N 2"]
) -> tuple[Float[np.ndarray, "S 2 2"], UInt8[np.ndarray, "S 3"]]:
    """Lines of one look's links of all kinds [m], and their colours."""
    here = replace(links, row=np.zeros(len(links.row), dtype=int))
    lines, colours = [], []
    for kind, found in here.by_kind.items():
        line_m, link = strokes(kind, found, position_m[None])
        lines.append(line_m)
        colours.append(shades(kind, found)[link])
    return np.concatenate(lines), np.concatenate(colours)
