"""Links that surprise, as lines between robots: whole, or dashed if too weak."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int, UInt8

from swarm_mj.replay import palette
from swarm_mj.replay.looks import Surprises
from swarm_mj.replay.palette import Colour, dim

# Pieces that a line is drawn in, from where to where [of its length].
WHOLE = np.array([[0.0, 1.0]])
NUM_DASHES, DASH = 4, 0.6  # the dashes of a line, each so much of the way to the next one's start
DASHES = (np.arange(NUM_DASHES)[:, None] + [0.0, DASH]) / (NUM_DASHES - 1 + DASH)
# By kind; what is drawn first may be covered by what follows.
STROKES: dict[str, Colour] = {
    "unbelieved": palette.UNBELIEVED,
    "too_weak": dim(palette.TOO_WEAK, 0.7),
}
FAINTEST, FAINTEST_DB = 0.5, -30.0  # of a link that is too weak by so much or more
BRIGHTEST = 0.85  # of one that is hardly too weak
PIECES = {"unbelieved": WHOLE, "too_weak": DASHES}


def strokes(
    links: Surprises, position_m: Float[np.ndarray, "C N 2"], pieces: Float[np.ndarray, "P 2"]
) -> tuple[Float[np.ndarray, "S 2 2"], Int[np.ndarray, "S"]]:
    """Lines from start to end [m], and the link of each.

    Args:
        links: Which are drawn.
        position_m: Where the robots are at each look [m].
        pieces: That each is drawn in, `WHOLE` or `DASHES`.
    """
    start_m = position_m[links.row, links.sender]
    end_m = position_m[links.row, links.receiver]
    way_m = (end_m - start_m)[:, None, None]
    pieces_m = start_m[:, None, None] + pieces[None, :, :, None] * way_m
    return pieces_m.reshape(-1, 2, 2), np.repeat(np.arange(len(links.row)), len(pieces))


def shades(kind: str, links: Surprises) -> UInt8[np.ndarray, "L 3"]:
    """Return the colours of links of this kind: the more is missing, the darker."""
    colour = np.tile(np.array(STROKES[kind], dtype=np.uint8), (len(links.row), 1))
    if kind != "too_weak":
        return colour
    shares = np.interp(links.margin_db, [FAINTEST_DB, 0.0], [FAINTEST, BRIGHTEST])
    return (shares[:, None] * np.array(palette.TOO_WEAK)).astype(np.uint8)


def strokes_at_once(
    links: Surprises, position_m: Float[np.ndarray, "N 2"], observer: int
) -> tuple[Float[np.ndarray, "S 2 2"], UInt8[np.ndarray, "S 3"]]:
    """Lines of one look's links [m], and their colours; of those too weak, the observer's own.

    In a city there are so many of them that nobody could tell which robots each one joins.
    """
    is_own = (links.sender == observer) | (links.receiver == observer)
    links = links.chosen(is_own | ~links.is_too_weak)
    here = replace(links, row=np.zeros(len(links.row), dtype=int))
    lines, colours = [], []
    for kind, found in here.by_kind.items():
        line_m, link = strokes(found, position_m[None], PIECES[kind])
        lines.append(line_m)
        colours.append(shades(kind, found)[link])
    return np.concatenate(lines), np.concatenate(colours)
