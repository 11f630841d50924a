"""A replay as rerun's recording: how each entity looks, and its rows on the mission's timelines."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Float, Int

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Ground
from swarm_mj.replay.links import NUMBERS, LinkRows, Points, shades
from swarm_mj.replay.palette import PACKETS, Colour, dim
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


LAYERS = {
    "arena/area/grid": EntityStyle(rr.LineStrips2D, palette.GRID, 0.5, -20.0),
    "arena/area/outline": EntityStyle(rr.LineStrips2D, palette.OUTLINE, 1.5, -19.0),
    "arena/area/walls": EntityStyle(rr.LineStrips2D, palette.WALL, 1.5, -19.0),
    "arena/world/filling": EntityStyle(rr.LineStrips2D, palette.OBSTACLE, 0.5, -11.0),
    "arena/world/obstacle": EntityStyle(rr.LineStrips2D, palette.WALL, 0.8, -10.0),
    "arena/trail": EntityStyle(rr.LineStrips2D, palette.TRAIL, 1.0, -5.0),
    "arena/radio/range": EntityStyle(rr.Ellipses2D, palette.RANGE, 0.6, 1.0),
    "arena/world/unbelieved": EntityStyle(rr.LineStrips2D, None, 0.6, 2.0),
    "arena/world/too_weak": EntityStyle(rr.LineStrips2D, None, 0.5, 2.5),
    "arena/belief/error": EntityStyle(rr.LineStrips2D, dim(palette.BELIEF, 0.8), 0.6, 3.0),
    "arena/belief/ring": EntityStyle(rr.Ellipses2D, palette.BELIEF, 0.8, 4.0),
    "arena/tree": EntityStyle(rr.LineStrips2D, palette.TREE, 0.8, 6.0),
    "arena/radio/overheard": EntityStyle(rr.LineStrips2D, PACKETS["overheard"].colour, 0.7, 10.0),
    "arena/radio/heard": EntityStyle(rr.LineStrips2D, palette.BROADCAST, 1.0, 18.0),
    "arena/radio/unanswered": EntityStyle(rr.Arrows2D, PACKETS["unanswered"].colour, 1.2, 18.0),
    "arena/radio/lost/rest": EntityStyle(rr.LineStrips2D, dim(palette.LOST, 0.5), 0.7, 18.0),
    "arena/radio/lost": EntityStyle(rr.Arrows2D, palette.LOST, 1.8, 19.0),
    "arena/radio/delivered": EntityStyle(rr.Arrows2D, palette.DELIVERED, 2.0, 20.0),
    "arena/radio/answered": EntityStyle(rr.Arrows2D, palette.ANSWERED, 1.5, 21.0),
    "arena/world/cut_off": EntityStyle(rr.Points2D, palette.CUT_OFF, 12.0, 24.0),
    "arena/radio/transmitter": EntityStyle(rr.Points2D, palette.BROADCAST, 9.0, 25.0),
    "arena/heading": EntityStyle(rr.LineStrips2D, palette.HEADING, 0.8, 29.0),
    "arena/robots": EntityStyle(rr.Points2D, None, 5.5, 30.0),
    "arena/ego/name": EntityStyle(rr.Points2D, palette.EGO, 0.1, 30.0),
    "arena/ego": EntityStyle(rr.Ellipses2D, palette.EGO, 1.2, 31.0),
    "tree/hops": EntityStyle(rr.LineStrips2D, palette.GRID, 0.5, 0.0),
    "tree/edges": EntityStyle(rr.LineStrips2D, palette.TREE, 0.8, 1.0),
    "tree/nodes": EntityStyle(rr.Points2D, None, 4.5, 2.0),
    "state/now": EntityStyle(rr.LineStrips2D, palette.TEXT, 0.6, 1.0),
    "scene/grid": EntityStyle(rr.LineStrips3D, palette.OUTLINE, 0.5),
    "scene/heading": EntityStyle(rr.LineStrips3D, palette.HEADING, 0.8),
    "scene/world/unbelieved": EntityStyle(rr.LineStrips3D, None, 0.6),
    "scene/world/too_weak": EntityStyle(rr.LineStrips3D, None, 0.5),
    **{
        f"scene/packets/{fate}": EntityStyle(rr.LineStrips3D, style.colour, 1.0)
        for fate, style in PACKETS.items()
    },
}


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
        """Write things of any number in each window.

        `row` is the log's window of each thing, ascending; None: each window has all robots.
        """
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

    def mismatch_lines(
        self, path: str, links: LinkRows, lines_m: Float[np.ndarray, "L 2 A"]
    ) -> None:
        """Write a line for each of these links; those who click on one read its numbers."""
        self.fixed_layer(path)
        window = self.log.mismatch.window
        per_snapshot = np.bincount(links["row"], minlength=len(window))
        colours = shades(path.rsplit("/")[-1], links)
        columns = LAYERS[path.replace("others/", "")].kind.columns(strips=lines_m, colors=colours)
        values: dict[str, Any] = {name: links[name] for name in NUMBERS}
        numbers = rr.AnyValues.columns(**values)
        parts = (part for each in (columns, numbers) for part in each.partition(per_snapshot))
        self.timed(path, parts, window)
