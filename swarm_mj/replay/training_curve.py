"""A training's learning curve beside the mission of its newest policy, in the viewer.

It is drawn in 2-D: rerun's own plots are over the timeline that the mission is played on.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import rerun as rr
from jaxtyping import Float

from swarm_mj.replay import layers, palette
from swarm_mj.replay.layer_kinds import FlatPoint
from swarm_mj.replay.rerun_log import RerunLog

SIZE = (600.0, 330.0)  # of the plot, in units of its own, y down
# What the view shows: left and below are the numbers of the ticks, to the right the lines' names.
NAMES = 150.0
X_RANGE = (-40.0, SIZE[0] + NAMES)
Y_RANGE = (-20.0, SIZE[1] + 46.0)
TEXT_UP = 10.0  # rerun writes below a point: from there to the middle of a text
LINE = 23.0  # from the middle of one text to the next
LEAD = 14.0  # to the right of the plot: from a line's end to the height of its name
LETTER = 6.2  # of a name, about, in a window of 1500 pixels; names stand amid their place
UNDER = 14.0  # from the plot to the numbers below it
NUM_TICKS = 5  # of decisions, about
POLICY = "policy in training"


@dataclass(frozen=True, kw_only=True)
class TrainingCurve:
    """All evaluations of a training so far, and policies to compare with on the same missions."""

    title: str  # what is drawn, with its unit
    decisions: Float[np.ndarray, "E"]  # of teams, before each evaluation
    cost: Float[np.ndarray, "E"]  # of the policy in training
    digits: int  # after the point, of a cost beside its line
    sem: Float[np.ndarray, "E"]  # its standard error; 0 where it is not known
    references: Mapping[str, float]  # costs of policies that do not learn, by their names


class CostAxis(NamedTuple):
    """The axis of costs, logarithmic unless one is 0: untrained policies are many times worse."""

    ticks: list[float]  # from its lower end to its upper end
    is_log: bool

    def share(self, values: Float[np.ndarray, "*S"]) -> Float[np.ndarray, "*S"]:
        """Return how far up the axis values are, from 0 to 1; those beyond an end are there."""
        low = self.ticks[0]
        high = self.ticks[-1]
        values = np.clip(values, low, high)
        if self.is_log:
            return np.log(values / low) / math.log(high / low)
        return (values - low) / (high - low)


def cost_axis(values: Sequence[float]) -> CostAxis:
    """Return an axis from the round number below all values to the one above them."""
    lowest = min(values)
    highest = max(values)
    if lowest <= 0.0:
        return CostAxis(ticks=[0.0, palette.nice_top(highest)], is_log=False)
    rounds: list[float] = []
    for decade in range(math.floor(math.log10(lowest)), math.ceil(math.log10(highest)) + 2):
        rounds += [step * 10.0**decade for step in (1.0, 2.0, 5.0)]
    first = max(tick for tick in rounds if tick <= lowest)
    last = min(tick for tick in rounds if tick >= highest and tick > first)
    return CostAxis(ticks=[tick for tick in rounds if first <= tick <= last], is_log=True)


def spread(heights: Sequence[float], least: float) -> list[float]:
    """Return where texts stand so that none covers another, each as near to its height as may be.

    Args:
        heights: Where they belong.
        least: From one to the next.
    """
    order = np.argsort(heights, kind="stable")
    spread_out = [heights[at] for at in order]
    # Those that are too near stand around the middle of where they belong, as a block.
    blocks: list[list[float]] = []
    for height in spread_out:
        blocks.append([height])
        while len(blocks) > 1 and _top(blocks[-1], least) - _bottom(blocks[-2], least) < least:
            blocks[-2:] = [blocks[-2] + blocks[-1]]
    places = [0.0] * len(heights)
    number = 0
    for block in blocks:
        for row in range(len(block)):
            places[order[number]] = _top(block, least) + row * least
            number += 1
    return places


def _top(block: Sequence[float], least: float) -> float:
    return float(np.mean(block)) - least * (len(block) - 1) / 2.0


def _bottom(block: Sequence[float], least: float) -> float:
    return float(np.mean(block)) + least * (len(block) - 1) / 2.0


def draw_training_curve(out: RerunLog, curve: TrainingCurve) -> None:
    """Draw the curve with its standard errors, the references, and the names of all lines."""
    ends = [*(curve.cost - curve.sem), *(curve.cost + curve.sem)]
    known = [each for each in ends if each > 0.0]
    axis = cost_axis([*curve.cost, *known, *curve.references.values()])
    width, height = SIZE
    last = max(1.0, float(curve.decisions[-1]))
    x = width * curve.decisions / last

    def y_of(costs: Float[np.ndarray, "*S"]) -> Float[np.ndarray, "*S"]:
        return height * (1.0 - axis.share(costs))

    _draw_axes(out, axis, last)
    y = y_of(curve.cost)
    low = y_of(curve.cost - curve.sem)
    high = y_of(curve.cost + curve.sem)
    bars = [[(a, b), (a, c)] for a, b, c in zip(x, low, high, strict=True)]
    points = list(zip(x.tolist(), y.tolist(), strict=True))
    out.fixed(layers.LEARNING_ERRORS, layers.LEARNING_ERRORS.look(strips=bars))
    out.fixed(layers.LEARNING_CURVE, layers.LEARNING_CURVE.look(strips=[points]))
    out.fixed(layers.LEARNING_POINTS, layers.LEARNING_POINTS.look(positions=points))
    out.fixed(layers.LEARNING_NEWEST, layers.LEARNING_NEWEST.look(positions=points[-1:]))

    costs = {POLICY: float(curve.cost[-1])} | dict(curve.references)
    names = [f"{name} {cost:.{curve.digits}f}" for name, cost in costs.items()]
    levels = y_of(np.array(list(costs.values()))).tolist()
    _draw_references(out, names, levels)


def _draw_references(out: RerunLog, names: list[str], levels: list[float]) -> None:
    """Draw a line across for each policy but the first, and lead from all to their names."""
    width, _ = SIZE
    places = spread(levels, LINE)
    colours = [palette.LEARNED]
    strips: list[list[FlatPoint]] = []
    for number, (level, place) in enumerate(zip(levels, places, strict=True)):
        beside = width + NAMES / 2.0 - LETTER * len(names[number]) / 2.0
        to_name = [(width, level), (width + LEAD, place), (max(width + LEAD, beside), place)]
        if number > 0:
            to_name.insert(0, (0.0, level))
            colours.append(palette.REFERENCES[(number - 1) % len(palette.REFERENCES)])
        strips.append(to_name)
    layer = layers.LEARNING_REFERENCES
    out.fixed(layer, layer.look(strips=strips), rr.LineStrips2D.from_fields(colors=colours))
    at_names = [(width + NAMES / 2.0, place - TEXT_UP) for place in places]
    out.words(layers.LEARNING.below("names"), names, at_names)


def _draw_axes(out: RerunLog, axis: CostAxis, last: float) -> None:
    """Draw the ticks of both axes, a line across for each cost, and what is to the right."""
    width, height = SIZE
    levels = height * (1.0 - axis.share(np.array(axis.ticks)))
    across = [[(0.0, level), (width, level)] for level in levels]
    upright = [[(0.0, 0.0), (0.0, height)]]
    out.fixed(layers.LEARNING_GRID, layers.LEARNING_GRID.look(strips=[*across, *upright]))
    costs = [f"{tick:g}" for tick in axis.ticks]
    places = [(X_RANGE[0] / 2.0, level - TEXT_UP) for level in levels]
    every = max(1.0, palette.nice_top(last / NUM_TICKS))
    for tick in np.arange(0.0, last, every):
        costs.append(f"{tick:,.0f}")
        places.append((width * tick / last, height + UNDER))
    costs.append("team decisions")
    places.append((width + NAMES / 2.0, height + UNDER))
    out.words(layers.LEARNING.below("ticks"), costs, places)
