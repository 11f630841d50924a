"""The kinds of a replay's layers: lines, arrows, rings and points, each with its look in rerun."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, TypeVar

import numpy as np
import rerun as rr
from jaxtyping import UInt8

from swarm_mj.replay.palette import Colour

FlatPoint: TypeAlias = tuple[float, float]
Strips: TypeAlias = Sequence[Sequence[FlatPoint]] | Sequence[np.ndarray] | np.ndarray
Colours: TypeAlias = UInt8[np.ndarray, "_ 3"]


@dataclass(frozen=True, kw_only=True)
class Entity:
    """A place in rerun's recording, where things of one kind are kept."""

    path: str

    def below(self, name: str) -> "Entity":
        """Return the entity of this name below this one."""
        return Entity(path=f"{self.path}/{name}")


@dataclass(frozen=True, kw_only=True)
class View(Entity):
    """An entity that a view of the layout shows, with all that is below it."""

    @property
    def contents(self) -> str:
        """The contents of the view, in rerun's words."""
        return f"/{self.path}/**"


@dataclass(frozen=True, kw_only=True)
class ReplayLayer(Entity):
    """An entity whose things are drawn alike in every window."""

    colour: Colour | None  # None: each thing has its own
    width: float  # of lines, or the radius of points, on the screen [points]

    @property
    def colours(self) -> list[Colour] | None:
        """The colour as rerun takes it, for all things."""
        return None if self.colour is None else [self.colour]

    @property
    def radii(self) -> float:
        """The width as rerun takes it: what is below 0 is in points on the screen."""
        return -self.width


@dataclass(frozen=True, kw_only=True)
class FlatLayer(ReplayLayer):
    """A layer in 2-D, where what is drawn last covers the rest."""

    order: float  # the higher is drawn over the lower


@dataclass(frozen=True, kw_only=True)
class Lines(FlatLayer):
    """Lines in 2-D."""

    def look(self, strips: Strips | None = None, radii: float | None = None) -> rr.LineStrips2D:
        """Return the look, and lines that never change; `radii` replaces the layer's own."""
        return rr.LineStrips2D.from_fields(
            strips=strips,
            radii=self.radii if radii is None else radii,
            colors=self.colours,
            draw_order=self.order,
        )

    def columns(self, strips: Strips, colours: Colours | None = None) -> rr.ComponentColumnList:
        """Return lines that change, each in its colour if the layer has none."""
        return rr.LineStrips2D.columns(strips=strips, colors=colours)


@dataclass(frozen=True, kw_only=True)
class Arrows(FlatLayer):
    """Arrows in 2-D."""

    def look(
        self, origins: Sequence[FlatPoint] | None = None, vectors: Sequence[FlatPoint] | None = None
    ) -> rr.Arrows2D:
        """Return the look, and arrows that never change."""
        return rr.Arrows2D.from_fields(
            origins=origins,
            vectors=vectors,
            radii=self.radii,
            colors=self.colours,
            draw_order=self.order,
        )


@dataclass(frozen=True, kw_only=True)
class Rings(FlatLayer):
    """Circles in 2-D, whose width is that of their line."""

    def look(
        self,
        centers: Sequence[FlatPoint] | None = None,
        half_sizes: Sequence[FlatPoint] | None = None,
    ) -> rr.Ellipses2D:
        """Return the look, and circles that never change."""
        return rr.Ellipses2D.from_fields(
            centers=centers,
            half_sizes=half_sizes,
            line_radii=self.radii,
            colors=self.colours,
            draw_order=self.order,
        )


@dataclass(frozen=True, kw_only=True)
class Points(FlatLayer):
    """Points in 2-D."""

    shrinks: bool = True  # in large teams, where robots would cover each other

    def look(self, positions: Sequence[FlatPoint] | None = None, scale: float = 1.0) -> rr.Points2D:
        """Return the look, and points that never change; `scale` is of their size."""
        return rr.Points2D.from_fields(
            positions=positions,
            radii=scale * self.radii,
            colors=self.colours,
            draw_order=self.order,
        )


@dataclass(frozen=True, kw_only=True)
class Lines3D(ReplayLayer):
    """Lines in 3-D."""

    def look(self, strips: Strips | None = None) -> rr.LineStrips3D:
        """Return the look, and lines that never change."""
        return rr.LineStrips3D.from_fields(strips=strips, radii=self.radii, colors=self.colours)

    def columns(self, strips: Strips, colours: Colours | None = None) -> rr.ComponentColumnList:
        """Return lines that change, each in its colour if the layer has none."""
        return rr.LineStrips3D.columns(strips=strips, colors=colours)


# What a map is made of.
Flat: TypeAlias = Lines | Arrows | Rings | Points
AnyLayer = TypeVar("AnyLayer", bound=ReplayLayer)


def of_others(layer: AnyLayer) -> AnyLayer:
    """Return the layer of the links between others, which look like the observer's."""
    # An entity of their own, which the layout hides: all of a city's would hide the map.
    above, _, name = layer.path.rpartition("/")
    return replace(layer, path=f"{above}/others/{name}")
