"""The map's legend, a view of its own below the map: rerun has none."""

import itertools
import re
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
import rerun as rr

from swarm_mj.replay import palette
from swarm_mj.replay.arena import HALO_POINTS, LOST_SHARE
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.recorder import Log
from swarm_mj.replay.sheet import Sheet, screen

WIDTH, HEIGHT = 100.0, 13.5  # of the view, in units of its own, y down
LEFT, RAMP = 4.0, 31.0  # where the ramp of ages begins, and how long it is
COLUMN, ROW = 14.2, 8.4  # from one sample to the next, to the right of the ramp
SAMPLE = 5.0  # the length of a sample
BELOW = 2.6  # from a sample to its text
NUM_SHADES = 60

Sample: TypeAlias = Callable[[float, float], rr.AsComponents]  # draws it around x, y


def draw_legend(sheet: Sheet, full_scale: float) -> None:
    """The ramp of ages, and a sample of everything that the map shows.

    Args:
        sheet: Where to draw.
        full_scale: The age at which the ramp ends [windows].
    """
    _draw_ramp(sheet, full_scale)
    for row, samples in enumerate((packet_samples(sheet.log), ground_samples(sheet.log))):
        for column, (text, draw) in enumerate(samples.items()):
            x, y = LEFT + RAMP + (column + 0.9) * COLUMN, row * ROW
            path = "legend/" + re.sub(r"\W", "_", text)
            sheet.fixed(path, draw(x, y))
            _write(sheet, f"{path}/text", [text], [(x, y + BELOW)])


def packet_samples(log: Log) -> dict[str, Sample]:
    """What the map shows of the radio."""
    if log.is_broadcast:
        colour = palette.BROADCAST
        return {
            "transmits": _halo(colour),
            "is heard by": _line(colour, 1.0),
            "radio range": _ring(palette.RANGE, 0.6, 2.0),
        }
    return {
        "delivered": _arrow(palette.DELIVERED, 2.0),
        "lost": _arrow(palette.LOST, 1.8, LOST_SHARE),
        "answered": _arrow(palette.ANSWERED, 1.5),
        "overheard": _line(palette.dim(palette.OVERHEARD, 0.6), 0.7),
    }


def ground_samples(log: Log) -> dict[str, Sample]:
    """What else it shows."""
    ego = f"r{log.ego}"
    shown: dict[str, Sample] = {}
    if log.has_motion:
        shown["heading"] = _line(palette.HEADING, 0.8)
        shown[f"{ego}'s belief"] = _ring(palette.BELIEF, 0.8, 0.8)
    shown[f"{ego}'s tree"] = _line(palette.TREE, 0.8)
    if not log.is_broadcast:
        shown["radio range"] = _ring(palette.RANGE, 0.6, 2.0)
    return shown


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


def _line(colour: Colour, width: float) -> Sample:
    return lambda x, y: rr.LineStrips2D(
        [[(x - SAMPLE / 2, y), (x + SAMPLE / 2, y)]], colors=[colour], radii=screen(width)
    )


def _arrow(colour: Colour, width: float, share: float = 1.0) -> Sample:
    return lambda x, y: rr.Arrows2D(
        origins=[(x - SAMPLE / 2, y)],
        vectors=[(share * SAMPLE, 0.0)],
        colors=[colour],
        radii=screen(width),
    )


def _ring(colour: Colour, width: float, radius: float) -> Sample:
    return lambda x, y: rr.Ellipses2D(
        centers=[(x, y)], half_sizes=[(radius, radius)], colors=[colour], line_radii=screen(width)
    )


def _halo(colour: Colour) -> Sample:
    return lambda x, y: rr.Points2D([(x, y)], colors=[colour], radii=screen(HALO_POINTS))


def _write(sheet: Sheet, path: str, texts: list[str], places: list[tuple[float, float]]) -> None:
    """Texts as the labels of invisible points."""
    sheet.fixed(
        path,
        rr.Points2D(
            places, labels=texts, show_labels=True, radii=screen(0.1), colors=[palette.TEXT]
        ),
    )
