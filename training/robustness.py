"""How the shipped policy fares where it was not trained, beside TDMA and the oracle.

    python training/robustness.py

Teams of 10 to 200, ranges and speeds that the practice did not have, robots that are switched off
half-way, the authors' preset, and contact physics. One file a question under
training/results/robustness; what is there is kept, `--force` makes all anew.
"""

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli import main as swarm_mj

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "training" / "results" / "robustness"
QUESTIONS = {
    "switched-off": "--task stationary --switched-off 0.1 0.2 --episodes 30",
    "switched-off-walking": "--task random-walk --robots 10 40 --switched-off 0.1 --episodes 30",
    "reference": "--preset reference --task stationary --range-ratio 0.25 0.5 --episodes 20",
    "reference-walking": "--preset reference --task random-walk --robots 10 40 --episodes 20",
    "reference-flocking": "--preset reference --task flocking --episodes 20",
    "contact": "--physics contact --task random-walk --episodes 10",
    "ranges": "--task stationary --range-ratio 0.18 0.3 0.4 --episodes 10",
    "speeds": "--task random-walk --velocity-ratio 0.05 0.3 0.5 --episodes 10",
    "team-sizes": "--task stationary --robots 10 20 80 120 200 --episodes 6",
}
# The oracle goes on addressing robots that are off, and takes minutes a mission of 200 robots.
WITHOUT_ORACLE = ("switched-off", "switched-off-walking", "team-sizes")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is flown, and on which missions."""

    policies: tuple[str, ...] = ("tdma", "planner", "gnn")
    first_seed: int = 2000


def answer(settings: Settings, jobs: int, *, force: bool) -> int:
    """Flies what is missing, or all by force; returns the exit code."""
    for name, options in QUESTIONS.items():
        path = RESULTS / f"{name}.csv"
        if path.exists() and not force:
            continue
        policies = [*settings.policies, *(() if name in WITHOUT_ORACLE else ("greedy-oracle",))]
        command = ["evaluate", "--policy", *policies, *options.split()]
        command += ["--seed", str(settings.first_seed), "--jobs", str(jobs)]
        code = swarm_mj([*command, "--csv", str(path), "--force"])
        if code != 0:
            return code
    return 0


def main() -> int:
    """Runs the experiment; returns its exit code."""
    parser = argparse.ArgumentParser(description="Fly the shipped policy where it was not trained.")
    jobs = os.cpu_count() or 1
    parser.add_argument("--jobs", type=int, default=jobs, help=f"processes (default: {jobs})")
    parser.add_argument("--force", action="store_true", help="make all anew")
    options = parser.parse_args()
    return answer(Settings(), options.jobs, force=options.force)


if __name__ == "__main__":
    sys.exit(main())
