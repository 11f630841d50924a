"""The layers of a replay: each entity's path and look, and what the legend says of the map's.

A layer is one entry here. `write`, `stage` and `charts` draw it by its name in this module, `read`
finds it by the same name, and a view of the layout shows whatever is below the view's path.
"""

from collections.abc import Container
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from swarm_mj.replay import palette
from swarm_mj.replay.layer_kinds import Arrows, Entity, Flat, Lines, Lines3D, Points, Rings, View
from swarm_mj.replay.links import DASHES, WHOLE
from swarm_mj.replay.log import Log
from swarm_mj.replay.palette import Colour, Fate, LinkKind

# The map, from the ground up.
ARENA = View(path="arena")
GROUND_GRID = Lines(path="arena/area/grid", colour=palette.GRID, width=0.5, order=-20.0)
OUTLINE = Lines(path="arena/area/outline", colour=palette.OUTLINE, width=1.5, order=-19.0)
WALLS = Lines(path="arena/area/walls", colour=palette.WALL, width=1.5, order=-19.0)
FILLING = Lines(path="arena/world/filling", colour=palette.OBSTACLE, width=0.5, order=-11.0)
OBSTACLES = Lines(path="arena/world/obstacle", colour=palette.WALL, width=0.8, order=-10.0)
TRAILS = Lines(path="arena/trail", colour=palette.TRAIL, width=1.0, order=-5.0)
RANGE = Rings(path="arena/radio/range", colour=palette.RANGE, width=0.6, order=1.0)
UNBELIEVED = Lines(path="arena/world/unbelieved", colour=None, width=0.6, order=2.0)
TOO_WEAK = Lines(path="arena/world/too_weak", colour=None, width=0.5, order=2.5)
BELIEF_ERROR = Lines(path="arena/belief/error", colour=palette.BELIEF_ERROR, width=0.6, order=3.0)
BELIEF = Rings(path="arena/belief/ring", colour=palette.BELIEF, width=0.8, order=4.0)
PARENTS = Lines(path="arena/tree", colour=palette.TREE, width=0.8, order=6.0)
OVERHEARD = Lines(
    path="arena/radio/overheard",
    colour=palette.PACKETS["overheard"].colour,
    width=0.7,
    order=10.0,
)
HEARD = Lines(path="arena/radio/heard", colour=palette.BROADCAST, width=1.0, order=18.0)
UNANSWERED = Arrows(
    path="arena/radio/unanswered",
    colour=palette.PACKETS["unanswered"].colour,
    width=1.2,
    order=18.0,
)
LOST_REST = Lines(path="arena/radio/lost/rest", colour=palette.LOST_REST, width=0.7, order=18.0)
LOST = Arrows(path="arena/radio/lost", colour=palette.LOST, width=1.8, order=19.0)
DELIVERED = Arrows(path="arena/radio/delivered", colour=palette.DELIVERED, width=2.0, order=20.0)
ANSWERED = Arrows(path="arena/radio/answered", colour=palette.ANSWERED, width=1.5, order=21.0)
CUT_OFF = Points(path="arena/world/cut_off", colour=palette.CUT_OFF, width=12.0, order=24.0)
TRANSMITTERS = Points(
    path="arena/radio/transmitter", colour=palette.BROADCAST, width=9.0, order=25.0
)
WIND = Arrows(path="arena/wind", colour=palette.HEADING, width=2.0, order=28.0)
HEADINGS = Lines(path="arena/heading", colour=palette.HEADING, width=0.8, order=29.0)
ROBOTS = Points(path="arena/robots", colour=None, width=5.5, order=30.0)
EGO_NAME = Points(path="arena/ego/name", colour=palette.EGO, width=0.1, order=30.0)
EGO = Rings(path="arena/ego", colour=palette.EGO, width=1.2, order=31.0)

# The ego robot's tree.
TREE = View(path="tree")
TREE_HOPS = Lines(path="tree/hops", colour=palette.GRID, width=0.5, order=0.0)
TREE_EDGES = Lines(path="tree/edges", colour=palette.TREE, width=0.8, order=1.0)
TREE_NODES = Points(path="tree/nodes", colour=None, width=4.5, order=2.0, shrinks=False)

# The ages of all pairs, and the radio of every robot.
AGES = Entity(path="ages")
STATES = View(path="state")
NOW = Lines(path="state/now", colour=palette.TEXT, width=0.6, order=1.0)
STATE_ROBOTS = STATES.below("robots")
STATE_WINDOWS = STATES.below("windows")

# The scene in 3-D. Robots and halos are solids, whose sizes are in metres.
SCENE = View(path="scene")
SCENE_AREA = View(path="scene/area")
SCENE_ROBOTS = SCENE.below("robots")
SCENE_BODIES = View(path="scene/bodies")
SCENE_CUT_OFF = SCENE.below("world/cut_off")
SCENE_GRID = Lines3D(path="scene/grid", colour=palette.OUTLINE, width=0.5)
SCENE_THRUST = Lines3D(path="scene/thrust", colour=palette.THRUST, width=1.0)
SCENE_WIND = Lines3D(path="scene/wind", colour=palette.HEADING, width=2.0)
SCENE_HEADINGS = Lines3D(path="scene/heading", colour=palette.HEADING, width=0.8)
SCENE_UNBELIEVED = Lines3D(path="scene/world/unbelieved", colour=None, width=0.6)
SCENE_TOO_WEAK = Lines3D(path="scene/world/too_weak", colour=None, width=0.5)

