"""Tuning: the probability of every policy that has one, in every regime of the paper's figures.

    python tools/tune.py

Flies the same missions with probabilities of a grid and keeps the one of least mean age of
information, in swarm_mj/policies/tuned.csv. It starts from a guess and goes on to the neighbours
of the best until both are worse; the authors' grid is flown whole, as they did. The seeds are no
evaluation's. Ctrl-C leaves the table as it was.
"""

import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from rich.console import Console

from swarm_mj.cli import script
from swarm_mj.mission import PAPERS, Mission
from swarm_mj.policies.registry import HAVE_PROBABILITY, make_policy
from swarm_mj.policies.tuning import TABLE, Tuned, read_table
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.fields import same_as, setting
from swarm_mj.system.packages import commit, version
from swarm_mj.system.terminal import WorkBar, plain_console
from swarm_mj.system.writing import Output, check_outputs, owned, write_csv

AUTHORS_GRID = (0.04, 0.06, 0.08, 0.1, 0.12, 0.15)  # of flooding and MST, in the authors' code
WIDE_GRID = (0.01, 0.02, 0.03, *AUTHORS_GRID, 0.2, 0.25, 0.3, 0.4)
# Aloha's probability is a neighbourhood's, not a robot's.
ALOHA_GRID = (0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
# Carrier sensing's is per minislot; the least is that of the longest backoff of IEEE 802.11, 1023
# minislots, whose mean is that of 2 / 1024.
CSMA_GRID = (0.002, 0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3)
# Gossip's is per window of news.
GOSSIP_GRID = (
    0.004,
    0.006,
    0.008,
    0.01,
    0.012,
    0.015,
    0.02,
    0.03,
    0.045,
    0.07,
    0.1,
    0.15,
    0.2,
    0.3,
)


@dataclass(frozen=True, kw_only=True)
class Search:
    """One policy in one regime, and the probabilities to try."""

    policy: str
    mission: Mission
    grid: tuple[float, ...]


def grid_of(policy: str, preset: str) -> tuple[float, ...]:
    """Return the probabilities to try: under `reference` the authors' own, for their baselines."""
    if policy in ("random-flooding", "mst"):
        return AUTHORS_GRID if preset == "reference" else WIDE_GRID
    return {"aloha": ALOHA_GRID, "csma": CSMA_GRID, "gossip": GOSSIP_GRID}[policy]


def regimes(preset: str, num_windows: int) -> Iterator[Mission]:
    """Return the regimes of the paper's four result figures; those of Fig. 3 are among Fig. 4's."""
    make = PAPERS[preset]
    for range_ratio in (0.2, 0.25, 0.5, 0.75, 1.0):
        yield make("stationary", range_ratio=range_ratio, num_windows=num_windows)
    for num_robots in (10, 20, 40, 60, 80):
        yield make("random-walk", num_robots=num_robots, num_windows=num_windows)
    for velocity_ratio in (0.15, 0.25, 0.325, 0.5):
        yield make("flocking", velocity_ratio=velocity_ratio, num_windows=num_windows)


def searches(policies: Sequence[str], num_windows: int) -> list[Search]:
    """Return every policy in every regime, policy by policy."""
    return [
        Search(policy=policy, mission=mission, grid=grid_of(policy, preset))
        for policy in policies
        for preset in PAPERS
        for mission in regimes(preset, num_windows)
    ]


def ages(search: Search, probability: float, seeds: Sequence[int]) -> np.ndarray:
    """Return the mean age of information of each mission [windows] (Eq. 10)."""
    swarm = Swarm(search.mission, seeds)
    policy = make_policy(search.policy, search.mission, probability)
    windows = range(search.mission.num_windows)
    return np.mean([swarm.step(policy).age_windows for _ in windows], axis=0)


def tune(search: Search, seeds: Sequence[int], guess: float) -> Tuned:
    """Find the probability of the grid whose mean age is less than its neighbours'.

    Args:
        search: Policy, regime and grid.
        seeds: Of the missions, the same for each probability.
        guess: Where to start: a probability of the grid.

    Returns:
        The row of the table.
    """
    grid = search.grid
    tried: dict[int, np.ndarray] = {}
    ahead = list(range(len(grid))) if grid == AUTHORS_GRID else [grid.index(guess)]
    best = -1
    while ahead:
        tried |= {index: ages(search, grid[index], seeds) for index in ahead}
        best = min(tried, key=lambda index: np.mean(tried[index]))
        neighbours = (best - 1, best + 1)
        ahead = [index for index in neighbours if 0 <= index < len(grid) and index not in tried]
    return _row(search, grid[best], tried[best], seeds)


def _row(search: Search, probability: float, aoi: np.ndarray, seeds: Sequence[int]) -> Tuned:
    mission = search.mission
    return Tuned(
        policy=search.policy,
        preset=mission.preset,
        task=mission.task,
        num_robots=mission.num_robots,
        range_ratio=mission.range_ratio,
        velocity_ratio=mission.velocity_ratio,
        probability=probability,
        aoi_mean=round(float(np.mean(aoi)), 4),
        aoi_sem=round(float(np.std(aoi, ddof=1) / math.sqrt(len(seeds))), 4),
        episodes=len(seeds),
        first_seed=seeds[0],
        version=version(),
        commit=commit() or "",
    )


def write_table(rows: Sequence[Tuned], path: Path) -> None:
    """Write the table whole, or not at all."""
    names = [field.name for field in fields(Tuned)]
    write_csv(path, names, (asdict(row) for row in rows))


@dataclass(frozen=True, kw_only=True)
class Options:
    """What is tuned, and on which missions."""

    policy: tuple[str, ...] = setting(
        HAVE_PROBABILITY, "tune these only; other rows are kept", choices=HAVE_PROBABILITY
    )
    episodes: int = setting(50, "missions a probability", low=2, high=10_000)
    seed: int = setting(5000, "of the first mission; an evaluation's begin at 1000")
    num_windows: int = same_as(Mission, "num_windows", is_common=False)
    out: Path = setting(TABLE, "the table", metavar="FILE.csv", shown="the package's")


def run(options: Options) -> int:
    """Tune, and write the table; return the exit code."""
    console = plain_console(is_error=True)
    check_outputs(Output("table", options.out, ".csv"))
    with owned(options.out):
        return _tune(options, console)


def _tune(options: Options, console: Console) -> int:
    policies = [name for name in HAVE_PROBABILITY if name in options.policy]
    kept = [] if len(policies) == len(HAVE_PROBABILITY) else read_table(options.out)
    seeds = range(options.seed, options.seed + options.episodes)
    found = _tune_all(searches(policies, options.num_windows), seeds, console)
    rows = [row for row in kept if row.policy not in policies] + found
    rows.sort(key=lambda row: HAVE_PROBABILITY.index(row.policy))
    write_table(rows, options.out)
    console.print(f"{len(found)} of {len(rows)} probabilities tuned: {options.out}")
    return 0


def _tune_all(work: Sequence[Search], seeds: range, console: Console) -> list[Tuned]:
    """Tune with a progress bar, and say where a grid may have been too narrow."""
    rows: list[Tuned] = []
    with WorkBar("Tuning", len(work), "regimes") as bar:
        for search in work:
            bar.text = search.policy
            row = tune(search, seeds, _guess(search.grid, rows))
            rows.append(row)
            _report_edge(row, search.grid, console)
            bar.advance()
    return rows


def _guess(grid: tuple[float, ...], rows: Sequence[Tuned]) -> float:
    """Return the previous best if it is in this grid, else the middle of the grid."""
    is_apt = rows and rows[-1].probability in grid
    return rows[-1].probability if is_apt else grid[len(grid) // 2]


def _report_edge(row: Tuned, grid: tuple[float, ...], console: Console) -> None:
    if row.probability in (grid[0], grid[-1]):
        console.print(
            f"{row.policy} {row.preset} {row.task}, {row.num_robots} robots, range "
            f"{row.range_ratio:g}, velocity {row.velocity_ratio:g}: best is the grid's end, "
            f"{row.probability:g}"
        )


if __name__ == "__main__":
    sys.exit(script(Options, run))
