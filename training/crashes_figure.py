"""Crashes against the age of information: one figure, and its table in docs/physics.md.

    make results STUDIES=crashes
    python training/crashes_figure.py

Draws assets/figures/crashes.svg and .png.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from crashes import DENSITIES_PER_KM2, delay_of
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.style import (
    FAINT,
    code,
    draw_to,
    look_of,
    panels,
    styled,
    write_caption,
)
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.evaluation.results import Result, mission_field
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "training" / "results"
FILE = "crashes.csv"


@dataclass(frozen=True, kw_only=True)
class CrashesFigure:
    """Where the figure goes."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "crashes",
        "the files, without their endings",
        shown="assets/figures/crashes",
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        draw_to(self.out, lambda: draw(read_results(RESULTS / FILE)))
        return DONE


def at_density(found: Sequence[Result], density_per_km2: float) -> list[Result]:
    """Return the results of teams of a density, by how old their news was."""
    alike = [each for each in found if mission_field(each, "density_per_km2") == density_per_km2]
    return sorted(alike, key=news_age)


def news_age(result: Result) -> float:
    """Return how old robots' news of each other was [windows]."""
    delay = delay_of(result)
    return result.aoi_mean if delay is None else float(delay)


def crashed(result: Result) -> tuple[float, float]:
    """Return how many robots crashed on average, and in the worst mission."""
    if result.crashed_mean is None or result.crashed_worst is None:
        raise ValueError(f"robot {result.robot} cannot crash; fly robots with bodies")
    return result.crashed_mean, result.crashed_worst


def draw(found: Sequence[Result]) -> Figure:
    """Draw crashed robots over the age of their news, a panel for each density."""
    with styled():
        title = "Quadrotors that crashed, by how old their news of each other was"
        figure, both = panels(title, rows=len(DENSITIES_PER_KM2), height_in=5.4)
        for axes, density_per_km2 in zip(both, DENSITIES_PER_KM2, strict=True):
            results = at_density(found, density_per_km2)
            _draw_one(axes, results)
            apart_m = 1e3 / density_per_km2**0.5
            axes.set_title(f"{density_per_km2:,.0f} robots per km², {apart_m:.0f} m apart")
            axes.set_ylabel(f"crashed, of {results[0].num_robots} robots")
            axes.set_ylim(bottom=0.0)
        both[-1].set_xlabel("age of information [windows]")
        both[0].set_ylim(top=1.4 * both[0].get_ylim()[1])  # room for the legend
        both[0].legend(frameon=False, loc="upper left", ncols=3)
        first = found[0]
        said = (
            f"{first.episodes} missions from seed {first.seed}, each of {first.num_windows} "
            "windows; lines up to the worst mission"
        )
        write_caption(figure, f"{said}; {code(first.version, first.commit)}")
    return figure


def _draw_one(axes: Axes, found: Sequence[Result]) -> None:
    """Draw a line of the delays, and a point for each policy, with its worst mission above it."""
    delayed = [each for each in found if delay_of(each) is not None]
    axes.plot(
        [news_age(each) for each in delayed],
        [crashed(each)[0] for each in delayed],
        color=FAINT,
        marker=".",
        linewidth=1.0,
        label="the truth, as old",
    )
    for each in found:
        if delay_of(each) is None:
            look = look_of(each.policy)
            mean, worst = crashed(each)
            axes.plot(
                [each.aoi_mean] * 2, [mean, worst], color=look.colour, linewidth=0.6, alpha=0.6
            )
            axes.plot(
                [each.aoi_mean],
                [mean],
                color=look.colour,
                marker=look.marker,
                linestyle="none",
                label=look.label,
            )


def table(folder: Path) -> str:
    """Return how many robots crashed by what they knew of each other, as Markdown."""
    found = read_results(folder / FILE)
    head = ["news of each other"]
    for density_per_km2 in DENSITIES_PER_KM2:
        head += [f"age, {density_per_km2:,.0f} per km²", "crashed (worst)"]
    cells: dict[str, list[str]] = {}
    # In the order of the densest teams.
    for each in at_density(found, DENSITIES_PER_KM2[-1]):
        cells[_name(each)] = []
    for density_per_km2 in DENSITIES_PER_KM2:
        for each in at_density(found, density_per_km2):
            mean, worst = crashed(each)
            cells[_name(each)] += [f"{news_age(each):.1f}", f"{mean:.1f} ({worst:.0f})"]
    return markdown_table(head, [[name, *row] for name, row in cells.items()])


def _name(result: Result) -> str:
    delay = delay_of(result)
    if delay is None:
        return f"`{result.policy}`"
    return f"the truth, {delay} windows old" if delay else "the truth"


if __name__ == "__main__":
    sys.exit(script(CrashesFigure, CrashesFigure.__call__))
