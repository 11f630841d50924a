"""A replay as rerun's recording: how each entity looks, and its rows on the mission's timelines."""

import math
import tomllib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Float, Int

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.links import NUMBERS, LinkRows, Points, shades
from swarm_mj.replay.palette import PACKETS, Colour
from swarm_mj.replay.recorder import Log

TIMELINE = "window"
CROWD = 400  # robots from which on they are drawn smaller, so that they do not cover each other


class EntityStyle(NamedTuple):
    """How the things of one entity are drawn, and their samples in the legend."""

    kind: Any  # rerun's archetype
    colour: Colour | None  # None: each thing has its own
    width: float  # of lines, or the radius of points, on the screen [points]
    order: float | None = None  # in 2-D, the higher is drawn over the lower

    @property
    def style(self) -> dict[str, Any]:
        """The archetype's fields that are the same for all things, at all times."""
        radii = "line_radii" if self.kind is rr.Ellipses2D else "radii"
        order = {} if self.order is None else {"draw_order": self.order}
        colours = {} if self.colour is None else {"colors": [self.colour]}
        return {radii: -self.width, **order, **colours}  # rerun takes negative radii as points


def _layers() -> dict[str, EntityStyle]:
    """Return the styles in `layers.toml`, with the colours that they name."""
    said = tomllib.loads(Path(__file__).with_name("layers.toml").read_text("utf-8"))
    fates = {fate: style.colour for fate, style in PACKETS.items()}
    colours = palette.COLOURS | said["colours"] | fates | {"own": None}
    return {
        path: EntityStyle(getattr(rr, kind), colours[colour], *numbers)
        for path, (kind, colour, *numbers) in said["layers"].items()
    }


LAYERS = _layers()


class RerunLog:
    """Writes a log's entities; one that changes shows the row of the last window."""

    def __init__(self, recording: rr.RecordingStream, log: Log, ground: Ground) -> None:
        self._recording, self.log, self.ground = recording, log, ground
        self.scale = min(1.0, math.sqrt(CROWD / log.is_on.shape[1]))  # of robots that are drawn [1]

    def fixed(self, path: str, *archetypes: Any) -> None:
        """Write what never changes. It would hide the same component written in time."""
        self._recording.log(path, *archetypes, static=True)

    def timed(
        self, path: str, columns: Iterable[rr.ComponentColumn], window: np.ndarray | None = None
    ) -> None:
        """Write one row per window: of the log, or of the windows given."""
        at = self.log.window if window is None else window
        # Two timelines: one to step by windows, one to play in seconds.
        times = [
            rr.TimeColumn(TIMELINE, sequence=at),
            rr.TimeColumn("mission_time", duration=at * self.log.facts.mission.window_s),
        ]
        self._recording.send_columns(path, indexes=times, columns=list(columns))

    def things(
        self, path: str, columns: rr.ComponentColumnList, row: Int[np.ndarray, "L"] | None = None
    ) -> None:
        """Write things by their windows, `row`, ascending; None: all robots in each window."""
        num = np.full(len(self.log.window), self.log.is_on.shape[1])
        per_window = num if row is None else np.bincount(row, minlength=len(num))
        self.timed(path, columns.partition(per_window))

    def fixed_layer(self, path: str, **fields: Any) -> None:
        """Write things of a layer that never change, by the fields of the layer's archetype."""
        layer = LAYERS[path.replace("others/", "")]  # others' links look like the observer's
        if layer.kind is rr.Points2D and path.startswith("arena"):
            layer = layer._replace(width=layer.width * self.scale)
        self.fixed(path, layer.kind.from_fields(**layer.style, **fields))

    def words(self, path: str, texts: list[str], places: Sequence[tuple[float, float]]) -> None:
        """Write texts that never change at places in 2-D, as labels of points that are not seen."""
        style = {"show_labels": True, "radii": -0.1, "colors": [palette.TEXT]}
        self.fixed(path, rr.Points2D.from_fields(positions=places, labels=texts, **style))

    def layer(self, path: str, row: np.ndarray | None = None, **columns: np.ndarray) -> None:
        """Write things of a layer that change, by its archetype's fields; `row` as for `things`."""
        self.fixed_layer(path)
        self.things(path, LAYERS[path].kind.columns(**columns), row)

    def lines(
        self, path: str, start: np.ndarray, end: np.ndarray, row: np.ndarray | None = None
    ) -> None:
        """Write straight lines from start to end, each [L 2] or [L 3]; `row` as for `things`."""
        self.layer(path, row, strips=np.stack([start, end], axis=1))

    def rings(self, path: str, centre: Points, radius_m: float, row: np.ndarray) -> None:
        """Write circles; `row` as for `things`."""
        self.layer(path, row, centers=centre, half_sizes=np.full(centre.shape, radius_m))

    def mismatch_lines(self, path: str, links: LinkRows, at_m: Float[np.ndarray, "L 2 A"]) -> None:
        """Write a line for each of these links; those who click on one read its numbers."""
        self.fixed_layer(path)
        window = self.log.mismatch.window
        per_snapshot = np.bincount(links["row"], minlength=len(window))
        colours = shades(path.rsplit("/")[-1], links)
        columns = LAYERS[path.replace("others/", "")].kind.columns(strips=at_m, colors=colours)
        values: dict[str, Any] = {name: links[name] for name in NUMBERS}
        numbers = rr.AnyValues.columns(**values)
        parts = (part for each in (columns, numbers) for part in each.partition(per_snapshot))
        self.timed(path, parts, window)
