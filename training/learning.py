"""What the learning experiments share: runs that resume, their curves, and the final evaluation.

Each experiment calls the commands that a reader would type, so a run that is interrupted goes on
when the experiment is started again.
"""

import shutil
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli import main as swarm_mj
from swarm_mj.cli import script
from swarm_mj.fields import setting

RESULTS = Path("training/results/learning")
FIRST_SEED = 2000  # of the final evaluation's missions, which no training and no tuning has seen


class Failed(Exception):  # noqa: N818 - as KeyboardInterrupt
    """A command has said why, and its exit code is the experiment's."""


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """Trains, evaluates and leaves its numbers; each experiment is one of these, called."""

    runs: Path = setting(Path("runs"), "where runs are kept, to go on with", metavar="DIR")
    results: Path = setting(RESULTS, "where curves and evaluations go", metavar="DIR")
    episodes: int = setting(100, "missions of the final evaluation", low=1, high=100_000)
    jobs: int = setting(2, "its processes", low=1, high=256)

    def __call__(self) -> None:
        """Does all the work."""
        raise NotImplementedError

    def train(self, name: str, options: str) -> Path:
        """Trains, or goes on training, and keeps the learning curve among the results.

        Args:
            name: Of the run.
            options: Of `swarm-mj train`; those of the limits are given on resuming, too.

        Returns:
            The best policy's folder.

        Raises:
            Failed: The command failed or was interrupted.
        """
        folder = self.runs / name
        resume = ["--resume"] if (folder / "settings.json").exists() else []
        _run(["train", *options.split(), "--out", str(folder), *resume])
        self.results.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(folder / "curve.csv", self.results / f"{name}-curve.csv")
        return folder / "policy"

    def evaluate(self, name: str, policies: Sequence[Path | str], options: str) -> None:
        """Flies policies on missions they have never seen; the file stands among the results.

        Args:
            name: Of the results.
            policies: Folders, or names of hand-written policies.
            options: Of `swarm-mj evaluate`.

        Raises:
            Failed: The command failed or was interrupted.
        """
        how = f"--seed {FIRST_SEED} --episodes {self.episodes} --jobs {self.jobs} {options}"
        csv = str(self.results / f"{name}.csv")
        _run(["evaluate", "--policy", *map(str, policies), *how.split(), "--csv", csv, "--force"])


def run(kind: type[Experiment], arguments: Sequence[str] | None = None) -> int:
    """Runs an experiment with the options typed; returns its exit code."""
    return script(kind, _exit_code, arguments)


def _exit_code(experiment: Experiment) -> int:
    try:
        experiment()
    except Failed as failed:
        return int(str(failed))
    return 0


def _run(arguments: Sequence[str]) -> None:
    sys.stderr.write(f"$ swarm-mj {' '.join(arguments)}\n")
    code = swarm_mj(arguments)
    if code:
        raise Failed(code)
