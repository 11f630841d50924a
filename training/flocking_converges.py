"""How far a flock agrees on a velocity over each of the paper's baselines (Fig. 2, Eqs. 16-17).

    python training/flocking_converges.py

Flies the same missions with every policy. Prints how much of the velocity variance is left at the
end, and writes it to training/results/converging.csv. Flocks without a boundary are the paper's.
"""

import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from swarm_mj.api.flight_table import AGREED
from swarm_mj.cli import script
from swarm_mj.evaluation.published import BASELINES
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.terminal import WorkBar
from swarm_mj.system.writing import Output, check_outputs, write_csv

RESULTS = Path(__file__).resolve().parent / "results"


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is flown."""

    mission: Mission = paper("flocking")
    first_seed: int = setting(0, "of the first mission")
    num_missions: int = setting(100, "for each policy and boundary", low=1, high=10_000)
    out: Path = setting(RESULTS / "converging.csv", "the table", metavar="FILE.csv")
    agreed_share: float = setting(
        AGREED, "a flock with less of its first variance left has agreed", low=0.0, high=1.0
    )


def left_over(settings: Settings, policy_name: str) -> np.ndarray:
    """Return the share of the first window's velocity variance left after the last, per mission."""
    seeds = range(settings.first_seed, settings.first_seed + settings.num_missions)
    swarm = Swarm(settings.mission, seeds)
    policy = make_policy(policy_name, settings.mission)
    windows = []
    with WorkBar(policy_name, settings.mission.num_windows, "windows") as bar:
        for window in rollout(swarm, policy):
            windows.append(window)
            bar.advance()
    summary = summarise(windows)
    return summary.velocity_variance_last / summary.velocity_variance_first


@dataclass(frozen=True, kw_only=True)
class Row:
    """How far the flocks of a boundary and a policy agree."""

    boundary: str
    policy: str
    left_median: float  # of the first window's velocity variance, after the last window [1]
    left_mean: float
    left_worst: float
    agreed_share: float  # of the flocks, with less than `Settings.agreed_share` left
    episodes: int
    seed: int  # of the first mission
    commit: str | None


def rows(open_area: Settings) -> Iterator[Row]:
    """Fly every baseline without a boundary, then with one."""
    walled = replace(open_area, mission=replace(open_area.mission, boundary="reflect"))
    for settings in (open_area, walled):
        for name in BASELINES:
            share = left_over(settings, name)
            yield Row(
                boundary=settings.mission.boundary,
                policy=name,
                left_median=float(np.median(share)),
                left_mean=float(np.mean(share)),
                left_worst=float(np.max(share)),
                agreed_share=float(np.mean(share < settings.agreed_share)),
                episodes=settings.num_missions,
                seed=settings.first_seed,
                commit=commit(),
            )


def run(open_area: Settings) -> int:
    """Run the experiment; return its exit code."""
    check_outputs(Output("table", open_area.out, ".csv"))
    found = list(rows(open_area))
    table = Table(title=f"Velocity variance left, {open_area.num_missions} missions")
    for heading in ("boundary", "policy"):
        table.add_column(heading)
    for heading in ("median", "mean", "worst", f"below {open_area.agreed_share:.0%}"):
        table.add_column(heading, justify="right")
    for row in found:
        left = (row.left_median, row.left_mean, row.left_worst)
        shown = (*(f"{each:.1e}" for each in left), f"{row.agreed_share:.0%}")
        table.add_row(row.boundary, row.policy, *shown)
    Console(highlight=False).print(table)
    write_csv(open_area.out, [spec.name for spec in fields(Row)], (asdict(row) for row in found))
    return 0


if __name__ == "__main__":
    sys.exit(script(Settings, run))
