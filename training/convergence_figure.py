"""How flocks agree over time, beside the law of perfect knowledge (docs/convergence.md).

    make results STUDIES=converging-courses
    python training/convergence_figure.py

Draws assets/figures/convergence.svg and .png from `converging-courses.csv`. Also makes a table of
docs/convergence.md from `converging-late.csv`, which the same flights leave.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, MultipleLocator, NullLocator

from swarm_mj.cli import script
from swarm_mj.evaluation.figures.curves import PERFECT
from swarm_mj.evaluation.figures.style import FAINT, draw_to, look_of, styled, write_caption
from swarm_mj.evaluation.markdown_table import markdown_table
from swarm_mj.mission import Mission, paper
from swarm_mj.protocol.agreement import AGREED, perfect_variance
from swarm_mj.protocol.mission_costs import VELOCITY_VARIANCE
from swarm_mj.system.exit_codes import DONE
from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_rows

ROOT = Path(__file__).resolve().parent.parent
COURSES = "converging-courses.csv"
LATE = "converging-late.csv"
SPANS = ((1, 5), (5, 10), (10, 20), (20, 40))  # of windows
SHOWN_S = 20.0
LEAST = 1e-4  # of the first variance: what is drawn
# Narrower than other figures: a telephone shows it so that its type can be read.
SIZE_IN = (5.4, 4.3)
TYPE_PT = 10.0


@dataclass(frozen=True, kw_only=True)
class ConvergenceFigure:
    """Where the figure goes, and where its numbers are."""

    out: Path = setting(
        ROOT / "assets" / "figures" / "convergence",
        "the files, without their endings",
        shown="assets/figures/convergence",
    )
    results: Path = setting(
        ROOT / "training" / "results", "where they are", metavar="DIR", shown="training/results"
    )

    def __call__(self) -> int:
        """Draw the figure; return the exit code."""
        draw_to(self.out, lambda: draw(read_courses(self.results / COURSES), paper("flocking")))
        return DONE


@dataclass(frozen=True, kw_only=True)
class PolicyCourse:
    """The velocity variance of a policy's flocks after each window [m²/s²]."""

    policy: str
    low: np.ndarray  # nine in ten missions have more
    median: np.ndarray
    high: np.ndarray  # one in ten missions has more
    known: np.ndarray  # robots that a robot has heard of, itself included
    origin: str  # missions, seeds and commit


def read_courses(path: Path) -> list[PolicyCourse]:
    """Return the courses in a file, in its order.

    Raises:
        ValueError: The file cannot be read.
    """
    by_policy: dict[str, list[dict[str, str]]] = {}
    for _, row in read_rows(path, "table of courses"):
        by_policy.setdefault(row["policy"], []).append(row)
    found = []
    for policy, rows in by_policy.items():
        first = rows[0]
        last_seed = int(first["seed"]) + int(first["episodes"]) - 1
        missions = f"{first['episodes']} missions, seeds {first['seed']} to {last_seed}"
        found.append(
            PolicyCourse(
                policy=policy,
                low=np.array([float(row["variance_p10"]) for row in rows]),
                median=np.array([float(row["variance_median"]) for row in rows]),
                high=np.array([float(row["variance_p90"]) for row in rows]),
                known=np.array([float(row["known_mean"]) for row in rows]),
                origin=f"{missions}; commit {first['commit']}",
            )
        )
    return found


