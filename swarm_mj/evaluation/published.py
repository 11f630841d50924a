"""The paper's result figures (V): their missions, axes and numbers.

Source of `published.csv`, mean and standard deviation over 100 missions a point: the data behind
Figs. 3 to 6, which the paper's authors published with their code; one row per point and cost.

Figs. 3 and 4 both show a stationary team at range ratio 0.25, but from different missions: in
Fig. 3 the baselines are level lines (44.43, 45.28, 42.02), in Fig. 4 points of curves (46.76,
47.28, 43.31). `points` has both. Evaluations are compared with Fig. 4, because they sweep its x
axis. Fig. 5's curves fit random walks, not stationary teams: at 40 robots they cost what random
walks cost at range ratio 0.25 and velocity ratio 0.15.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Literal, NamedTuple, TypeAlias

import msgspec
import numpy as np

from swarm_mj.mission import PAPERS, Mission, Task
from swarm_mj.protocol.agreement import perfect_variance
from swarm_mj.protocol.mission_costs import AOI, VELOCITY_VARIANCE, MissionCost
from swarm_mj.system.reading import read_rows

BASELINES = ("random-flooding", "round-robin", "mst")  # the paper's three
FLOCK = "fig2"  # a mission's start and end, drawn by `flock`; the others are below
FORMATS = ("svg", "png", "pdf")
AxisScale: TypeAlias = Literal["linear", "log"]
MissionField: TypeAlias = Literal["num_robots", "range_ratio", "velocity_ratio"]
# The fields that figures sweep, by the command line's options.
OPTIONS: dict[MissionField, str] = {
    "num_robots": "--robots",
    "range_ratio": "--range-ratio",
    "velocity_ratio": "--velocity-ratio",
}


@dataclass(frozen=True, kw_only=True)
class Point:
    """One point of one of the paper's curves."""

    figure: str  # fig3_receptive_field, fig4_transmit_power, fig5_team_size or fig6_flocking
    method: str  # one of `BASELINES`, or a learned one as the figure names it
    x_name: str  # receptive_field, range_ratio, num_robots or velocity_ratio
    x: float
    cost: str  # the column of one of `MISSION_COSTS`
    mean: float  # in the cost's unit
    std: float  # over the missions
    episodes: int

    @property
    def sem(self) -> float:
        """The mean's standard error."""
        return self.std / math.sqrt(self.episodes)


@cache
def points() -> tuple[Point, ...]:
    """Return all points of all curves, in the order of the file."""
    path = Path(__file__).with_suffix(".csv")
    rows = read_rows(path, "table", 1_000_000)
    return msgspec.convert([row for _, row in rows], tuple[Point, ...], strict=False)


class Panel(NamedTuple):
    """One pair of axes: a cost over the figure's x."""

    cost: MissionCost
    scale: AxisScale = "log"
    # Its mean over a mission in which all robots always know all, if that can be computed.
    perfect: Callable[[Mission], float] | None = None


@dataclass(frozen=True, kw_only=True)
class ResultFigure:
    """One of the paper's result figures."""

    published: str  # its name among the published points
    title: str
    task: Task
    x_name: MissionField | Literal["receptive_field"]  # the latter is a policy's own
    x_label: str  # with its unit
    x_scale: AxisScale = "linear"
    irrelevant: tuple[MissionField, ...] = ()  # fields that change nothing in this task
    panels: tuple[Panel, ...]

    @property
    def name(self) -> str:
        """Its name on the command line."""
        return self.published.partition("_")[0]

    @property
    def xs(self) -> tuple[float, ...]:
        """The published curves' places on the x axis, ascending."""
        found = {point.x for point in points() if point.figure == self.published}
        return tuple(sorted(found))

    @property
    def sweeps_missions(self) -> bool:
        """True if x is a number of the mission, so that every policy has a curve over it."""
        return self.x_name in OPTIONS

    @property
    def fixed(self) -> tuple[MissionField, ...]:
        """The numbers of the mission that are fixed in the figure."""
        free = {self.x_name, *self.irrelevant}
        return tuple(name for name in OPTIONS if name not in free)

    def mission(self, preset: str) -> Mission:
        """Return the missions' numbers as a preset has them; x is any."""
        return PAPERS[preset](self.task)

    def command(self, preset: str) -> str:
        """Return the command that makes the figure's results."""
        return " ".join(["swarm-mj", *self.arguments(preset), "--csv FILE"])

    def arguments(self, preset: str) -> list[str]:
        """Return the arguments of `swarm-mj` that fly the figure's missions."""
        arguments = ["evaluate", "--task", self.task, "--preset", preset]
        if self.x_name in OPTIONS:
            arguments.append(OPTIONS[self.x_name])
            arguments += [f"{x:g}" for x in self.xs]
        return arguments


