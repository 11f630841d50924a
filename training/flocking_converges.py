"""How flocks agree on a velocity over time, beside what perfect knowledge would reach (Eqs. 15-17).

    python training/flocking_converges.py

Flies the same missions with five policies, and writes two tables to training/results/. Of each
window, `converging-courses.csv` has the velocity variance that most flocks have. Of teams of each
size, `converging-late.csv` has how fast they go on to agree once all have heard of all, and what
`stale_rate` makes of their news' ages. `convergence_figure.py` draws the first table.
"""

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int
from rich.console import Console
from rich.table import Table
from scipy.optimize import root_scalar

from swarm_mj.cli import script
from swarm_mj.evaluation.ages import count_ages
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.agreement import Course, agreed_window
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.simulation.rollout import Summary, rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.terminal import WorkBar
from swarm_mj.system.writing import Output, check_outputs, write_csv

RESULTS = Path(__file__).resolve().parent / "results"
POLICIES = ("planner", "tdma", "random-flooding", "round-robin", "mst")
SIZES = (10, 20, 40, 80)
LATE = 1e-12  # of the first velocity variance: less than this is left to rounding errors
LEAST_LATE = 20  # windows over which a late rate is measured, at least


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is flown."""

    mission: Mission = paper("flocking")
    first_seed: int = setting(980_000, "of the first mission")
    num_missions: int = setting(100, "for each policy", low=1, high=10_000)
    late_missions: int = setting(20, "for each policy and team size", low=1, high=10_000)
    sizes: tuple[int, ...] = setting(SIZES, "of the teams that go on to agree", low=2, high=1000)
    out: Path = setting(
        RESULTS / "converging-courses.csv", "the table of courses", metavar="FILE.csv"
    )
    late: Path = setting(
        RESULTS / "converging-late.csv", "the table of late rates", metavar="FILE.csv"
    )


@dataclass(frozen=True, kw_only=True)
class CourseRow:
    """The velocity variance of flocks after one window [m²/s²]."""

    policy: str
    window: int
    variance_p10: float  # nine in ten missions have more
    variance_median: float
    variance_p90: float  # one in ten missions has more
    known_mean: float  # robots that a robot has heard of, itself included
    episodes: int
    seed: int  # of the first mission
    commit: str | None


@dataclass(frozen=True, kw_only=True)
class LateRow:
    """How fast flocks agree once all robots have heard of all."""

    policy: str
    num_robots: int
    age_mean: float  # of news of others, in the second half of the missions [windows]
    late_rate: float | None  # the median over missions; None if they are over too soon [1/window]
    stale_rate: float  # what the ages make of it [1/window]
    flocks: int  # that a late rate was measured of
    episodes: int
    seed: int  # of the first mission
    commit: str | None


@dataclass(frozen=True, kw_only=True)
class Flown:
    """What became of the flocks of one policy."""

    variance_m2ps2: Course
    known: Course  # robots that a robot has heard of, itself included, mean over robots
    summary: Summary
    age_counts: Int[np.ndarray, "bins"]  # news of others by age [slots]; of flocks that agreed


def fly(mission: Mission, policy_name: str, seeds: range) -> Flown:
    """Fly missions side by side; count ages at the ends of the second half of their windows."""
    swarm = Swarm(mission, seeds)
    windows = []
    known = []
    counts = np.zeros((len(seeds), round(mission.num_windows / SLOT_WINDOWS) + 2), dtype=np.int64)
    everyone = np.ones((1, mission.num_robots), dtype=np.bool_)
    with WorkBar(policy_name, mission.num_windows, "windows") as bar:
        for window in rollout(swarm, make_policy(policy_name, mission)):
            windows.append(window)
            known.append(np.mean(np.sum(swarm.buffers.is_known, axis=2), axis=1))
            if len(windows) > mission.num_windows // 2:
                for b in range(len(seeds)):
                    its = slice(b, b + 1)
                    count_ages(swarm.buffers.timestamp[its], swarm.now[its], counts[b], everyone)
            bar.advance()
    variance = np.stack([window.costs.velocity_variance_m2ps2 for window in windows])
    # Robots that fly away alone are never heard of again: their news is not what the others know.
    has_agreed = np.isfinite(agreed_window(variance))
    return Flown(
        variance_m2ps2=variance,
        known=np.stack(known),
        summary=summarise(windows),
        age_counts=counts[has_agreed].sum(axis=0),
    )


def late_rates(flown: Flown) -> Float[np.ndarray, "B"]:
    """Return how fast each flock's variance falls once all robots have heard of all [1/window].

    It is nan of a flock in which some never have, that never agreed, or where fewer than
    `LEAST_LATE` windows are left until rounding errors are all that is.
    """
    num_windows, num_missions = flown.variance_m2ps2.shape
    found = np.full(num_missions, np.nan)
    for b in range(num_missions):
        variance = flown.variance_m2ps2[:, b]
        window = flown.summary.complete_window[b]
        if math.isnan(window) or math.isnan(flown.summary.agreed_window[b]):
            continue
        first = int(window) - 1
        is_rounding = variance < LATE * variance[0]
        last = int(np.argmax(is_rounding)) if np.any(is_rounding) else num_windows - 1
        if last - first >= LEAST_LATE:
            found[b] = math.log(variance[first] / variance[last]) / (last - first)
    return found


def stale_rate(age_counts: Int[np.ndarray, "bins"], num_robots: int, window_s: float) -> float:
    """Return the rate that pictures of different ages allow, as docs/convergence.md derives it.

    The r with r - (1 - dt) = dt sqrt(Var(r^-age) / N), if each pair's news kept its age; the
    variance falls to r² of it in a window.

    Args:
        age_counts: News by age [slots].
        num_robots: N.
        window_s: dt.

    Returns:
        The rate [1/window].
    """
    age = np.arange(len(age_counts)) * SLOT_WINDOWS
    share = age_counts / np.sum(age_counts)
    perfect = 1.0 - window_s

    def excess(r: float) -> float:
        grown = r**-age
        mean = np.sum(share * grown)
        spread = math.sqrt(max(0.0, np.sum(share * (grown - mean) ** 2)) / num_robots)
        return r - perfect - window_s * spread

    if excess(perfect) >= 0.0:  # all news has one age
        return -2.0 * math.log(perfect)
    root = root_scalar(excess, bracket=(perfect, 1.0)).root
    return -2.0 * math.log(root)


def course_rows(settings: Settings) -> Iterator[CourseRow]:
    """Fly every policy; yield its windows."""
    seeds = range(settings.first_seed, settings.first_seed + settings.num_missions)
    for policy in POLICIES:
        flown = fly(settings.mission, policy, seeds)
        percentiles = np.percentile(flown.variance_m2ps2, [10.0, 50.0, 90.0], axis=1).T.tolist()
        for index, (low, median, high) in enumerate(percentiles):
            yield CourseRow(
                policy=policy,
                window=index + 1,
                variance_p10=low,
                variance_median=median,
                variance_p90=high,
                known_mean=float(np.mean(flown.known[index])),
                episodes=settings.num_missions,
                seed=settings.first_seed,
                commit=commit(),
            )


def late_rows(settings: Settings) -> Iterator[LateRow]:
    """Fly every policy in teams of each size; yield how they go on to agree."""
    seeds = range(settings.first_seed, settings.first_seed + settings.late_missions)
    for policy in POLICIES:
        for num_robots in settings.sizes:
            mission = replace(settings.mission, num_robots=num_robots)
            flown = fly(mission, policy, seeds)
            rates = late_rates(flown)
            rates = rates[np.isfinite(rates)]
            if not np.any(flown.age_counts):
                continue  # no flock agreed, as in missions of a few windows
            ages = np.arange(len(flown.age_counts)) * SLOT_WINDOWS
            yield LateRow(
                policy=policy,
                num_robots=num_robots,
                age_mean=float(np.average(ages, weights=flown.age_counts)),
                late_rate=float(np.median(rates)) if len(rates) else None,
                stale_rate=stale_rate(flown.age_counts, num_robots, mission.window_s),
                flocks=len(rates),
                episodes=settings.late_missions,
                seed=settings.first_seed,
                commit=commit(),
            )


def _cells(rows: Sequence[CourseRow] | Sequence[LateRow]) -> list[dict[str, object]]:
    """Return rows as a table has them: more digits than a picture shows would be large files."""
    shown = []
    for row in rows:
        cells: dict[str, object] = {}
        for name, value in asdict(row).items():
            cells[name] = float(f"{value:.5g}") if isinstance(value, float) else value
        shown.append(cells)
    return shown


def run(settings: Settings) -> int:
    """Run the experiment; return its exit code."""
    check_outputs(
        Output("table of courses", settings.out, ".csv"),
        Output("table of late rates", settings.late, ".csv"),
    )
    courses = list(course_rows(settings))
    late = list(late_rows(settings))
    table = Table(title="How fast flocks go on to agree")
    for heading in ("policy", "robots", "age", "rate", "by the ages"):
        table.add_column(heading)
    for row in late:
        rate = "-" if row.late_rate is None else f"{row.late_rate:.3f}"
        shown = (f"{row.num_robots}", f"{row.age_mean:.1f}", rate, f"{row.stale_rate:.3f}")
        table.add_row(row.policy, *shown)
    Console(highlight=False).print(table)
    write_csv(settings.out, [spec.name for spec in fields(CourseRow)], _cells(courses))
    write_csv(settings.late, [spec.name for spec in fields(LateRow)], _cells(late))
    return 0


if __name__ == "__main__":
    sys.exit(script(Settings, run))