def draw(courses: Sequence[PolicyCourse], mission: Mission) -> Figure:
    """Draw the median of each policy with the middle four fifths of its flocks, and the law."""
    law = perfect_variance(mission)
    with styled():
        figure = Figure(figsize=SIZE_IN, layout="constrained")
        axes = figure.subplots()
        for course in courses:
            _draw_course(axes, course, mission.window_s)
        its = look_of(PERFECT)
        time_s = np.arange(1, len(law) + 1) * mission.window_s
        axes.plot(time_s, law, color="#222222", linestyle="--", linewidth=1.6, label=its.label)
        limit = AGREED * law[0]
        axes.axhline(limit, color=FAINT, linewidth=0.9, linestyle=":")
        note = {"color": FAINT, "fontsize": TYPE_PT - 1.0, "ha": "right", "va": "bottom"}
        axes.text(SHOWN_S, limit, f"agreed: under {AGREED:.0%}", **note)
        axes.set_yscale("log")
        axes.set_xlim(0.0, SHOWN_S)
        axes.set_ylim(LEAST * law[0], 1.4 * law[0])
        axes.yaxis.set_major_locator(LogLocator())
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_major_locator(MultipleLocator(5.0))
        axes.set_xlabel("time [s]", fontsize=TYPE_PT)
        axes.set_title(VELOCITY_VARIANCE.label, fontsize=TYPE_PT)
        axes.tick_params(labelsize=TYPE_PT)
        axes.legend(
            frameon=False, fontsize=TYPE_PT - 1.0, ncols=3, loc="lower left", handlelength=1.4,
            bbox_to_anchor=(-0.1, 1.08), columnspacing=1.0,
        )  # fmt: skip
        write_caption(figure, f"medians and the middle 80 % of {courses[0].origin}")
    return figure


def _draw_course(axes: Axes, course: PolicyCourse, window_s: float) -> None:
    look = look_of(course.policy)
    time_s = np.arange(1, len(course.median) + 1) * window_s
    axes.fill_between(time_s, course.low, course.high, color=look.colour, alpha=0.12, linewidth=0.0)
    every = {"marker": look.marker, "markersize": look.marker_size, "markevery": (20, 40)}
    axes.plot(time_s, course.median, color=look.colour, label=look.label, **every)


def start_table(folder: Path) -> str:
    """Return how much of the variance is left a window later, by how many are known, as Markdown.

    Of each span of windows and each policy: the robots known, measured, and by `fresh_factor`.
    """
    mission = paper("flocking")
    courses = read_courses(folder / COURSES)
    head = ["windows", *(f"`{course.policy}`" for course in courses)]
    lines: list[list[str]] = []
    for first, last in SPANS:
        cells = []
        for course in courses:
            left = course.median[last - 1] / course.median[first - 1]
            measured = left ** (1.0 / (last - first))
            known = float(np.mean(course.known[first - 1 : last]))
            by_them = fresh_factor(known, mission.num_robots, mission.window_s)
            cells.append(f"{known:.1f}: {measured:.2f}, {by_them:.2f}")
        lines.append([f"{first} to {last}", *cells])
    return markdown_table(head, lines)


def fresh_factor(known: float, num_robots: int, window_s: float) -> float:
    """Return how much of the variance a window leaves if robots have fresh news of few only.

    Args:
        known: How many robots each one knows of, itself included; any others are as likely.
        num_robots: In the team.
        window_s: A window's length, dt.

    Returns:
        (1 - dt)² + (1 - (1 - dt)²) c, where c = (N - n) / (n (N - 1)).
    """
    perfect = (1.0 - window_s) ** 2
    chance = (num_robots - known) / (known * (num_robots - 1))
    return perfect + (1.0 - perfect) * chance


def late_table(folder: Path) -> str:
    """Return late rates by policy and team size, beside what the ages make of them, as Markdown."""
    rows = [row for _, row in read_rows(folder / LATE, "table of late rates")]
    sizes = list(dict.fromkeys(row["num_robots"] for row in rows))
    cells = {(row["policy"], row["num_robots"]): row for row in rows}
    head = ["policy", *(f"{size} robots" for size in sizes)]
    lines: list[list[str]] = []
    for policy in dict.fromkeys(row["policy"] for row in rows):
        shown = [_late(cells[policy, size]) for size in sizes]
        lines.append([f"`{policy}`", *shown])
    return markdown_table(head, lines)


def _late(row: dict[str, str]) -> str:
    """Return the age, the rate measured and the rate by the ages."""
    measured = f"{float(row['late_rate']):.3f}" if row["late_rate"] else "-"
    return f"{float(row['age_mean']):.0f}: {measured}, {float(row['stale_rate']):.3f}"


if __name__ == "__main__":
    sys.exit(script(ConvergenceFigure, ConvergenceFigure.__call__))
