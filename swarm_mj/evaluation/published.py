"""The paper's result figures as numbers: mean and standard deviation over 100 missions a point.

Source of `published.csv`: the data behind Figs. 3 to 6, which the paper's authors published with
their code; one row per point and cost, methods named as in the figures.

Figs. 3 and 4 both give a stationary team at range ratio 0.25, from different missions: Fig. 3 draws
it as the baselines' level lines (44.43, 45.28, 42.02), Fig. 4 as a point of its curves (46.76,
47.28, 43.31). Both are in `points`; evaluations are compared with Fig. 4's, whose curve they
sweep. Fig. 5's curves fit random walks, not stationary teams: its
40 robots cost what random walks of 40 cost at range ratio 0.25 and velocity ratio 0.15.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import msgspec

from swarm_mj.mission import PAPERS, Mission
from swarm_mj.system.reading import read_rows

METHODS = {
    "random flooding": "random-flooding",
    "round robin": "round-robin",
    "minimum spanning tree": "mst",
}
BASELINES = tuple(METHODS.values())  # the paper's three, as `POLICIES` names them
COSTS = {"age of information [windows]": "aoi", "velocity variance [m^2/s^2]": "velocity_variance"}


@dataclass(frozen=True, kw_only=True)
class Point:
    """One point of one of the paper's curves."""

    figure: str  # fig3_receptive_field, fig4_transmit_power, fig5_team_size or fig6_flocking
    method: str  # as the figure names it
    x_name: str  # receptive_field, range_ratio, num_robots or velocity_ratio
    x: float
    cost: str  # aoi [windows] or velocity_variance [m²/s²]
    mean: float
    std: float  # over the missions
    episodes: int

    @property
    def sem(self) -> float:
        """The mean's standard error."""
        return self.std / math.sqrt(self.episodes)

    @property
    def policy(self) -> str | None:
        """The method's name among `POLICIES`; None for the learned ones."""
        return METHODS.get(self.method)


class Sweep(NamedTuple):
    """The figure that sweeps a field of a task's missions, all others as the paper sets them."""

    figure: str
    x_name: str
    irrelevant: tuple[str, ...] = ()  # fields that change nothing in this task


SWEEPS = {
    "stationary": Sweep("fig4_transmit_power", "range_ratio", irrelevant=("velocity_ratio",)),
    "random-walk": Sweep("fig5_team_size", "num_robots"),
    "flocking": Sweep("fig6_flocking", "velocity_ratio"),
}


@cache
def points() -> tuple[Point, ...]:
    """Return all points of all curves, in the order of the file."""
    _, rows = read_rows(Path(__file__).with_suffix(".csv"), "table", 1_000_000)
    named = [row | {"cost": COSTS[row["cost"]]} for _, row in rows]
    return msgspec.convert(named, tuple[Point, ...], strict=False)


def published(policy: str, mission: Mission) -> dict[str, Point]:
    """Return what the paper reports for one of `POLICIES` in a regime, by cost, if it does.

    It does only where the regime is its preset's in all that the figure does not sweep.
    """
    if mission.task not in SWEEPS or mission.preset not in PAPERS:
        return {}
    sweep = SWEEPS[mission.task]
    free = {name: getattr(mission, name) for name in (sweep.x_name, *sweep.irrelevant)}
    if mission != PAPERS[mission.preset](mission.task, **free):
        return {}
    x = getattr(mission, sweep.x_name)
    found = (p for p in points() if p.figure == sweep.figure and p.policy == policy)
    return {point.cost: point for point in found if point.x == x}
