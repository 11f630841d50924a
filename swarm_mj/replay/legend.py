"""The map's legend, a view of its own below the map: rerun has none."""

import itertools
import re

import numpy as np
import rerun as rr

from swarm_mj.replay import palette
from swarm_mj.replay.layers import LAYERS, screen
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.sheet import Sheet
from swarm_mj.replay.shots import LOST_SHARE
from swarm_mj.replay.strokes import PIECES, STROKES, WHOLE

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


def draw_legend(sheet: Sheet, full_scale: float) -> None:
    """The ramp of ages, which ends at `full_scale` [windows], and samples of what the map shows."""
    _draw_ramp(sheet, full_scale)
    for row, samples in enumerate(_samples(sheet.log)):
        for column, (text, layer) in enumerate(samples.items()):
            x, y = LEFT + RAMP + (column + 0.9) * COLUMN, row * _row(sheet.log)
            path = "legend/" + re.sub(r"\W", "_", text)
            _draw_sample(sheet, path, layer, x, y)
            _write(sheet, f"{path}/text", [text], [(x, y + BELOW)])


def height(log: Log) -> float:
    """Of the view."""
    last = LAST if log.looks is None else LAST + LINE
    return (len(_samples(log)) - 1) * _row(log) + last


def _row(log: Log) -> float:
    """From one row of samples to the next; beyond free space, texts have two lines."""
    return ROW if log.looks is None else ROW + LINE


def _samples(log: Log) -> list[dict[str, str]]:
    """Rows of texts, of the radio, of what else is shown and of a world beyond free space.

    With each text goes the layer that it names.
    """
    others = {"heading": "heading", f"r{log.ego}'s belief": "belief/ring"} if log.has_motion else {}
    others[f"r{log.ego}'s tree"] = "tree"
    of_world = _samples_of_world(log)
    # Elsewhere, the circle is what the range would be.
    reach = {"radio range" if log.looks is None else "range in\nfree space": "radio/range"}
    if log.is_broadcast:
        packets = {"transmits": "radio/transmitter", "is heard by": "radio/heard"}
        return [packets | reach, others, *of_world]
    fates = ("delivered", "lost", "answered", "overheard")
    return [{fate: f"radio/{fate}" for fate in fates}, others | reach, *of_world]


def _samples_of_world(log: Log) -> list[dict[str, str]]:
    """Return a row, if there is anything to name in it."""
    if log.looks is None:
        return []
    texts = {"too_weak": "believed,\ntoo weak", "unbelieved": "works,\nunbelieved"}
    found = {kind: len(links.row) > 0 for kind, links in log.looks.surprises.by_kind.items()}
    row = {text: f"world/{kind}" for kind, text in texts.items() if found[kind]}
    if np.any(log.is_cut_off):
        row[f"cut off\nfrom r{log.ego}"] = "world/cut_off"
    return [row] if row else []


def _draw_sample(sheet: Sheet, path: str, name: str, x: float, y: float) -> None:
    """Return a layer's line, arrow, ring or point around a place."""
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
    colour = {"colors": [STROKES[kind]]} if kind in STROKES else {}
    sheet.fixed(path, layer.kind.from_fields(**layer.style, **colour, **shapes[layer.kind]))


def _draw_ramp(sheet: Sheet, full_scale: float) -> None:
    edges = LEFT + np.linspace(0.0, RAMP, NUM_SHADES + 1)
    ages = np.linspace(0.0, full_scale, NUM_SHADES)
    strips = [[(a, 0.0), (b, 0.0)] for a, b in itertools.pairwise(edges)]
    colours = palette.age_colours(ages, full_scale, np.ones(NUM_SHADES, dtype=bool))
    sheet.fixed("legend/ramp", rr.LineStrips2D(strips, colors=colours, radii=screen(5.0)))
    texts = ["0", f"{full_scale / 2:g}", f"{full_scale:g} windows"]
    places = [(LEFT + share * RAMP, BELOW) for share in (0.0, 0.5, 0.95)]
    _write(sheet, "legend/ages", texts, places)
    about = f"age of what r{sheet.log.ego} knows"
    _write(sheet, "legend/about_ages", [about], [(LEFT + 0.5 * RAMP, ROW)])


def _write(sheet: Sheet, path: str, texts: list[str], places: list[tuple[float, float]]) -> None:
    """Texts as the labels of invisible points."""
    style = {"show_labels": True, "radii": screen(0.1), "colors": [palette.TEXT]}
    sheet.fixed(path, rr.Points2D.from_fields(positions=places, labels=texts, **style))
