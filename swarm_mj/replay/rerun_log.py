"""A replay as rerun's recording: each entity's rows on the mission's timelines."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import rerun as rr
from jaxtyping import Float, Int, UInt8

from swarm_mj.replay import palette
from swarm_mj.replay.footage import Ground, followed
from swarm_mj.replay.layer_kinds import (
    Arrows,
    Colours,
    Entity,
    FlatPoint,
    Lines,
    Lines3D,
    Points,
    Rings,
    Strips,
)
from swarm_mj.replay.links import LinkRows, Places, shades
from swarm_mj.replay.log import Log
from swarm_mj.replay.palette import LinkKind
from swarm_mj.replay.walk import neighbours_together

TIMELINE = "window"
CROWD = 400  # robots from which on they are drawn smaller, so that they do not cover each other


@dataclass(kw_only=True)
class Drawn:
    """The facts about all pieces drawn so far that the layout and still things depend on."""

    ground: Ground  # with the lowest and the highest centre
    order: list[int]  # of robots in the age matrix, as they are drawn
    num_windows: int = 0
    num_sent: int = 0  # packets
    hops: float = 4.0  # of the deepest tree, or more
    states: list[UInt8[np.ndarray, "_ N"]] = field(default_factory=list)  # of radios, by number
    variance_m2ps2: list[Float[np.ndarray, "_"]] = field(default_factory=list)
    tops: dict[str, float] = field(default_factory=dict)  # the highest values, by the plot's path
    link_kinds: set[LinkKind] = field(default_factory=set)  # that occurred
    is_any_cut_off: bool = False

    def add_ground(self, ground: Ground) -> None:
        """Make the ground as large as this piece's and those before need it."""
        centres_m = np.concatenate([self.ground.centre_m, ground.centre_m])
        ends_m = np.stack([np.min(centres_m, axis=0), np.max(centres_m, axis=0)])
        reach_m = max(self.ground.reach_m, ground.reach_m)
        self.ground = Ground(centre_m=ends_m, reach_m=reach_m)


