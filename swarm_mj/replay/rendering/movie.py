"""A mission as moving pictures: its scene, or two side by side, above the mean age over time."""

import itertools
from collections.abc import Iterator, Sequence
from contextlib import ExitStack

import numpy as np
from jaxtyping import Int, UInt8
from PIL import Image, ImageDraw

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.rendering.drawing import (
    CURVES,
    AgePlot,
    Box,
    blank,
    draw_legend,
    draw_shortfalls,
    draw_title,
)
from swarm_mj.replay.rendering.scene import SceneRenderer
from swarm_mj.replay.rendering.style import MAX_MISSIONS, VideoStyle

STRIP = 0.22  # of the height, below the scenes
TEXT = 0.028  # of the height, or of the width of a narrow scene
SEAM = 4  # between scenes [pixels]
LEGEND = 0.32  # of the width; the plot has the rest


class Movie(ExitStack):
    """The pictures of a video; a context that gives OpenGL's memory back."""

    def __init__(self, footages: Sequence[Footage], style: VideoStyle) -> None:
        """Prepare everything that does not move.

        Args:
            footages: One mission, or two that are shown side by side.
            style: Size and length.

        Raises:
            ValueError: There are not one or two missions.
            OSError: No OpenGL works here; it says what to install.
        """
        super().__init__()
        if not 1 <= len(footages) <= MAX_MISSIONS:
            raise ValueError(f"a video shows 1 or {MAX_MISSIONS} missions, not {len(footages)}")
        self._footages, self._num_frames = footages, style.num_frames
        # One scale for both: by it the fresher team is seen in full, and the other is older still.
        self._full_scale = min(each.facts.full_scale for each in footages)
        width, height = style.width, style.height
        bottom = height - round(STRIP * height)
        edges = np.linspace(0, width, len(footages) + 1).round().astype(int).tolist()
        self._boxes = [Box(left, 0, right, bottom) for left, right in itertools.pairwise(edges)]
        self._text = max(9, round(min(TEXT * height, 0.05 * self._boxes[0].width)))
        pad = self._text // 2
        middle, top = pad + round(LEGEND * width), bottom + pad
        legend = Box(pad, top, middle - 2 * pad, height - pad)
        right = Box(middle, top, width - 2 * pad, height - pad)
        self._plot = AgePlot(footages, right, self._text)
        self._empty = blank(width, height)
        draw = ImageDraw.Draw(self._empty)
        draw_legend(draw, footages, self._full_scale, legend, self._text)
        self._plot.draw_axes(draw)
        with ExitStack() as opened:  # closes the first renderer if the second does not start
            self._renderers = [
                opened.enter_context(
                    SceneRenderer(each.facts.mission, box.width, box.height, scene=each.scene)
                )
                for each, box in zip(footages, self._boxes, strict=True)
            ]
            self.push(opened.pop_all())

    def __len__(self) -> int:
        return self._num_frames

    def __iter__(self) -> Iterator[UInt8[np.ndarray, "H W 3"]]:
        rows = [self._rows(each) for each in self._footages]
        for number in range(len(self)):
            yield self.picture([int(each[number]) for each in rows])

    def picture(self, rows: Sequence[int]) -> UInt8[np.ndarray, "H W 3"]:
        """Return the picture of these windows, one of each mission, from 0."""
        picture = self._empty.copy()
        draw = ImageDraw.Draw(picture)
        parts = zip(self._footages, rows, self._boxes, self._renderers, CURVES, strict=False)
        for footage, row, box, renderer, curve in parts:
            contents = footage.contents(row, self._full_scale)
            picture.paste(Image.fromarray(renderer.frame(contents)), (box.left, box.top))
            draw_title(draw, footage, row, box, self._text, curve)
            ground_m = np.pad(contents.position_m, ((0, 0), (0, 1)))
            robots = renderer.camera(contents).pixels(ground_m) + np.array([box.left, box.top])
            draw_shortfalls(draw, robots, *footage.shortfalls(row), self._text)
        for box in self._boxes[1:]:
            draw.line((box.left, 0, box.left, box.bottom), palette.BACKGROUND, SEAM)
        self._plot.draw_until(draw, rows)
        return np.asarray(picture)

    def _rows(self, footage: Footage) -> Int[np.ndarray, "F"]:
        """Return the window of each picture; a mission that is over stands still."""
        longest = max(len(each.window) for each in self._footages)
        rows = np.linspace(0, longest - 1, len(self)).round().astype(int)
        return np.minimum(rows, len(footage.window) - 1)