def perfect_mean(mission: Mission) -> float:
    """Return the velocity variance of a flock that knows itself perfectly, its mean over windows.

    Args:
        mission: The flock's.

    Returns:
        In m²/s²: 0.050 for the paper's flock of 40 robots.
    """
    return float(np.mean(perfect_variance(mission)))


RECEPTIVE_FIELD = ResultFigure(
    published="fig3_receptive_field",
    title="Receptive field",
    task="stationary",
    x_name="receptive_field",
    x_label="receptive field of the GNN [hops]",
    irrelevant=("velocity_ratio",),
    panels=(Panel(cost=AOI, scale="linear"),),
)
"""Stationary teams whose GNN looks one to several hops far (Fig. 3)."""

TRANSMIT_POWER = ResultFigure(
    published="fig4_transmit_power",
    title="Transmit power",
    task="stationary",
    x_name="range_ratio",
    x_label="range ratio: range with no interference [km]",
    x_scale="log",
    irrelevant=("velocity_ratio",),
    panels=(Panel(cost=AOI),),
)
"""Stationary teams whose packets reach less or more far (Fig. 4)."""

TEAM_SIZE = ResultFigure(
    published="fig5_team_size",
    title="Team size",
    task="random-walk",
    x_name="num_robots",
    x_label="team size [robots]",
    panels=(Panel(cost=AOI),),
)
"""Random walks of teams that are smaller or larger (Fig. 5)."""

FLOCKING = ResultFigure(
    published="fig6_flocking",
    title="Flocking",
    task="flocking",
    x_name="velocity_ratio",
    x_label="velocity ratio: how far a robot gets along an axis [km in 50 s]",
    panels=(
        Panel(cost=AOI),
        Panel(cost=VELOCITY_VARIANCE, perfect=perfect_mean),
    ),
)
"""Flocks that are slower or faster (Fig. 6)."""

_ALL = (RECEPTIVE_FIELD, TRANSMIT_POWER, TEAM_SIZE, FLOCKING)
RESULT_FIGURES = {figure.name: figure for figure in _ALL}
FIGURES = (FLOCK, *RESULT_FIGURES)
# The figure that sweeps a field of a task's missions, all others as the paper sets them.
SWEEPS = {figure.task: figure for figure in _ALL if figure.sweeps_missions}


def published(policy: str, mission: Mission) -> dict[str, Point]:
    """Return what the paper reports for a policy, if only x differs from a preset of the paper's.

    Args:
        policy: Its name.
        mission: The missions, all with these numbers.

    Returns:
        The published points, by the columns of their costs; none for other policies or missions.
    """
    if policy not in BASELINES or mission.task not in SWEEPS or mission.preset not in PAPERS:
        return {}
    sweep = SWEEPS[mission.task]
    free = {name: getattr(mission, name) for name in (sweep.x_name, *sweep.irrelevant)}
    if mission != PAPERS[mission.preset](mission.task, **free):
        return {}
    x = getattr(mission, sweep.x_name)
    wanted = (sweep.published, policy, x)
    found: dict[str, Point] = {}
    for point in points():
        if (point.figure, point.method, point.x) == wanted:
            found[point.cost] = point
    return found
