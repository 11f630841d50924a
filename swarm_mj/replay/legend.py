"""The map's legend, a view of its own below the map: rerun has none."""

import itertools
import re

import numpy as np
import rerun as rr

from swarm_mj.replay import palette
from swarm_mj.replay.mismatch import PIECES, WHOLE
from swarm_mj.replay.palette import LOST_SHARE
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.rerun_log import LAYERS, RerunLog, screen

WIDTH = 100.0  # of the view, in units of its own, y down
LEFT, RAMP = 4.0, 31.0  # where the ramp of ages begins, and how long it is
COLUMN, ROW = 14.2, 8.4  # from one sample to the next, to the right of the ramp
SAMPLE = 5.0  # the length of a sample
RADII = {"radio/range": 2.0, "belief/ring": 0.8}  # of sampled rings
LAST = 5.1  # the height of the last row, with its texts
LINE = 1.9  # of a text's second line
TWO_ROWS = ROW + LAST
BELOW = 2.6  # from a sample to its text
NUM_SHADES = 60


def draw_legend(out: RerunLog, full_scale: float) -> None:
    """Draw the ramp of ages, to `full_scale` [windows], and samples of what the map shows."""
    _draw_ramp(out, full_scale)
    for row, samples in enumerate(_samples(out.log)):
        for column, (text, layer) in enumerate(samples.items()):
            x, y = LEFT + RAMP + (column + 0.9) * COLUMN, row * (ROW + _second_line(out.log))
            path = "legend/" + re.sub(r"\W", "_", text)
            _draw_sample(out, path, layer, x, y)
            _write(out, f"{path}/text", [text], [(x, y + BELOW)])


def height(log: Log) -> float:
    """Return the height of the view."""
    return (len(_samples(log)) - 1) * (ROW + _second_line(log)) + LAST + _second_line(log)


def _second_line(log: Log) -> float:
    """Return the room for texts' second lines, which they have beyond free space only."""
    return 0.0 if log.mismatch is None else LINE


def _samples(log: Log) -> list[dict[str, str]]:
    """Return rows of texts with their layers: the radio, what else is shown, mismatched links."""
    own, mismatch = f"r{log.ego}", log.mismatch
    others = {"heading": "heading", f"{own}'s belief": "belief/ring"} if log.has_motion else {}
    others[f"{own}'s tree"] = "tree"
    # Beyond free space, the circle is what the range would be.
    reach = {"radio range" if mismatch is None else "range in\nfree space": "radio/range"}
    if log.is_broadcast:
        packets = {"transmits": "radio/transmitter", "is heard by": "radio/heard"}
        rows = [packets | reach, others]
    else:
        fates = ("delivered", "lost", "answered", "overheard")
        rows = [{fate: f"radio/{fate}" for fate in fates}, others | reach]
    if mismatch is not None:
        texts = {"too_weak": "believed,\ntoo weak", "unbelieved": "works,\nunbelieved"}
        found = {kind for kind, links in mismatch.by_kind.items() if len(links.row) > 0}
        row = {text: f"world/{kind}" for kind, text in texts.items() if kind in found}
        if np.any(log.is_cut_off):
            row[f"cut off\nfrom {own}"] = "world/cut_off"
        rows += [row] if row else []
    return rows


def _draw_sample(out: RerunLog, path: str, name: str, x: float, y: float) -> None:
    """Draw a layer's line, arrow, ring or point around a place."""
    layer = LAYERS[f"arena/{name}"]
    start, radius = (x - SAMPLE / 2, y), RADII.get(name, 0.0)
    share = LOST_SHARE if name == "radio/lost" else 1.0
    kind = name.removeprefix("world/")
    way = x + SAMPLE * (PIECES.get(kind, WHOLE) - 0.5)
    shapes = {
        rr.LineStrips2D: {"strips": [[(a, y), (b, y)] for a, b in way]},
        rr.Arrows2D: {"origins": [start], "vectors": [(share * SAMPLE, 0.0)]},
        rr.Ellipses2D: {"centers": [(x, y)], "half_sizes": [(radius, radius)]},
        rr.Points2D: {"positions": [(x, y)]},
    }
    colour = {"colors": [palette.MISMATCH[kind]]} if kind in palette.MISMATCH else {}
    out.fixed(path, layer.kind.from_fields(**layer.style, **colour, **shapes[layer.kind]))


def _draw_ramp(out: RerunLog, full_scale: float) -> None:
    edges = LEFT + np.linspace(0.0, RAMP, NUM_SHADES + 1)
    strips = [[(a, 0.0), (b, 0.0)] for a, b in itertools.pairwise(edges)]
    colours = palette.ramp(full_scale, NUM_SHADES)
    out.fixed("legend/ramp", rr.LineStrips2D(strips, colors=colours, radii=screen(5.0)))
    texts = ["0", f"{full_scale / 2:g}", f"{full_scale:g} windows"]
    _write(out, "legend/ages", texts, [(LEFT + at * RAMP, BELOW) for at in (0.0, 0.5, 0.95)])
    about = f"age of what r{out.log.ego} knows"
    _write(out, "legend/about_ages", [about], [(LEFT + 0.5 * RAMP, ROW)])


def _write(out: RerunLog, path: str, texts: list[str], places: list[tuple[float, float]]) -> None:
    """Write texts as the labels of invisible points."""
    style = {"show_labels": True, "radii": screen(0.1), "colors": [palette.TEXT]}
    out.fixed(path, rr.Points2D.from_fields(positions=places, labels=texts, **style))
