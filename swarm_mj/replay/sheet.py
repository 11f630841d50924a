"""A sheet to draw a log on: rerun's recording with the log's two timelines."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float, Int

from swarm_mj.replay.frame import Frame
from swarm_mj.replay.layers import LAYERS
from swarm_mj.replay.recorder import Log

TIMELINE = "window"


class Sheet:
    """Draws fixed and timed things; a timed entity shows the last window's row."""

    def __init__(
        self, recording: rr.RecordingStream, log: Log, frame: Frame, window_s: float
    ) -> None:
        self._recording = recording
        self._window_s = window_s
        self.log = log
        self.frame = frame

    def fixed(self, path: str, *archetypes: Any) -> None:
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

    def fixed_layer(self, path: str, **fields: Any) -> None:
        """Draws things of a layer that never change, by the fields of the layer's archetype."""
        layer = LAYERS[path]
        self.fixed(path, layer.kind.from_fields(**layer.style, **fields))

    def layer(
        self, path: str, row: Int[np.ndarray, "L"] | None = None, **columns: np.ndarray
    ) -> None:
        """Draws things of a layer that change.

        Args:
            path: One of `LAYERS`.
            row: The log's window of each thing, ascending; None: all windows have as many.
            **columns: The fields of the layer's archetype, with a value for each thing.
        """
        self.fixed_layer(path)
        num_windows = len(self.log.window)
        if row is None:
            num_things = len(next(iter(columns.values())))
            row = np.repeat(np.arange(num_windows), num_things // num_windows)
        per_window = np.bincount(row, minlength=num_windows)
        self.timed(path, LAYERS[path].kind.columns(**columns).partition(per_window))

    def lines(
        self,
        path: str,
        start: Float[np.ndarray, "L 2"],
        end: Float[np.ndarray, "L 2"],
        row: Int[np.ndarray, "L"] | None = None,
    ) -> None:
        """Draws straight lines; `row` as for `layer`."""
        self.layer(path, row, strips=np.stack([start, end], axis=1))

    def rings(
        self,
        path: str,
        centre: Float[np.ndarray, "L 2"],
        radius_m: float,
        row: Int[np.ndarray, "L"] | None = None,
    ) -> None:
        """Draws circles; `row` as for `layer`."""
        self.layer(path, row, centers=centre, half_sizes=np.full(centre.shape, radius_m))
