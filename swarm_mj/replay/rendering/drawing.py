"""What stands around the scene in a video: titles, a legend, and the course of the age."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float, Int, Int16
from PIL import Image, ImageDraw, ImageFont

from swarm_mj.mission.presets import where_flown
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.mismatch import DASHES, WHOLE
from swarm_mj.replay.palette import Colour, dim

CURVES: tuple[Colour, ...] = (palette.MEAN_AGE, palette.VARIANCE)  # of one flight, and a second
FAINT = 0.45  # what is still to come, and texts that matter less
SHADE = 0.35  # of columns behind a curve
NUM_SHADES = 48
SHORTFALL = "missing to decode"  # what the numbers beside robots say
TAG = 2  # of dark ground around a number [pixels]
LABELS_FIRST = 1000  # a number had rather cover so many robots than another number
ROOM, STEP = 3.7, 1.1  # for a legend's samples, and from one to the next [of the text's size]


@dataclass(frozen=True)
class Box:
    """A part of the picture [pixels]."""

    left: int
    top: int
    right: int
    bottom: int

    @property
    def width(self) -> int:
        """From left to right."""
        return self.right - self.left

    @property
    def height(self) -> int:
        """From top to bottom."""
        return self.bottom - self.top


@cache
def font(size: int) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
    """Pillow's own font, in pixels."""
    return ImageFont.load_default(size)


def draw_title(
    draw: ImageDraw.ImageDraw, footage: Footage, row: int, box: Box, size: int, curve: Colour
) -> None:
    """Policy, mission, own parts, time above a scene, and its mean age in its curve's colour."""
    facts = footage.facts
    mission = facts.mission
    left, top, pad = box.left, box.top, size // 2
    draw.text((left + pad, top + pad), facts.policy, palette.TEXT, font(round(1.3 * size)))
    about = f"{mission.task}, {mission.num_robots} robots, seed {facts.seed}"
    where = ", ".join(where_flown(mission)).split(", ")
    about = "\n".join([about, *filter(None, where), *facts.own_parts])
    draw.text((left + pad, top + pad + 1.7 * size), about, palette.SENT, font(round(0.8 * size)))
    now = footage.window[row]
    time = f"{now * mission.window_s:.1f} s, window {now}"
    age = f"age {footage.age_mean[row]:.1f}"
    right = box.right - pad
    draw.text((right, top + pad), age, curve, font(round(1.3 * size)), anchor="ra")
    small, below = font(round(0.8 * size)), top + pad + 1.7 * size
    draw.text((right, below), time, palette.SENT, small, anchor="ra")
    if (num := int(np.sum(footage.is_cut_off[row]))) > 0:
        told = f"{num} cut off from r{facts.observer}"
        draw.text((right, below + size), told, palette.TOO_WEAK, small, anchor="ra")


def draw_legend(
    draw: ImageDraw.ImageDraw, footages: Sequence[Footage], full_scale: float, box: Box, size: int
) -> None:
    """Return the ramp of ages, and what the colours of packets mean."""
    small = font(round(0.8 * size))
    who = f"colour: age of what {_observers(footages)} (white) knows"
    draw.text((box.left, box.top), who, palette.TEXT, small)
    y, high = box.top + 1.25 * size, 0.55 * size
    edges = np.linspace(box.left, box.right, NUM_SHADES + 1)
    shades = palette.age_colours(
        np.linspace(0.0, full_scale, NUM_SHADES), full_scale, np.ones(NUM_SHADES, dtype=bool)
    )
    for k, colour in enumerate(shades.tolist()):
        draw.rectangle((edges[k], y, edges[k + 1], y + high), tuple(colour))
    y += 1.3 * high
    draw.text((box.left, y), "0", palette.SENT, small)
    draw.text((box.right, y), f"{full_scale:g} windows or more", palette.SENT, small, anchor="ra")
    samples = {"never heard of": palette.UNKNOWN}
    if any(np.any(each.velocity_mps) for each in footages):
        samples["heading"] = palette.HEADING
    samples |= _packet_colours(footages) | _surprise_colours(footages)
    _draw_samples(draw, samples, Box(box.left, round(y + 1.3 * size), box.right, box.bottom), size)


