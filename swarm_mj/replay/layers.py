"""How everything on the map and in the tree looks; the legend's samples look the same."""

from typing import Any, NamedTuple

import rerun as rr

from swarm_mj.replay import palette
from swarm_mj.replay.palette import Colour, dim


def screen(points: float) -> float:
    """A radius in points of the screen, the same at every zoom; rerun marks these as negative."""
    return -points


class Layer(NamedTuple):
    """What the things of one entity are drawn as."""

    kind: Any  # rerun's archetype
    colour: Colour | None  # None: each thing has its own
    width: float  # of lines, or the radius of points, on the screen [points]
    order: float  # the higher is drawn over the lower

    @property
    def style(self) -> dict[str, object]:
        """The archetype's fields that are the same for all things, at all times."""
        radii = "line_radii" if self.kind is rr.Ellipses2D else "radii"
        colours = {} if self.colour is None else {"colors": [self.colour]}
        return {radii: screen(self.width), "draw_order": self.order, **colours}


LAYERS = {
    "arena/area/grid": Layer(rr.LineStrips2D, palette.GRID, 0.5, -20.0),
    "arena/area/outline": Layer(rr.LineStrips2D, palette.OUTLINE, 1.5, -19.0),
    "arena/area/walls": Layer(rr.LineStrips2D, palette.WALL, 1.5, -19.0),
    "arena/world/filling": Layer(rr.LineStrips2D, palette.OBSTACLE, 0.5, -11.0),
    "arena/world/obstacle": Layer(rr.LineStrips2D, palette.WALL, 0.8, -10.0),
    "arena/trail": Layer(rr.LineStrips2D, palette.TRAIL, 1.0, -5.0),
    "arena/radio/range": Layer(rr.Ellipses2D, palette.RANGE, 0.6, 1.0),
    "arena/world/unbelieved": Layer(rr.LineStrips2D, None, 0.6, 2.0),
    "arena/world/too_weak": Layer(rr.LineStrips2D, None, 0.5, 2.5),
    "arena/belief/error": Layer(rr.LineStrips2D, dim(palette.BELIEF, 0.8), 0.6, 3.0),
    "arena/belief/ring": Layer(rr.Ellipses2D, palette.BELIEF, 0.8, 4.0),
    "arena/tree": Layer(rr.LineStrips2D, palette.TREE, 0.8, 6.0),
    "arena/radio/overheard": Layer(rr.LineStrips2D, dim(palette.OVERHEARD, 0.6), 0.7, 10.0),
    "arena/radio/heard": Layer(rr.LineStrips2D, palette.BROADCAST, 1.0, 18.0),
    "arena/radio/unanswered": Layer(rr.Arrows2D, dim(palette.ANSWERED, 0.6), 1.2, 18.0),
    "arena/radio/lost/rest": Layer(rr.LineStrips2D, dim(palette.LOST, 0.5), 0.7, 18.0),
    "arena/radio/lost": Layer(rr.Arrows2D, palette.LOST, 1.8, 19.0),
    "arena/radio/delivered": Layer(rr.Arrows2D, palette.DELIVERED, 2.0, 20.0),
    "arena/radio/answered": Layer(rr.Arrows2D, palette.ANSWERED, 1.5, 21.0),
    "arena/world/cut_off": Layer(rr.Points2D, palette.CUT_OFF, 12.0, 24.0),
    "arena/radio/transmitter": Layer(rr.Points2D, palette.BROADCAST, 9.0, 25.0),
    "arena/heading": Layer(rr.LineStrips2D, palette.HEADING, 0.8, 29.0),
    "arena/robots": Layer(rr.Points2D, None, 5.5, 30.0),
    "arena/ego/name": Layer(rr.Points2D, palette.EGO, 0.1, 30.0),
    "arena/ego": Layer(rr.Ellipses2D, palette.EGO, 1.2, 31.0),
    "tree/hops": Layer(rr.LineStrips2D, palette.GRID, 0.5, 0.0),
    "tree/edges": Layer(rr.LineStrips2D, palette.TREE, 0.8, 1.0),
    "tree/nodes": Layer(rr.Points2D, None, 4.5, 2.0),
}
