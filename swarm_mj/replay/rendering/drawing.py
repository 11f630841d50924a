"""The frame around a video's scene: titles, a legend, and the mean age over time."""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Float, Int, Int16
from PIL import ImageFont
from PIL.ImageDraw import ImageDraw

from swarm_mj.radio.words import where_flown
from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.links import DASHES, WHOLE
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.rendering.theme import DARK, Theme

FAINT = 0.45  # what is still to come, and texts that matter less
SHADE = 0.35  # of columns behind a curve
NUM_SHADES = 48
SHORTFALL = "too weak by"  # the meaning of the numbers next to robots
TAG = 2  # of dark ground around a number [pixels]
LABELS_FIRST = 1000  # a number covers up to this many robots rather than another number
# In sizes of the text.
SMALL = 0.8  # texts that matter less
LARGE = 1.3  # and more
LINE = 1.35  # from one line of a small text to the next
ROOM = 3.7  # of all samples of a legend
STEP = 1.1  # from one to the next

Font: TypeAlias = ImageFont.FreeTypeFont | ImageFont.ImageFont


class Box(NamedTuple):
    """A part of the picture [pixels]."""

    left: int
    top: int
    right: int
    bottom: int


@cache
def font(size: float) -> Font:
    """Return Pillow's own font, in pixels."""
    return ImageFont.load_default(round(size))


def draw_title(
    draw: ImageDraw,
    footage: Footage,
    row: int,
    box: Box,
    size: int,
    curve: Colour,
    theme: Theme = DARK,
) -> None:
    """Draw policy, mission, own parts and time above a scene, and its age in its curve's colour."""
    facts = footage.facts
    mission = facts.mission
    now = footage.window[row]
    small = font(SMALL * size)
    large = font(LARGE * size)
    left = box.left + size // 2
    right = box.right - size // 2
    top = box.top + size // 2
    draw.text((left, top), facts.policy, theme.text, large)
    draw.text((right, top), f"age {footage.age_mean[row]:.1f} windows", curve, large, anchor="ra")
    below = top + 1.7 * size
    draw.text((left, below), "\n".join(_title_lines(footage)), theme.note, small)
    time = f"{now * mission.window_s:.1f} s, window {now}"
    draw.text((right, below), time, theme.note, small, anchor="ra")
    num_cut_off = int(np.sum(footage.is_cut_off[row]))
    if num_cut_off > 0:
        text = f"{num_cut_off} cut off from r{footage.ego}"
        draw.text((right, below + size), text, palette.TOO_WEAK, small, anchor="ra")


def title_height(footage: Footage, size: int) -> int:
    """Return the height that a title needs, so that it does not touch the scene [pixels]."""
    return round(size * (2.0 + SMALL * LINE * len(_title_lines(footage))))


def _title_lines(footage: Footage) -> list[str]:
    facts = footage.facts
    lines = [f"{facts.mission.task}, {facts.mission.num_robots} robots, seed {facts.seed}"]
    # A line for each thing that is said of where it was flown, for a title is narrow.
    lines += [each for each in ", ".join(where_flown(facts.mission)).split(", ") if each]
    return lines + facts.own_parts


