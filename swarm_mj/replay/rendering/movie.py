"""A mission as moving pictures: its scene, or two side by side, above the course of the age."""

import itertools
from collections.abc import Iterator, Sequence
from contextlib import ExitStack

import numpy as np
from jaxtyping import Int, UInt8
from PIL import Image, ImageDraw

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Footage
from swarm_mj.replay.rendering.contents import Contents, links_of
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
from swarm_mj.replay.rendering.style import Style

MOST_MISSIONS = 2  # side by side
STRIP = 0.22  # of the height, below the scenes
TEXT = 0.028  # of the height, or of the width of a narrow scene
SEAM = 4  # between scenes [pixels]
LEGEND = 0.32  # of the width; the plot has the rest


class Movie:
    """The pictures of a video."""

    def __init__(self, footages: Sequence[Footage], style: Style) -> None:
        """Prepare everything that does not move.

        Args:
            footages: One mission, or two that are shown side by side.
            style: Size and length.

        Raises:
            ValueError: There are not one or two missions.
            OSError: No OpenGL works here; it says what to install.
        """
        if not 1 <= len(footages) <= MOST_MISSIONS:
            raise ValueError(f"a video shows 1 or {MOST_MISSIONS} missions, not {len(footages)}")
        self._footages, self._style = footages, style
        # One scale for both: by it the fresher team is seen in full, and the other is older still.
        full_scale = min(each.facts.full_scale for each in footages)
        self._colours = [each.colours(full_scale) for each in footages]
        self._frames = [each.frame for each in footages]
        width, height = style.width, style.height
        self._bottom = height - round(STRIP * height)
        edges = np.linspace(0, width, len(footages) + 1).round().astype(int).tolist()
        self._boxes = [
            Box(left, 0, right, self._bottom) for left, right in itertools.pairwise(edges)
        ]
        self._text = max(9, round(min(TEXT * height, 0.05 * self._boxes[0].width)))
        pad = self._text // 2
        below = Box(pad, self._bottom + pad, width - 2 * pad, height - pad)
        middle = below.left + round(LEGEND * width)
        self._plot = AgePlot(
            footages, Box(middle, below.top, below.right, below.bottom), self._text
        )
        self._empty = blank(width, height)
        draw = ImageDraw.Draw(self._empty)
        legend = Box(below.left, below.top, middle - 2 * pad, below.bottom)
        draw_legend(draw, footages, full_scale, legend, self._text)
        self._plot.draw_axes(draw)
        with ExitStack() as stack:
            self._renderers = [
                stack.enter_context(
                    SceneRenderer(each.facts.mission, box.width, box.height, scene=each.scene)
                )
                for each, box in zip(footages, self._boxes, strict=True)
            ]
            self._open = stack.pop_all()

    def __enter__(self) -> "Movie":
        return self

    def __exit__(self, *error: object) -> None:
        self._open.close()

    def __len__(self) -> int:
        return self._style.num_frames

    def __iter__(self) -> Iterator[UInt8[np.ndarray, "H W 3"]]:
        rows = [self._rows(each) for each in self._footages]
        for number in range(len(self)):
            yield self.picture([int(each[number]) for each in rows])

    def picture(self, rows: Sequence[int]) -> UInt8[np.ndarray, "H W 3"]:
        """Return the picture of these windows, one of each mission, from 0."""
        picture = self._empty.copy()
        draw = ImageDraw.Draw(picture)
        for k, (footage, row, box) in enumerate(
            zip(self._footages, rows, self._boxes, strict=True)
        ):
            contents = self._contents(k, row)
            scene = self._renderers[k].frame(contents)
            picture.paste(Image.fromarray(scene), (box.left, box.top))
            draw_title(draw, footage, row, box, self._text, CURVES[k])
            ground_m = np.pad(contents.position_m, ((0, 0), (0, 1)))
            robots = self._renderers[k].camera(contents).pixels(ground_m)
            robots += np.array([box.left, box.top])
            draw_shortfalls(draw, robots, *footage.shortfalls(row), self._text)
        for box in self._boxes[1:]:
            draw.line((box.left, 0, box.left, self._bottom), palette.BACKGROUND, SEAM)
        self._plot.draw_until(draw, rows)
        return np.asarray(picture)

    def _rows(self, footage: Footage) -> Int[np.ndarray, "F"]:
        """Return the window of each picture; a mission that is over stands still."""
        longest = max(len(each.window) for each in self._footages)
        rows = np.linspace(0, longest - 1, len(self)).round().astype(int)
        return np.minimum(rows, len(footage.window) - 1)

    def _contents(self, k: int, row: int) -> Contents:
        footage = self._footages[k]
        position_m, observer = footage.position_m[row], footage.facts.observer
        return Contents(
            position_m=position_m,
            velocity_mps=footage.velocity_mps[row],
            colour=self._colours[k][row],
            observer=observer,
            **links_of(footage.segments, footage.mismatch_at(row), position_m, observer, row),
            is_cut_off=footage.is_cut_off[row],
            centre_m=self._frames[k].centre_m[row],
            reach_m=self._frames[k].reach_m,
        )
