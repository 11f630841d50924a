"""A sheet to draw a log on: rerun's recording with the log's two timelines."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float, Int

from swarm_mj.replay.frame import Frame
from swarm_mj.replay.links import Links, ends
from swarm_mj.replay.palette import Colour
from swarm_mj.replay.recorder import Log

TIMELINE = "window"


def screen(points: float) -> float:
    """A radius in points of the screen, the same at every zoom; rerun marks these as negative."""
    return -points


class Sheet:
    """Draws fixed and timed things; a timed entity shows the last window's row."""

    def __init__(
        self, recording: rr.RecordingStream, log: Log, frame: Frame, window_s: float
    ) -> None:
        self._recording = recording
        self._window_s = window_s
        self.log = log
        self.frame = frame

    def fixed(self, path: str, *archetypes: Any) -> None:  # noqa: ANN401 - any rerun archetype
        """Draws something that never changes. It would hide the same component drawn in time."""
        self._recording.log(path, *archetypes, static=True)

    def timed(
        self,
        path: str,
        columns: Iterable[rr.ComponentColumn],
        window: Int[np.ndarray, "K"] | None = None,
    ) -> None:
        """Draws one row per window: of the log, or of the windows given."""
        at = self.log.window if window is None else window
        times = [
            rr.TimeColumn(TIMELINE, sequence=at),
            rr.TimeColumn("mission_time", duration=at * self._window_s),
        ]
        self._recording.send_columns(path, indexes=times, columns=list(columns))

    def points(
        self,
        path: str,
        position: Float[np.ndarray, "L 2"],
        colours: np.ndarray,
        per_window: Sequence[int] | np.ndarray,
    ) -> None:
        """Points with a colour each, so many per window."""
        self.timed(
            path, rr.Points2D.columns(positions=position, colors=colours).partition(per_window)
        )

    def lines(
        self,
        path: str,
        start: Float[np.ndarray, "L 2"],
        end: Float[np.ndarray, "L 2"],
        per_window: Sequence[int] | np.ndarray,
    ) -> None:
        """Straight lines, so many per window."""
        strips = np.stack([start, end], axis=1)
        self.timed(path, rr.LineStrips2D.columns(strips=strips).partition(per_window))

    def line_style(self, path: str, colour: Colour, width: float, order: float) -> None:
        """Colour, width on the screen and drawing order of lines."""
        self.fixed(
            path,
            rr.LineStrips2D.from_fields(colors=[colour], radii=screen(width), draw_order=order),
        )

    def arrows(
        self,
        path: str,
        links: Links,
        *,
        colour: Colour,
        width: float,
        order: float,
        share: float = 1.0,
        aside_m: float = 0.0,
    ) -> None:
        """Packets as arrows from sender towards receiver.

        Args:
            path: Of the entity.
            links: The packets.
            colour: Theirs.
            width: On the screen [points].
            order: Larger is drawn above.
            share: Of the way to the receiver that the arrow reaches.
            aside_m: Offset to the left, so that an answer stands beside what it answers [m].
        """
        start, end = ends(self.log, links)
        way = end - start
        length = np.linalg.norm(way, axis=1, keepdims=True)
        left = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.maximum(length, 1e-6)
        self.fixed(
            path, rr.Arrows2D.from_fields(colors=[colour], radii=screen(width), draw_order=order)
        )
        arrows = rr.Arrows2D.columns(origins=start + aside_m * left, vectors=share * way)
        self.timed(path, arrows.partition(links.per_window))