# The charts, and the legend.
AGE_PLOT = View(path="plots/age")
PACKET_PLOT = View(path="plots/radio")
LINK_PLOT = View(path="plots/world")
COST_PLOT = View(path="plots/task")
AGREED = COST_PLOT.below("agreed")
MEAN_AGE = AGE_PLOT.below("mean")
WORST_AGE = AGE_PLOT.below("worst")
LEGEND = View(path="legend")

# The learning curve of a training, beside the mission of its newest policy.
LEARNING = View(path="learning")
LEARNING_GRID = Lines(path="learning/grid", colour=palette.OUTLINE, width=0.5, order=0.0)
LEARNING_REFERENCES = Lines(path="learning/references", colour=None, width=0.8, order=1.0)
LEARNING_ERRORS = Lines(
    path="learning/errors", colour=palette.dim(palette.LEARNED, 0.6), width=0.8, order=2.0
)
LEARNING_CURVE = Lines(path="learning/curve", colour=palette.LEARNED, width=1.0, order=3.0)
LEARNING_POINTS = Points(path="learning/points", colour=palette.LEARNED, width=2.5, order=4.0)
LEARNING_NEWEST = Points(path="learning/newest", colour=palette.TEXT, width=4.0, order=5.0)

# A sheet of text.
ABOUT = Entity(path="about")

# Whom each robot addressed and decoded in both slots; no view shows it, exports read it.
PACKETS = Entity(path="packets")

# By what they show: packets by their fate, links by how channel and belief differ.
PACKET_LINES: dict[Fate, Lines] = {"overheard": OVERHEARD, "heard": HEARD}
PACKET_ARROWS: dict[Fate, Arrows] = {
    "unanswered": UNANSWERED,
    "lost": LOST,
    "delivered": DELIVERED,
    "answered": ANSWERED,
}
PACKET_ARCS: dict[Fate, Lines3D] = {
    fate: Lines3D(path=f"scene/packets/{fate}", colour=style.colour, width=1.0)
    for fate, style in palette.PACKETS.items()
}
LINKS: dict[LinkKind, Lines] = {"unbelieved": UNBELIEVED, "too_weak": TOO_WEAK}
SCENE_LINKS: dict[LinkKind, Lines3D] = {
    "unbelieved": SCENE_UNBELIEVED,
    "too_weak": SCENE_TOO_WEAK,
}


class LegendSample(NamedTuple):
    """The legend's sample of one layer of the map."""

    text: str
    layer: Flat
    colour: Colour | None = None  # where each thing of the layer has its own
    radius: float = 0.0  # of a ring, in units of the legend
    share: float = 1.0  # of the way that an arrow covers
    pieces: Float[np.ndarray, "P 2"] = WHOLE  # that a line is drawn in


def legend(
    log: Log, link_kinds: Container[LinkKind], *, is_any_cut_off: bool
) -> list[list[LegendSample]]:
    """Return the legend's rows: the radio, what else is shown, mismatched links.

    Of these it names the kinds that occur, and robots that are cut off if any ever are.
    """
    packets = _packet_samples(log)
    others = []
    if log.has_motion:
        others.append(LegendSample("heading", HEADINGS))
        others.append(LegendSample(f"r{log.ego}'s belief", BELIEF, radius=0.8))
    if log.facts.mission.has_wind:
        others.append(LegendSample("wind", WIND))
    others.append(LegendSample(f"r{log.ego}'s tree", PARENTS))
    # Beyond free space, the circle is what the range would be.
    text = "range in\nfree space" if log.is_compared else "radio range"
    reach = LegendSample(text, RANGE, radius=2.0)
    if log.facts.is_broadcast:
        packets.append(reach)
    else:  # the four fates of addressed packets fill their row
        others.append(reach)
    rows = [packets, others]
    links: list[LegendSample] = []
    if "too_weak" in link_kinds:
        colour = palette.MISMATCH["too_weak"]
        links.append(LegendSample("believed,\ntoo weak", TOO_WEAK, colour=colour, pieces=DASHES))
    if "unbelieved" in link_kinds:
        colour = palette.MISMATCH["unbelieved"]
        links.append(LegendSample("works,\nunbelieved", UNBELIEVED, colour=colour))
    if is_any_cut_off:
        links.append(LegendSample(f"cut off\nfrom r{log.ego}", CUT_OFF))
    if links:
        rows.append(links)
    return rows


def _packet_samples(log: Log) -> list[LegendSample]:
    if log.facts.is_broadcast:
        return [LegendSample("transmits", TRANSMITTERS), LegendSample("is heard by", HEARD)]
    return [
        LegendSample("delivered", DELIVERED),
        LegendSample("lost", LOST, share=palette.LOST_SHARE),
        LegendSample("answered", ANSWERED),
        LegendSample("overheard", OVERHEARD),
    ]
