"""How the shipped policy fares where it was not trained, beside TDMA, the planner and the oracle.

    python training/robustness.py

Teams of 10 to 200, ranges and speeds that the training did not have, robots that are switched off
half-way, the authors' preset, and contact physics. One file a question under
training/results/robustness; what is there is kept, `--force` makes everything again.
"""

import os
import sys
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli import main as swarm_mj
from swarm_mj.cli import script
from swarm_mj.system.fields import setting
from swarm_mj.system.writing import Output, check_outputs

RESULTS = Path(__file__).resolve().parent / "results" / "robustness"
QUESTIONS = {
    "switched-off": "--task stationary --failure-fraction 0.1 0.2 --episodes 12",
    "switched-off-walking": (
        "--task random-walk --robots 10 40 --failure-fraction 0.1 --episodes 12"
    ),
    "reference": "--preset reference --task stationary --range-ratio 0.25 0.5 --episodes 8",
    "reference-walking": "--preset reference --task random-walk --robots 10 40 --episodes 8",
    "reference-flocking": "--preset reference --task flocking --episodes 8",
    "contact": "--physics contact --task random-walk --episodes 8",
    "ranges": "--task stationary --range-ratio 0.18 0.3 0.4 --episodes 8",
    "speeds": "--task random-walk --velocity-ratio 0.05 0.3 0.5 --episodes 8",
    "team-sizes": "--task stationary --robots 10 20 80 120 200 --episodes 4",
}
# The oracle goes on addressing robots that are off, and takes minutes a mission of 200 robots.
WITHOUT_ORACLE = ("switched-off", "switched-off-walking", "team-sizes")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is flown, on which missions, and where the results go."""

    policies: tuple[str, ...] = setting(("tdma", "planner", "gnn"), "who is flown")
    first_seed: int = setting(2000, "of the first mission")
    results: Path = setting(
        RESULTS, "where the files go", metavar="DIR", shown="training/results/robustness"
    )
    jobs: int = setting(os.cpu_count() or 1, "processes", low=1, high=256)
    force: bool = setting(False, "make everything again")


def answer(settings: Settings) -> int:
    """Fly what is missing, or all by force; return the exit code."""
    paths = {name: settings.results / f"{name}.csv" for name in QUESTIONS}
    check_outputs(*(Output("results", path) for path in paths.values()))
    for name, path in paths.items():
        if path.exists() and not settings.force:
            continue
        policies = [*settings.policies, *(() if name in WITHOUT_ORACLE else ("greedy-oracle",))]
        how = f"{QUESTIONS[name]} --seed {settings.first_seed} --jobs {settings.jobs}".split()
        code = swarm_mj(["evaluate", "--policy", *policies, *how, "--csv", str(path), "--force"])
        if code != 0:
            return code
    return 0


if __name__ == "__main__":
    sys.exit(script(Settings, answer))
