"""The map's legend, drawn below the area: rerun has none of its own."""

import itertools

import numpy as np
import rerun as rr

from swarm_mj.replay import palette
from swarm_mj.replay.sheet import Sheet, screen

NUM_SHADES = 60
BELOW = 0.03  # from a sample to its text, as a share of the map


def draw_legend(sheet: Sheet, full_scale: float, reach_m: float) -> None:
    """The ramp of ages and one sample of every packet's shape.

    Args:
        sheet: Where to draw.
        full_scale: The age at which the ramp ends [windows].
        reach_m: Half the width of the map, which is centred on the origin [m].
    """
    _draw_ramp(sheet, full_scale, reach_m)
    _draw_samples(sheet, reach_m)


def _draw_ramp(sheet: Sheet, full_scale: float, reach_m: float) -> None:
    left, right, y = -0.92 * reach_m, -0.38 * reach_m, -1.08 * reach_m
    edges = np.linspace(left, right, NUM_SHADES + 1)
    ages = np.linspace(0.0, full_scale, NUM_SHADES)
    strips = [[(a, y), (b, y)] for a, b in itertools.pairwise(edges)]
    colours = palette.age_colours(ages, full_scale, np.ones(NUM_SHADES, dtype=bool))
    sheet.fixed(
        "arena/legend/ramp",
        rr.LineStrips2D(strips, colors=colours, radii=screen(5.0), draw_order=40),
    )
    texts = [f"age {share * full_scale:g}" for share in (0.0, 0.5)] + [f"{full_scale:g} windows"]
    places = [(x, y - BELOW * reach_m) for x in (left, (left + right) / 2, right)]
    _write(sheet, "arena/legend/ages", texts, places)


def _draw_samples(sheet: Sheet, reach_m: float) -> None:
    y, length = -1.08 * reach_m, 0.14 * reach_m
    starts = np.array([-0.08, 0.21, 0.5, 0.79]) * reach_m
    samples = [
        ("delivered", palette.DELIVERED, 2.0, 1.0),
        ("lost", palette.LOST, 1.8, 0.6),
        ("answered", palette.ANSWERED, 1.5, 1.0),
        ("overheard", palette.dim(palette.OVERHEARD, 0.6), 0.7, 1.0),
    ]
    for x, (name, colour, width, share) in zip(starts, samples, strict=True):
        if name == "overheard":
            strip = [[(x, y), (x + length, y)]]
            drawn = rr.LineStrips2D(strip, colors=[colour], radii=screen(width), draw_order=40)
        else:
            drawn = rr.Arrows2D(
                origins=[(x, y)],
                vectors=[(share * length, 0.0)],
                colors=[colour],
                radii=screen(width),
                draw_order=40,
            )
        sheet.fixed(f"arena/legend/{name}", drawn)
    _write(
        sheet,
        "arena/legend/packets",
        [name for name, *_ in samples],
        [(x + length / 2, y - BELOW * reach_m) for x in starts],
    )


def _write(sheet: Sheet, path: str, texts: list[str], places: list[tuple[float, float]]) -> None:
    """Texts as the labels of invisible points."""
    sheet.fixed(
        path,
        rr.Points2D(
            places,
            labels=texts,
            show_labels=True,
            radii=screen(0.1),
            colors=[palette.TEXT],
            draw_order=40,
        ),
    )
