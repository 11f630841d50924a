"""A replay that is shown while its flight goes on, piece by piece, and written in the end.

What is drawn of a piece depends on that piece and on the mission, so that the file of a live flight
has the rows of one that was drawn whole. What stands still and depends on all windows, such as the
picture of the radios' states, is drawn anew for the viewer with every piece, for the file once.
"""

import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import rerun as rr
import rerun_bindings as bindings

from swarm_mj.replay import plots
from swarm_mj.replay.layer_kinds import FlatPoint
from swarm_mj.replay.layout import draw_legend
from swarm_mj.replay.log import Log
from swarm_mj.replay.read import with_digest
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.rerun_log import RerunLog
from swarm_mj.replay.stage import draw_stage, grid
from swarm_mj.replay.training_curve import TrainingCurve, draw_training_curve
from swarm_mj.replay.write import (
    draw_growing,
    draw_piece,
    draw_whole,
    new_recording,
    send_layout,
    send_properties,
)
from swarm_mj.system.writing import write_bytes

# A flight that is drawn in pieces takes some 20 ms a piece longer than one that is drawn whole.
BETWEEN_PIECES_S = 0.25
FLUSH_S = 10.0  # that a viewer may take to get what was sent


class _Recordings(NamedTuple):
    """The same flight twice: for its file, if there is one, and for the viewer."""

    file: rr.RecordingStream | None
    content: rr.BinaryStream | None  # of the file
    viewer: rr.RecordingStream

    @property
    def all(self) -> list[rr.RecordingStream]:
        return [self.viewer] if self.file is None else [self.file, self.viewer]


class LiveReplay:
    """Shows a recorder's flight in a viewer while it goes on, and writes its file in the end."""

    def __init__(
        self,
        recorder: Recorder,
        config: Mapping[str, Any],
        name: str,
        address: str,
        *,
        has_file: bool = False,
        windows_per_second: float | None = None,
        curve: TrainingCurve | None = None,
        has_layout: bool = True,
    ) -> None:
        """Prepare to show a flight.

        Args:
            recorder: Of the flight.
            config: All that the flight depends on, as `write_replay` takes it.
            name: Of the recording.
            address: Where the viewer takes data, as rerun names it.
            has_file: Whether it will be written to a file.
            windows_per_second: That the viewer plays; None shows the latest window.
            curve: Of the training whose policy flies, which is shown beside the mission.
            has_layout: Whether to send the layout; without it, the viewer keeps that of the last
                flight of the same kind, and whatever its user has changed.
        """
        self._recorder = recorder
        self._config = {key: value for key, value in config.items() if value is not None}
        self._name = name
        self._address = address
        self._has_file = has_file
        self._windows_per_second = windows_per_second
        self._curve = curve
        self._has_layout = has_layout
        self._next_s = 0.0
        self._num_drawn = 0  # windows
        self._out: RerunLog | None = None
        self._grid: list[list[FlatPoint]] = []  # that the viewer shows
        self._recordings: _Recordings | None = None

    def show(self) -> None:
        """Show the windows flown since the last piece, if they are enough for another."""
        if self._recorder.num_windows - self._num_drawn < self._recorder.piece_windows:
            return
        now_s = time.monotonic()
        if now_s >= self._next_s:
            self._next_s = now_s + BETWEEN_PIECES_S
            self._draw(self._whole_pieces())

    def _whole_pieces(self) -> int:
        """Return the number of windows in all pieces that are whole."""
        piece = self._recorder.piece_windows
        return self._recorder.num_windows // piece * piece

    def _draw(self, until: int) -> None:
        """Draw the windows up to this one that are not drawn yet."""
        piece = self._recorder.piece(self._config, self._num_drawn, until)
        if self._out is None:
            self._out = self._begin(piece)
        else:
            self._out.move_on(piece)
        draw_piece(self._out)
        self._num_drawn = until
        assert self._recordings is not None
        with self._out.only_to(self._recordings.viewer):
            lines = grid(self._out.drawn.ground)
            if lines != self._grid:  # the team has flown beyond
                self._grid = lines
                draw_stage(self._out)
            draw_growing(self._out)

    def _begin(self, piece: Log) -> RerunLog:
        """Return what draws, once the first piece says what kind of flight it is."""
        file = new_recording(piece) if self._has_file else None
        content = file.binary_stream() if file else None
        viewer = new_recording(piece, self._curve)
        viewer.connect_grpc(self._address)
        self._recordings = _Recordings(file=file, content=content, viewer=viewer)
        for recording in self._recordings.all:
            send_properties(recording, piece, self._config, self._name)
        out = RerunLog(self._recordings.all, piece)
        if self._has_layout:  # before all else, or a slow viewer would show one of its own first
            send_layout(
                viewer, out, live_fps=self._windows_per_second, is_live=True, curve=self._curve
            )
        self._grid = grid(out.drawn.ground)
        # First: rerun takes the type of "loss_db" from its first use, and obstacles' is no integer.
        with out.only_to(viewer):
            draw_stage(out)
            draw_legend(out)
            if self._curve is not None:
                draw_training_curve(out, self._curve)
        return out

    def finish(self) -> None:
        """Show the rest of the flight, and what is known in the end only."""
        if self._recorder.num_windows > self._num_drawn:
            self._draw(self._recorder.num_windows)
        out = self._out
        if out is None or self._recordings is None:  # nothing was flown
            return
        draw_whole(out, self._config, self._name)
        plots.draw_agreement(out)
        if self._recordings.file is not None:
            with out.only_to(self._recordings.file):
                draw_stage(out)
            send_layout(self._recordings.file, out)
        with suppress(RuntimeError):  # the viewer was closed
            self._recordings.viewer.flush(timeout_sec=FLUSH_S)

    def close(self) -> None:
        """Let go of the viewer, which keeps what it was sent; nothing more can be shown."""
        if self._recordings is not None:
            self._recordings.viewer.disconnect()
            bindings.flush_and_cleanup_orphaned_recordings()  # its threads, which would stay

    def save(self, path: Path) -> None:
        """Write the finished replay to its file, whole or not at all; or raise OSError."""
        assert self._recordings is not None
        content = self._recordings.content
        assert self._recordings.file is not None
        assert content is not None
        self._recordings.file.disconnect()
        recorded = with_digest(content.read() or b"")
        bindings.flush_and_cleanup_orphaned_recordings()
        write_bytes(path, recorded)
