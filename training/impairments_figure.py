"""What each impairment costs each policy: one table, and one chart.

    make results STUDIES=impairments
    python training/impairments_figure.py

Writes assets/figures/impairments.png. Numbers are ages over those of the same policy, task and
seeds without impairments. Missions among obstacles are compared to the same ones with a correct
map.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.style import code, look_of, save, styled, write_caption
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.evaluation.results import Result, mission_field
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting
from swarm_mj.system.writing import Output, check_outputs

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "training" / "results"
FILE = "impairments.csv"
TASKS = ("stationary", "random-walk", "flocking")
NONE = "none"
# Names of the missions by the fields in which they differ from those without impairments.
NAMES = {
    "erasure": "{:.0%} of packets lost",
    "burst_begin": "bursts, {:g} per slot",
    "failure_fraction": "{:.0%} of robots fail",
    "clock_offset_s": "clocks {0:.0f} ms apart",
    "clock_drift_ppm": "clocks drift {:g} ppm",
    "map_offset_m": "map {:g} m off",
}
CORRECT_MAP = "correct map"
USUAL = (NONE, CORRECT_MAP)
MOST = 4.0  # times the age, where the colours end
COLOURS = "Reds"


@dataclass(frozen=True, kw_only=True)
class ImpairmentsFigure:
    """Where the figure goes."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "impairments.png",
        "the figure",
        metavar="FILE.png",
        shown="assets/figures/impairments.png",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        check_outputs(Output("figure", self.out, ".png"))
        save(draw(read_results(RESULTS / FILE)), self.out)
        return DONE


def impairment(result: Result) -> str:
    """Return the name of the one impairment that a result's missions have, or `none`."""
    for field, name in NAMES.items():
        value = mission_field(result, field)
        if value:
            return name.format(1e3 * value if field == "clock_offset_s" else value)
    return NONE if result.arena == "open" else CORRECT_MAP


def ages_of(found: Sequence[Result]) -> dict[tuple[str, str, str], float]:
    """Return mean ages by task, policy and impairment [windows]."""
    return {(r.task, r.policy, impairment(r)): r.aoi_mean for r in found}


def ratios(found: Sequence[Result]) -> tuple[list[str], list[str], Float[np.ndarray, "T P I"]]:
    """Return policies, impairments, and by task the ages over those without the impairment.

    Policies are those of all tasks, in the order of their ages without impairments.
    """
    ages = ages_of(found)
    named = dict.fromkeys(r.policy for r in found)
    policies = [each for each in named if all((task, each, NONE) in ages for task in TASKS)]
    policies.sort(key=lambda policy: math.prod(ages[task, policy, NONE] for task in TASKS))
    names = [each for each in dict.fromkeys(map(impairment, found)) if each not in USUAL]
    usual = {name: CORRECT_MAP if name.startswith("map") else NONE for name in names}
    table = [
        [
            [ages[task, policy, name] / ages[task, policy, usual[name]] for name in names]
            for policy in policies
        ]
        for task in TASKS
    ]
    return policies, names, np.array(table)


def table(found: Sequence[Result]) -> str:
    """Return Markdown: ages without impairments, and the mean factor over the three tasks."""
    policies, names, ratio = ratios(found)
    ages = ages_of(found)
    factor = np.exp(np.mean(np.log(ratio), axis=0))
    head = ["policy", "at rest", "walking", "flocking", *names]
    rows: list[list[str]] = []
    for policy, factors in zip(policies, factor, strict=True):
        usual = (ages[task, policy, NONE] for task in TASKS)
        shown = (f"{age:.1f}" for age in usual)
        rows.append([f"`{policy}`", *shown, *(f"{each:.2f}" for each in factors)])
    return markdown_table(head, rows)


def docs_table(folder: Path) -> str:
    """Return the table of the results in a folder."""
    return table(read_results(folder / FILE))


def draw(found: Sequence[Result]) -> Figure:
    """Draw a map of factors for each task: policies down, impairments across."""
    policies, names, ratio = ratios(found)
    with styled():
        figure = Figure(figsize=(7.5, 8.5), layout="constrained")
        colours = LogNorm(1.0, MOST)
        for axes, task, factors in zip(
            figure.subplots(3, 1, sharex=True), TASKS, ratio, strict=True
        ):
            axes.imshow(factors, cmap=COLOURS, norm=colours, aspect="auto")
            axes.set_title(task, loc="left")
            axes.grid(visible=False)
            axes.set_yticks(range(len(policies)), [look_of(each).label for each in policies])
            axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
            for (row, column), value in np.ndenumerate(factors):
                ink = "white" if value > 0.5 * MOST else "black"
                axes.text(
                    column, row, f"{value:.2f}", ha="center", va="center", fontsize=6, color=ink
                )
        figure.suptitle("Age relative to no impairment (1 = unaffected)", x=0.01, ha="left")
        first = found[0]
        said = (
            f"{first.num_robots} robots, {first.num_windows} windows, {first.episodes} missions "
            f"from seed {first.seed}"
        )
        write_caption(figure, f"{said}; {code(first.version, first.commit)}")
    return figure


if __name__ == "__main__":
    sys.exit(script(ImpairmentsFigure, ImpairmentsFigure.__call__))