def _draw_samples(
    draw: ImageDraw.ImageDraw, samples: dict[str, Colour], box: Box, size: int
) -> None:
    """Sample in two columns; the more there are, the closer."""
    step = min(STEP, ROOM / ((len(samples) + 1) // 2)) * size
    small = font(round(min(0.8 * size, 0.9 * step)))
    for k, (text, colour) in enumerate(samples.items()):
        x, line = box.left + (k % 2) * box.width / 2, box.top + step * (k // 2)
        if text == SHORTFALL:
            _draw_tag(draw, "dB", x, line, small)
        else:
            _draw_sample(draw, colour, x, line + 0.45 * size, size)
        draw.text((x + 1.5 * size, line), text, palette.SENT, small)


def _draw_sample(
    draw: ImageDraw.ImageDraw, colour: Colour, x: float, middle: float, size: int
) -> None:
    """A disc for robots, and a line for packets and links; of those too weak, a dashed one."""
    if colour in (palette.UNKNOWN, palette.CUT_OFF):
        centre, radius = x + 0.6 * size, 0.3 * size
        disc = (centre - radius, middle - radius, centre + radius, middle + radius)
        draw.ellipse(disc, colour)
        return
    pieces = DASHES if colour == palette.MISMATCH["too_weak"] else WHOLE
    for a, b in (x + 1.2 * size * pieces).round().tolist():
        draw.line((a, middle, b - 1, middle), colour, max(2, size // 6))


def draw_shortfalls(
    draw: ImageDraw.ImageDraw,
    robots: Float[np.ndarray, "N 2"],
    others: Int16[np.ndarray, "K"],
    margin_db: Int16[np.ndarray, "K"],
    size: int,
) -> None:
    """By how much links are too weak, each beside the robot at its far end.

    Args:
        draw: Where.
        robots: Where all robots are in the picture [pixels].
        others: The robots at the far ends.
        margin_db: Of their links [dB].
        size: Of the text [pixels].
    """
    small, shown = font(round(0.75 * size)), np.zeros((0, 4))
    for robot, margin in zip(others.tolist(), margin_db.tolist(), strict=True):
        text = f"{margin} dB"
        width, high = draw.textlength(text, small) + 2 * TAG, 0.95 * size
        # To the right, to the left, below or above: where it covers least.
        sides = np.array([[0.7, -0.5], [-0.7, -0.5], [-0.5, 0.8], [-0.5, -1.8]])
        sides = sides * size + [[0.0, 0.0], [-width, 0.0], [0.0, 0.0], [0.0, 0.0]]
        low = robots[robot] + sides
        boxes = np.hstack([low, low + np.array([width, high])])
        on_robots = np.hstack([robots - 0.4 * size, robots + 0.4 * size])
        covered = LABELS_FIRST * _num_met(boxes, shown) + _num_met(boxes, on_robots)
        best = int(np.argmin(covered))
        if covered[best] < LABELS_FIRST:
            x, y = low[best].tolist()
            _draw_tag(draw, text, x + TAG, y, small)
            shown = np.vstack([shown, boxes[best]])


def _num_met(
    boxes: Float[np.ndarray, "S 4"], others: Float[np.ndarray, "O 4"]
) -> Int[np.ndarray, "S"]:
    """How many of the others each box overlaps."""
    one, other = boxes[:, None], others[None]
    is_met = (one[..., :2] < other[..., 2:]) & (other[..., :2] < one[..., 2:])
    return np.sum(np.all(is_met, axis=2), axis=1)


def _draw_tag(
    draw: ImageDraw.ImageDraw,
    text: str,
    x: float,
    y: float,
    small: ImageFont.FreeTypeFont | ImageFont.ImageFont,
) -> None:
    """Return a text on a dark ground, so that it is read before anything."""
    left, top, right, bottom = draw.textbbox((x, y), text, small)
    draw.rectangle((left - TAG, top - TAG, right + TAG, bottom + TAG), palette.BACKGROUND)
    draw.text((x, y), text, palette.TOO_WEAK, small)


def _packet_colours(footages: Sequence[Footage]) -> dict[str, Colour]:
    """What packets of these missions may look like."""
    colours: dict[str, Colour] = {}
    if any(each.facts.is_broadcast for each in footages):
        colours["packet heard"] = palette.BROADCAST
    if not all(each.facts.is_broadcast for each in footages):
        colours |= {"delivered": palette.DELIVERED, "lost": palette.LOST}
        colours |= {"answered": palette.ANSWERED, "overheard": palette.OVERHEARD}
    return colours


def _surprise_colours(footages: Sequence[Footage]) -> dict[str, Colour]:
    """What links that surprise look like, if there are any, and robots that are cut off."""
    found = [each.mismatch.by_kind for each in footages if each.mismatch is not None]
    texts = {
        "too_weak": f"{_observers(footages)}'s link, too weak",
        "unbelieved": "works, unbelieved",
    }
    shown = [kind for kind in texts if any(len(of[kind].row) for of in found)]
    colours = {texts[kind]: palette.MISMATCH[kind] for kind in shown}
    if "too_weak" in shown:
        colours[SHORTFALL] = palette.TOO_WEAK
    if any(np.any(each.is_cut_off) for each in footages):
        colours[f"halo: cut off from {_observers(footages)} now"] = palette.CUT_OFF
    return colours


def _observers(footages: Sequence[Footage]) -> str:
    return " and ".join(dict.fromkeys(f"r{each.facts.observer}" for each in footages))


class AgePlot:
    """The mean age over the mission, of one flight or two, on a common axis."""

    def __init__(self, footages: Sequence[Footage], box: Box, size: int) -> None:
        """Prepare the curves."""
        self._box, self._size = box, size
        self._inner = Box(
            box.left + 2 * size, round(box.top + 1.4 * size), box.right, box.bottom - size
        )
        self._end_s = max(each.window[-1] * each.facts.mission.window_s for each in footages)
        self._top = palette.nice_top(max(float(np.max(each.age_mean)) for each in footages))
        self._curves = [self._curve(each) for each in footages]
        self._cut_off = footages[0] if len(footages) == 1 else None

    def draw_axes(self, draw: ImageDraw.ImageDraw) -> None:
        """What does not change: title, numbers, and the whole curves, faintly."""
        small, inner = font(round(0.8 * self._size)), self._inner
        title = "mean age of information [windows]"
        draw.rectangle((inner.left, inner.top, inner.right, inner.bottom), palette.GRID)
        if self._cut_off is not None and np.any(self._cut_off.is_cut_off):
            title += f"; red: robots cut off from {_observers([self._cut_off])}, full height 100 %"
            self._draw_cut_off(draw, self._cut_off)
        draw.text((inner.left, self._box.top), title, palette.TEXT, small)
        for y, value in ((inner.top, f"{self._top:g}"), (inner.bottom, "0")):
            draw.text((inner.left - 4, y), value, palette.SENT, small, anchor="rm")
        below = inner.bottom + 2
        draw.text((inner.left, below), "0", palette.SENT, small)
        draw.text((inner.right, below), f"{self._end_s:g} s", palette.SENT, small, anchor="ra")
        for curve, colour in zip(self._curves, CURVES, strict=False):
            draw.line([tuple(point) for point in curve.tolist()], dim(colour, FAINT), 1)

    def draw_until(self, draw: ImageDraw.ImageDraw, rows: Sequence[int]) -> None:
        """Return the curves so far, and where they are now."""
        radius, width = max(2.0, self._size / 5), max(2, self._size // 8)
        for curve, colour, row in zip(self._curves, CURVES, rows, strict=False):
            points = [tuple(point) for point in curve[: row + 1].tolist()]
            if row > 0:
                draw.line(points, colour, width, joint="curve")
            x, y = points[-1]
            draw.ellipse((x - radius, y - radius, x + radius, y + radius), colour)

    def _draw_cut_off(self, draw: ImageDraw.ImageDraw, footage: Footage) -> None:
        """The share of the others cut off from the observer, as columns; full height is all."""
        num_others = footage.facts.mission.num_robots - 1
        inner, share = self._inner, np.sum(footage.is_cut_off, axis=1) / num_others
        x = inner.left + inner.width * footage.window * footage.facts.mission.window_s / self._end_s
        for left, right, part in zip([inner.left, *x[:-1]], x, share, strict=True):
            if part > 0.0:
                top = inner.bottom - part * inner.height
                draw.rectangle((left, top, right, inner.bottom), dim(palette.CUT_OFF, SHADE))

    def _curve(self, footage: Footage) -> Float[np.ndarray, "T 2"]:
        """Return a flight's ages as points of the picture."""
        inner, seconds = self._inner, footage.window * footage.facts.mission.window_s
        x = inner.left + inner.width * seconds / self._end_s
        return np.stack([x, inner.bottom - inner.height * footage.age_mean / self._top], axis=1)


def blank(width: int, height: int) -> Image.Image:
    """Return an empty picture."""
    return Image.new("RGB", (width, height), palette.BACKGROUND)
