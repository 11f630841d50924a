"""The candidates for the shipped policy `gnn`, trained and compared.

    python training/shipped_gnn.py

Trains one network on teams at rest and one on walking teams, half an hour each on one core, and
goes on with runs that have begun. Then flies both beside TDMA and spatial TDMA on missions that
neither has seen. The one trained at rest was chosen: it is `assets/policies/gnn.safetensors`, with
its card beside it. Its learning curve is `training/results/learning/rest-curve.csv`.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli import main as swarm_mj
from swarm_mj.cli import script
from swarm_mj.policies.stored import POLICY
from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_file
from swarm_mj.system.writing import Output, check_outputs, write_bytes

ROOT = Path(__file__).resolve().parent.parent
RESULTS = ROOT / "runs" / "candidates"
CANDIDATES = {
    "rest": "--task stationary --robots 20 40 80",
    "walk": "--task random-walk --robots 10 20 40 80",
}
REGIMES = {
    "rest": "--task stationary --robots 20 40 80",
    "walks": "--task random-walk --robots 10 40 80",
    "flocks": "--task flocking",
}
TRAINING = "--features extended --entropy 0.01 --evaluate-every 25000 --seed 1"
FIRST_SEED = 3000  # of the comparison: neither the training's nor the final evaluation's
MOST_BYTES = 10_000_000  # of a curve


class Failed(Exception):  # noqa: N818 - as KeyboardInterrupt
    """A command has said why, and its exit code is the experiment's."""


@dataclass(frozen=True, kw_only=True)
class ShippedGnn:
    """How long to train, and where everything goes."""

    minutes: float = setting(30.0, "of training, each candidate", low=0.01, high=10_000.0)
    episodes: int = setting(8, "missions of the comparison", low=1, high=100_000)
    runs: Path = setting(
        ROOT / "runs", "where runs are kept, to go on with", metavar="DIR", shown="runs"
    )
    results: Path = setting(
        RESULTS,
        "where curves and evaluations go",
        metavar="DIR",
        shown="runs/candidates",
    )
    jobs: int = setting(2, "processes of the comparison", low=1, high=256)

    def __call__(self) -> int:
        """Train, then compare; return the exit code."""
        curves = [self._curve(name) for name in CANDIDATES]
        compared = [self._compared(name) for name in REGIMES]
        check_outputs(*(Output("results", path) for path in (*curves, *compared)))
        try:
            policies = [self._train(name, missions) for name, missions in CANDIDATES.items()]
            for name, missions in REGIMES.items():
                self._compare(name, policies, missions)
        except Failed as failed:
            return int(str(failed))
        return 0

    def _train(self, name: str, missions: str) -> str:
        """Train a candidate, or resume its training; return where its policy is."""
        folder = self.runs / name
        resume = ["--resume"] if (folder / "settings.json").exists() else []
        options = f"{missions} {TRAINING} --minutes {self.minutes:g}".split()
        _run(["train", *options, "--out", str(folder), *resume])
        write_bytes(self._curve(name), read_file(folder / "curve.csv", "curve", MOST_BYTES))
        return str(folder / POLICY)

    def _compare(self, name: str, policies: Sequence[str], missions: str) -> None:
        """Fly the candidates and the schedules of TDMA on the same missions."""
        how = f"--seed {FIRST_SEED} --episodes {self.episodes} --jobs {self.jobs} {missions}"
        command = ["evaluate", "--policy", *policies, "spatial-tdma", "tdma"]
        _run([*command, *how.split(), "--csv", str(self._compared(name)), "--force"])

    def _curve(self, name: str) -> Path:
        return self.results / f"{name}-curve.csv"

    def _compared(self, name: str) -> Path:
        return self.results / f"candidates-{name}.csv"


def _run(arguments: Sequence[str]) -> None:
    sys.stderr.write(f"$ swarm-mj {' '.join(arguments)}\n")
    code = swarm_mj(arguments)
    if code:
        raise Failed(code)


if __name__ == "__main__":
    sys.exit(script(ShippedGnn, ShippedGnn.__call__))