class RerunLog:
    """Writes the entities of a flight's log, or of one piece after the other.

    An entity that changes shows the row of the last window. Things that change come with their
    windows, `row`, ascending from 0, the first of the piece; without, they are all robots in each
    window.
    """

    def __init__(self, recordings: Sequence[rr.RecordingStream], log: Log) -> None:
        self._recordings = recordings
        self.scale = min(1.0, math.sqrt(CROWD / log.is_on.shape[1]))  # of robots that are drawn [1]
        # Half the width of what sizes on the map are shares of: the same in all pieces.
        self.unit_m = log.facts.mission.half_side_m
        self.log = log
        self.ground = followed(log.position_m, log.facts.mission)
        self.drawn = Drawn(ground=self.ground, order=neighbours_together(log))
        self.drawn.add_ground(self.ground)
        self.is_first = True

    def move_on(self, piece: Log) -> None:
        """Go on with the piece that follows."""
        self.log = piece
        self.ground = followed(piece.position_m, piece.facts.mission)
        self.drawn.add_ground(self.ground)
        self.is_first = False

    def fixed(self, entity: Entity, *archetypes: rr.AsComponents) -> None:
        """Write what never changes. It would hide the same component written in time."""
        for recording in self._recordings:
            recording.log(entity.path, *archetypes, static=True)

    def look(self, entity: Entity, *archetypes: rr.AsComponents) -> None:
        """Write with the first piece how the things look that every piece has."""
        if self.is_first:
            self.fixed(entity, *archetypes)

    @contextmanager
    def only_to(self, recording: rr.RecordingStream) -> Iterator[None]:
        """Write to this one of the recordings within it, what will be written to all later."""
        recordings = self._recordings
        self._recordings = [recording]
        try:
            yield
        finally:
            self._recordings = recordings

    def timed(
        self,
        entity: Entity,
        columns: Iterable[rr.ComponentColumn],
        window: Int[np.ndarray, "_"] | None = None,
    ) -> None:
        """Write one row per window: of the log, or of the windows given."""
        at = self.log.window if window is None else window
        # Two timelines: one to step by windows, one to play in seconds.
        times = [
            rr.TimeColumn(TIMELINE, sequence=at),
            rr.TimeColumn("mission_time", duration=at * self.log.facts.mission.window_s),
        ]
        shown = list(columns)
        for recording in self._recordings:
            recording.send_columns(entity.path, indexes=times, columns=shown)

    def things(
        self,
        entity: Entity,
        columns: rr.ComponentColumnList,
        row: Int[np.ndarray, "L"] | None = None,
    ) -> None:
        """Write things that change, by the columns of an archetype of rerun's."""
        num_windows = len(self.log.window)
        if row is None:
            per_window = np.full(num_windows, self.log.is_on.shape[1])
        else:
            per_window = np.bincount(row, minlength=num_windows)
        self.timed(entity, columns.partition(per_window))

    def words(self, entity: Entity, texts: list[str], places: Sequence[FlatPoint]) -> None:
        """Write texts that never change at places in 2-D, as labels of points that are not seen."""
        points = rr.Points2D.from_fields(
            positions=places, labels=texts, show_labels=True, radii=-0.1, colors=[palette.TEXT]
        )
        self.fixed(entity, points)

    def strips(
        self, layer: Lines | Lines3D, strips: Strips, row: Int[np.ndarray, "L"] | None = None
    ) -> None:
        """Write lines through several points each."""
        self.look(layer, layer.look())
        self.things(layer, layer.columns(strips), row)

    def lines(
        self,
        layer: Lines | Lines3D,
        start: Float[np.ndarray, "L A"],
        end: Float[np.ndarray, "L A"],
        row: Int[np.ndarray, "L"] | None = None,
    ) -> None:
        """Write straight lines from start to end, in as many dimensions as the layer's."""
        self.strips(layer, np.stack([start, end], axis=1), row)

    def arrows(
        self, layer: Arrows, origins: Places, vectors: Places, row: Int[np.ndarray, "L"]
    ) -> None:
        """Write arrows."""
        self.look(layer, layer.look())
        self.things(layer, rr.Arrows2D.columns(origins=origins, vectors=vectors), row)

    def points(
        self,
        layer: Points,
        positions: Places,
        row: Int[np.ndarray, "L"] | None = None,
        colours: Colours | None = None,
    ) -> None:
        """Write points, each in its colour if the layer has none."""
        scale = self.scale if layer.shrinks else 1.0
        self.look(layer, layer.look(scale=scale))
        self.things(layer, rr.Points2D.columns(positions=positions, colors=colours), row)

    def rings(
        self, layer: Rings, centre: Places, radius_m: float, row: Int[np.ndarray, "L"]
    ) -> None:
        """Write circles of one size."""
        self.look(layer, layer.look())
        half_sizes = np.full(centre.shape, radius_m)
        self.things(layer, rr.Ellipses2D.columns(centers=centre, half_sizes=half_sizes), row)

    def mismatch_lines(
        self,
        layer: Lines | Lines3D,
        kind: LinkKind,
        links: LinkRows,
        at_m: Float[np.ndarray, "L 2 A"],
    ) -> None:
        """Write a line for each of these links; those who click on one read its numbers."""
        self.look(layer, layer.look())
        columns = layer.columns(at_m, shades(kind, links))
        # By the names in `links.NUMBERS`, under which `read` finds them.
        numbers = rr.AnyValues.columns(
            sender=links["sender"],
            receiver=links["receiver"],
            loss_db=links["loss_db"],
            margin_db=links["margin_db"],
        )
        window = self.log.mismatch.window
        per_snapshot = np.bincount(links["row"], minlength=len(window))
        parts = [*columns.partition(per_snapshot), *numbers.partition(per_snapshot)]
        self.timed(layer, parts, window)