def draw_legend(
    draw: ImageDraw, footages: Sequence[Footage], box: Box, size: int, theme: Theme = DARK
) -> None:
    """Draw the ramp of ages, and the meaning of the packets' colours."""
    small = font(SMALL * size)
    observers = _observers(footages)
    full_scale = footages[0].facts.full_scale
    text = f"colour: age of what {observers} ({theme.ego_name}) knows"
    draw.text((box.left, box.top), text, theme.text, small)
    y = box.top + 1.25 * size
    high = 0.55 * size
    edges = np.linspace(box.left, box.right, NUM_SHADES + 1)
    ages = np.linspace(0.0, full_scale, NUM_SHADES)
    for k, colour in enumerate(palette.age_colours(ages, full_scale).tolist()):
        draw.rectangle((edges[k], y, edges[k + 1], y + high), tuple(colour))
    y += 1.3 * high
    draw.text((box.left, y), "0", theme.note, small)
    draw.text((box.right, y), f"{full_scale:g} windows or more", theme.note, small, anchor="ra")
    samples = _samples(footages, observers, theme)
    # Two columns; the more samples there are, the closer they stand.
    step = min(STEP, ROOM / ((len(samples) + 1) // 2)) * size
    small = font(min(SMALL * size, 0.9 * step))
    for k, (text, colour) in enumerate(samples.items()):
        row, column = divmod(k, 2)
        x = box.left + column * (box.right - box.left) / 2
        line = round(y + 1.3 * size) + step * row
        if text == SHORTFALL:
            _draw_tag(draw, "dB", x, line, small, theme)
        else:
            _draw_sample(draw, colour, x, line + 0.45 * size, size)
        draw.text((x + 1.5 * size, line), text, theme.note, small)


def _observers(footages: Sequence[Footage]) -> str:
    return " and ".join(dict.fromkeys(f"r{each.ego}" for each in footages))


def _samples(footages: Sequence[Footage], observers: str, theme: Theme) -> dict[str, Colour]:
    samples = {"never heard of": palette.UNKNOWN}
    if any(each.has_motion for each in footages):
        samples["heading"] = theme.heading
    if any(each.facts.is_broadcast for each in footages):
        samples["packet heard"] = theme.shown(palette.BROADCAST)
    if not all(each.facts.is_broadcast for each in footages):
        samples |= {"delivered": theme.shown(palette.DELIVERED), "lost": theme.shown(palette.LOST)}
        samples |= {
            "answered": theme.shown(palette.ANSWERED),
            "overheard": theme.shown(palette.OVERHEARD),
        }
    links = [each.mismatch.links[each.is_own(each.mismatch.links)] for each in footages]
    is_too_weak = np.concatenate(links)["is_too_weak"]
    if np.any(is_too_weak):
        samples[f"{observers}'s link, too weak"] = palette.MISMATCH["too_weak"]
    if not np.all(is_too_weak):
        samples[f"{observers}'s link, unbelieved"] = palette.MISMATCH["unbelieved"]
    if np.any(is_too_weak):
        samples[SHORTFALL] = palette.TOO_WEAK
    if any(np.any(each.is_cut_off) for each in footages):
        samples[f"halo: cut off from {observers}"] = palette.CUT_OFF
    return samples


def _draw_sample(draw: ImageDraw, colour: Colour, x: float, middle: float, size: int) -> None:
    if colour in (palette.UNKNOWN, palette.CUT_OFF):
        draw.circle((x + 0.6 * size, middle), 0.3 * size, colour)
        return
    pieces = DASHES if colour == palette.MISMATCH["too_weak"] else WHOLE
    for a, b in (x + 1.2 * size * pieces).round().tolist():
        draw.line((a, middle, b - 1, middle), colour, max(2, size // 6))


def draw_shortfalls(
    draw: ImageDraw,
    robots: Float[np.ndarray, "N 2"],
    others: Int16[np.ndarray, "K"],
    margin_db: Int16[np.ndarray, "K"],
    size: int,
    theme: Theme = DARK,
) -> None:
    """Write by how much links are too weak, next to the `others` at their far ends [pixels]."""
    small = font(0.75 * size)
    shown = np.zeros((0, 2, 2))  # the numbers so far: their boxes' corners
    on_robots = np.stack([robots - 0.4 * size, robots + 0.4 * size], axis=1)
    for robot, margin in zip(others.tolist(), margin_db.tolist(), strict=True):
        text = f"{margin} dB"
        width = draw.textlength(text, small) + 2 * TAG
        high = 0.95 * size
        # To the right, to the left, below or above: where it covers least.
        sides = [(0.7, -0.5), (-0.7 - width / size, -0.5), (-0.5, 0.8), (-0.5, -1.8)]
        low = robots[robot] + size * np.array(sides)
        boxes = np.stack([low, low + np.array([width, high])], axis=1)
        covered = LABELS_FIRST * _num_overlaps(boxes, shown) + _num_overlaps(boxes, on_robots)
        best = int(np.argmin(covered))
        if covered[best] < LABELS_FIRST:
            x, y = low[best].tolist()
            _draw_tag(draw, text, x + TAG, y, small, theme)
            shown = np.append(shown, boxes[[best]], axis=0)


def _num_overlaps(
    boxes: Float[np.ndarray, "S 2 2"], others: Float[np.ndarray, "O 2 2"]
) -> Int[np.ndarray, "S"]:
    """Count how many others each box overlaps; boxes are upper left and lower right corners."""
    low, high = np.moveaxis(boxes[:, None], 2, 0)
    other_low, other_high = np.moveaxis(others[None], 2, 0)
    return np.sum(np.all((low < other_high) & (other_low < high), axis=2), axis=1)


def _draw_tag(draw: ImageDraw, text: str, x: float, y: float, small: Font, theme: Theme) -> None:
    # On a plain ground, so that it is read before anything.
    left, top, right, bottom = draw.textbbox((x, y), text, small)
    draw.rectangle((left - TAG, top - TAG, right + TAG, bottom + TAG), theme.background)
    draw.text((x, y), text, palette.TOO_WEAK, small)


class AgePlot:
    """The mean age over the mission, of one flight or two, on a common axis."""

    def __init__(
        self, footages: Sequence[Footage], box: Box, size: int, theme: Theme = DARK
    ) -> None:
        """Prepare the curves, as points of the picture."""
        self._footages = footages
        self._box = box
        self._size = size
        self._theme = theme
        inner = Box(
            left=box.left + 2 * size,
            top=round(box.top + 1.4 * size),
            right=box.right,
            bottom=box.bottom - size,
        )
        self._inner = inner
        seconds = [each.window * each.facts.mission.window_s for each in footages]
        self._end_s = max(float(each[-1]) for each in seconds)
        self._top = palette.nice_top(max(float(np.max(each.age_mean)) for each in footages))
        self._curves: list[list[tuple[float, float]]] = []
        for each, at_s in zip(footages, seconds, strict=True):
            x = inner.left + (inner.right - inner.left) * at_s / self._end_s
            y = inner.bottom - (inner.bottom - inner.top) * each.age_mean / self._top
            self._curves.append(list(zip(x.tolist(), y.tolist(), strict=True)))

    def draw_axes(self, draw: ImageDraw) -> None:
        """Draw what does not change: title, numbers, and the whole curves, faintly."""
        small = font(SMALL * self._size)
        inner = self._inner
        footages = self._footages
        title = "mean age of information [windows]"
        draw.rectangle(inner, self._theme.grid)
        # Two missions' columns would look alike.
        if len(footages) == 1 and np.any(footages[0].is_cut_off):
            title += f"; red: robots cut off from {_observers(footages)}, full height 100 %"
            left = float(inner.left)
            shares = footages[0].cut_off_share.tolist()
            for (right, _), part in zip(self._curves[0], shares, strict=True):
                if part > 0.0:
                    top = inner.bottom - part * (inner.bottom - inner.top)
                    draw.rectangle(
                        (left, top, right, inner.bottom), self._theme.mixed(palette.CUT_OFF, SHADE)
                    )
                left = right
        draw.text((inner.left, self._box.top), title, self._theme.text, small)
        for y, value in ((inner.top, f"{self._top:g}"), (inner.bottom, "0")):
            draw.text((inner.left - 4, y), value, self._theme.note, small, anchor="rm")
        below = inner.bottom + 2
        draw.text((inner.left, below), "0", self._theme.note, small)
        draw.text((inner.right, below), f"{self._end_s:g} s", self._theme.note, small, anchor="ra")
        # From the start on: what is still to come sets the axis, which does not change.
        for curve, colour in zip(self._curves, self._theme.curves, strict=False):
            draw.line(curve, self._theme.mixed(colour, FAINT), 1)

    def draw_until(self, draw: ImageDraw, rows: Sequence[int]) -> None:
        """Draw the curves so far, and where they are now."""
        radius = max(2.0, self._size / 5)
        width = max(2, self._size // 8)
        for curve, colour, row in zip(self._curves, self._theme.curves, rows, strict=False):
            if row > 0:
                draw.line(curve[: row + 1], colour, width, joint="curve")
            draw.circle(curve[row], radius, colour)
