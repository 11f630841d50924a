"""The paper's result figures (V): their missions, swept parameter and axes."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

from swarm_mj.evaluation.published import SWEEPS, points
from swarm_mj.mission import PAPERS, Mission, Task
from swarm_mj.policies.registry import WITHOUT_PAYLOAD, flown_name

FLOCK = "fig2"  # a mission's start and end, drawn by `flock`; the others are below
FORMATS = ("svg", "png", "pdf")
OPTIONS = {
    "num_robots": "--robots",
    "range_ratio": "--range-ratio",
    "velocity_ratio": "--velocity-ratio",
}
# All but sotdma, which is slow. The planners and gnn are drawn under `paper` only: gnn was trained
# there, and they take several times as long as all others together.
DRAWN = (
    "tdma",  # first: the others are compared to it
    *("random-flooding", "round-robin", "mst", "aloha", "gossip", "spatial-tdma"),
    *("planner", WITHOUT_PAYLOAD, "gnn", "greedy-oracle"),
)
PAPER_ONLY = ("planner", WITHOUT_PAYLOAD, "gnn")
Scale = Literal["linear", "log"]


class Panel(NamedTuple):
    """One pair of axes: a cost over the figure's x."""

    cost: str  # aoi or velocity_variance, as results and published points name it
    label: str  # with the cost's unit
    scale: Scale = "log"


AOI = Panel("aoi", "age of information [windows]")
VARIANCE = Panel("velocity_variance", "velocity variance [m²/s²]")


@dataclass(frozen=True, kw_only=True)
class ResultFigure:
    """One of the paper's result figures."""

    published: str  # its name among the published points
    title: str
    task: Task
    x_name: str  # a field of the mission, or receptive_field, a policy's own
    x_label: str  # with its unit
    x_scale: Scale = "linear"
    panels: tuple[Panel, ...] = (AOI,)

    @property
    def name(self) -> str:
        """Its name on the command line."""
        return self.published.partition("_")[0]

    @property
    def xs(self) -> tuple[float, ...]:
        """The published curves' places on the x axis, ascending."""
        return tuple(sorted({point.x for point in points() if point.figure == self.published}))

    @property
    def sweeps_missions(self) -> bool:
        """True if x is a number of the mission, so that every policy has a curve over it."""
        return self.x_name in OPTIONS

    @property
    def fixed(self) -> tuple[str, ...]:
        """The numbers of the mission that are fixed in the figure."""
        free = {self.x_name, *SWEEPS[self.task].irrelevant}
        return tuple(name for name in OPTIONS if name not in free)

    def mission(self, preset: str) -> Mission:
        """Return the missions' numbers as a preset has them; x is any."""
        return PAPERS[preset](self.task)

    def command(self, preset: str) -> str:
        """Return the command that makes the figure's results."""
        return shlex.join(["swarm-mj", *self.arguments(preset), "--csv", "FILE"])

    def arguments(self, preset: str) -> Sequence[str]:
        """Return the arguments of `swarm-mj` that make the figure's results, without the file."""
        drawn = [policy for policy in DRAWN if preset == "paper" or policy not in PAPER_ONLY]
        flown = dict.fromkeys(flown_name(policy, self.mission(preset)) for policy in drawn)
        command = ["evaluate", "--policy", *flown, "--task", self.task, "--preset", preset]
        if self.sweeps_missions:
            command += [OPTIONS[self.x_name], *(f"{x:g}" for x in self.xs)]
        return command


_ALL = (
    ResultFigure(
        published="fig3_receptive_field",
        title="Receptive field",
        task="stationary",
        x_name="receptive_field",
        x_label="receptive field of the GNN [hops]",
        panels=(AOI._replace(scale="linear"),),
    ),
    ResultFigure(
        published="fig4_transmit_power",
        title="Transmit power",
        task="stationary",
        x_name="range_ratio",
        x_label="range ratio: how far a packet reaches in silence [km]",
        x_scale="log",
    ),
    ResultFigure(
        published="fig5_team_size",
        title="Team size",
        task="random-walk",
        x_name="num_robots",
        x_label="team size [robots]",
    ),
    ResultFigure(
        published="fig6_flocking",
        title="Flocking",
        task="flocking",
        x_name="velocity_ratio",
        x_label="velocity ratio: how far a robot gets along an axis [km in 50 s]",
        panels=(AOI, VARIANCE),
    ),
)
RESULT_FIGURES = {figure.name: figure for figure in _ALL}
FIGURES = (FLOCK, *RESULT_FIGURES)
