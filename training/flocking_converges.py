"""How far a flock agrees on a velocity over each of the paper's baselines (Fig. 2, Eqs. 16-17).

    python training/flocking_converges.py

Flies the same missions with every policy and prints how much of the velocity variance is left at
the end. Flocks without a boundary are the paper's, reflected ones the default flight's.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from swarm_mj.evaluation.published import BASELINES
from swarm_mj.io.provenance import commit, version
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.rollout import rollout, summarise
from swarm_mj.swarm import Swarm


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is flown."""

    mission: Mission = paper("flocking")
    first_seed: int = 0
    num_missions: int = 100
    agreed_share: float = 0.01  # a flock has agreed when less of its first variance is left


def left_over(settings: Settings, policy_name: str) -> np.ndarray:
    """The share of the first window's velocity variance left after the last, per mission."""
    seeds = range(settings.first_seed, settings.first_seed + settings.num_missions)
    swarm = Swarm(settings.mission, seeds)
    policy = make_policy(policy_name, settings.mission)
    windows = rollout(swarm, policy)
    total = settings.mission.num_windows
    summary = summarise(list(track(windows, policy_name, total, transient=True)))
    return summary.velocity_variance_last / summary.velocity_variance_first


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the experiment; returns its exit code."""
    parser = argparse.ArgumentParser(description="How far flocks agree on a velocity.")
    parser.parse_args(arguments)
    open_area = Settings()
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
    sys.exit(main())
