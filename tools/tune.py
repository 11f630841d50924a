"""Tunes the probability of every policy that has one, in every regime of the paper's figures.

    python tools/tune.py

Flies the same missions with probabilities of a grid and keeps the one of least mean age of
information, in swarm_mj/policies/tuned.csv. It starts from a guess and goes on to the neighbours
of the best until both are worse; the authors' grid is flown whole, as they did. The seeds are no
evaluation's. Ctrl-C leaves the table as it was.
"""

import argparse
import csv
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from swarm_mj.io.atomic_file import atomic_write
from swarm_mj.io.provenance import commit, version
from swarm_mj.mission import PRESETS, Mission
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.tuning import TABLE, Tuned, read_table
from swarm_mj.swarm import Swarm

DONE, BAD_INPUT, INTERRUPTED = 0, 2, 130
FIRST_SEED = 5000  # an evaluation's begin at 1000
EPISODES = 50

AUTHORS_GRID = (0.04, 0.06, 0.08, 0.1, 0.12, 0.15)  # of flooding and MST, in the authors' code
WIDE_GRID = (0.01, 0.02, 0.03, *AUTHORS_GRID, 0.2, 0.25, 0.3, 0.4)
# Aloha's probability is a neighbourhood's, not a robot's.
ALOHA_GRID = (0.1, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99)
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

TUNED_POLICIES = ("random-flooding", "mst", "aloha", "gossip")


@dataclass(frozen=True, kw_only=True)
class Search:
    """One policy in one regime, and the probabilities to try."""

    policy: str
    mission: Mission
    grid: tuple[float, ...]


def grid_of(policy: str, preset: str) -> tuple[float, ...]:
    """The probabilities to try: under `reference` the authors' own, for their baselines."""
    if policy in ("random-flooding", "mst"):
        return AUTHORS_GRID if preset == "reference" else WIDE_GRID
    return {"aloha": ALOHA_GRID, "gossip": GOSSIP_GRID}[policy]


def regimes(preset: str, num_windows: int) -> Iterator[Mission]:
    """The regimes of the paper's four result figures; those of Fig. 3 are among Fig. 4's."""
    make = PRESETS[preset]
    for range_ratio in (0.2, 0.25, 0.5, 0.75, 1.0):
        yield make("stationary", range_ratio=range_ratio, num_windows=num_windows)
    for num_robots in (10, 20, 40, 60, 80):
        yield make("random-walk", num_robots=num_robots, num_windows=num_windows)
    for velocity_ratio in (0.15, 0.25, 0.325, 0.5):
        yield make("flocking", velocity_ratio=velocity_ratio, num_windows=num_windows)


def searches(policies: Sequence[str], num_windows: int) -> list[Search]:
    """Every policy in every regime, policy by policy."""
    return [
        Search(policy=policy, mission=mission, grid=grid_of(policy, preset))
        for policy in policies
        for preset in PRESETS
        for mission in regimes(preset, num_windows)
    ]


def ages(search: Search, probability: float, seeds: Sequence[int]) -> np.ndarray:
    """Mean age of information of each mission [windows] (Eq. 10)."""
    swarm = Swarm(search.mission, seeds)
    policy = make_policy(search.policy, search.mission, probability)
    windows = range(search.mission.num_windows)
    return np.mean([swarm.step(policy).age_windows for _ in windows], axis=0)


def tune(search: Search, seeds: Sequence[int], guess: float) -> Tuned:
    """Finds the probability of the grid whose mean age is less than its neighbours'.

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
    """Writes the table whole, or not at all."""
    with atomic_write(path) as part, part.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(Tuned)], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def main() -> int:
    """Runs the command; returns its exit code."""
    options = _parser().parse_args()
    console = Console(stderr=True, highlight=False, soft_wrap=True, markup=False)
    try:
        _check(options)
        policies = [name for name in TUNED_POLICIES if name in (options.policy or TUNED_POLICIES)]
        kept = [] if len(policies) == len(TUNED_POLICIES) else read_table(options.out)
        seeds = range(options.seed, options.seed + options.episodes)
        found = _tune_all(searches(policies, options.windows), seeds, console)
        rows = [row for row in kept if row.policy not in policies] + found
        rows.sort(key=lambda row: TUNED_POLICIES.index(row.policy))
        write_table(rows, options.out)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"tune: error: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("tune: interrupted; the table is as it was\n")
        return INTERRUPTED
    console.print(f"{len(found)} of {len(rows)} probabilities tuned: {options.out}")
    return DONE


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description="Tunes the probability of every policy that has one, in every regime of the "
        "paper's figures, for the least age of information.",
        formatter_class=argparse.ArgumentDefaultsHelpFormatter,
    )
    parser.add_argument(
        "--policy",
        action="append",
        help=f"tune this one only, repeatable: {', '.join(TUNED_POLICIES)}; other rows are kept",
    )
    parser.add_argument("--episodes", type=int, default=EPISODES, help="missions a probability")
    parser.add_argument("--seed", type=int, default=FIRST_SEED, help="of the first mission")
    parser.add_argument("--windows", type=int, default=500, help="a mission's length")
    parser.add_argument("--out", type=Path, default=TABLE, help="the table", metavar="FILE.csv")
    return parser


def _check(options: argparse.Namespace) -> None:
    """Raises ValueError for what argparse lets pass."""
    for name in options.policy or ():
        if name not in TUNED_POLICIES:
            raise ValueError(f"policy must be one of {', '.join(TUNED_POLICIES)}, not {name!r}")
    if options.episodes < 2:
        raise ValueError(f"episodes must be 2 or more, not {options.episodes}")
    if options.out.is_dir():
        raise ValueError(f"{options.out} is a folder; name a file")


def _tune_all(work: Sequence[Search], seeds: range, console: Console) -> list[Tuned]:
    """Tunes with a progress bar, and says where a grid may have been too narrow."""
    bar = Progress(
        TextColumn("Tuning {task.fields[policy]}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    rows: list[Tuned] = []
    with bar:
        task = bar.add_task("tune", total=len(work), policy="")
        for search in work:
            bar.update(task, policy=search.policy)
            row = tune(search, seeds, _guess(search.grid, rows))
            rows.append(row)
            _report_edge(row, search.grid, console)
            bar.update(task, advance=1)
    return rows


def _guess(grid: tuple[float, ...], rows: Sequence[Tuned]) -> float:
    """What was best in the regime before, if it is one of this grid; else the grid's middle."""
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
    sys.exit(main())
