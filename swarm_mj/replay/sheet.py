"""A sheet to draw a log on: rerun's recording with the log's two timelines."""

from collections.abc import Iterable, Mapping, Sequence
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

    def layer(
        self,
        path: str,
        kind: Any,  # noqa: ANN401 - any rerun archetype
        style: Mapping[str, object],
        per_window: Sequence[int] | np.ndarray | None = None,
        **columns: np.ndarray,
    ) -> None:
        """Draws things that change, in a style that does not.

        Args:
            path: Of the entity.
            kind: The archetype.
            style: Its fields that never change.
            per_window: How many things each window has; None is one.
            **columns: Its fields that change, for all windows one after the other.
        """
        self.fixed(path, kind.from_fields(**style))
        drawn = kind.columns(**columns)
        self.timed(path, drawn if per_window is None else drawn.partition(per_window))

    def lines(
        self,
        path: str,
        ends: tuple[Float[np.ndarray, "L 2"], Float[np.ndarray, "L 2"]],
        per_window: Sequence[int] | np.ndarray,
        look: tuple[Colour, float, float],
    ) -> None:
        """Straight lines.

        Args:
            path: Of the entity.
            ends: Where they begin, and where they end.
            per_window: How many each window has.
            look: Colour, width on the screen [points], and place in the order of drawing.
        """
        style = _style(*look)
        self.layer(path, rr.LineStrips2D, style, per_window, strips=np.stack(ends, axis=1))

    def arrows(
        self,
        path: str,
        links: Links,
        *,
        look: tuple[Colour, float, float],
        share: float = 1.0,
        aside_m: float = 0.0,
    ) -> None:
        """Packets as arrows from sender towards receiver.

        Args:
            path: Of the entity.
            links: The packets.
            look: As of lines.
            share: Of the way to the receiver that the arrow reaches.
            aside_m: Offset to the left, so that an answer stands beside what it answers [m].
        """
        start, end = ends(self.log, links)
        way = end - start
        length = np.linalg.norm(way, axis=1, keepdims=True)
        left = np.stack([-way[:, 1], way[:, 0]], axis=1) / np.maximum(length, 1e-6)
        self.layer(
            path,
            rr.Arrows2D,
            _style(*look),
            links.per_window,
            origins=start + aside_m * left,
            vectors=share * way,
        )


def _style(colour: Colour, width: float, order: float) -> dict[str, object]:
    return {"colors": [colour], "radii": screen(width), "draw_order": order}
