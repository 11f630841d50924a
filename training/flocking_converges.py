"""How far a flock agrees on a velocity over each of the paper's baselines (Fig. 2, Eqs. 16-17).

    python training/flocking_converges.py

Flies the same missions with every policy and prints how much of the velocity variance is left at
the end. Flocks without a boundary are the paper's, reflected ones the default flight's.
"""

import sys
from dataclasses import dataclass, replace

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
from swarm_mj.system.packages import commit, version
from swarm_mj.system.terminal import WorkBar


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is flown."""

    mission: Mission = paper("flocking")
    first_seed: int = setting(0, "of the first mission")
    num_missions: int = setting(100, "for each policy and boundary", low=1, high=10_000)
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


def run(open_area: Settings) -> int:
    """Run the experiment; return its exit code."""
    walled = replace(open_area, mission=replace(open_area.mission, boundary="reflect"))
    table = Table(title=f"Velocity variance left, {open_area.num_missions} missions")
    for heading in ("boundary", "policy"):
        table.add_column(heading)
    for heading in ("median", "mean", "worst", f"below {open_area.agreed_share:.0%}"):
        table.add_column(heading, justify="right")
    for settings in (open_area, walled):
        for name in BASELINES:
            share = left_over(settings, name)
            numbers = (np.median(share), np.mean(share), np.max(share))
            agreed = np.mean(share < settings.agreed_share)
            row = (*(f"{number:.1e}" for number in numbers), f"{agreed:.0%}")
            table.add_row(settings.mission.boundary, name, *row)
    console = Console(highlight=False)
    console.print(table)
    last = open_area.first_seed + open_area.num_missions - 1
    console.print(f"Seeds {open_area.first_seed} to {last}, swarm_mj {version()}, {commit()}.")
    return 0


if __name__ == "__main__":
    sys.exit(script(Settings, run))
