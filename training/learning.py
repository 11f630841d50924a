"""What the learning experiments share: runs that resume, their curves, and the final evaluation.

Each experiment calls the commands that a reader would type, so a run that is interrupted goes on
when the experiment is started again.
"""

import argparse
import shutil
import sys
from collections.abc import Sequence
from pathlib import Path

from swarm_mj.cli import main as swarm_mj

RUNS = Path("runs")
RESULTS = Path("training/results/learning")
FIRST_SEED = 2000  # of the final evaluation's missions, which no training and no tuning has seen


class Failed(Exception):  # noqa: N818 - as KeyboardInterrupt
    """A command has said why, and its exit code is the experiment's."""


def train(name: str, options: Sequence[str]) -> Path:
    """Trains, or goes on training, and keeps the learning curve under `training/results`.

    Args:
        name: Of the run.
        options: Of `swarm-mj train`; those of the limits are given on resuming, too.

    Returns:
        The best policy's folder.

    Raises:
        Failed: The command failed or was interrupted.
    """
    folder = RUNS / name
    resume = ["--resume"] if (folder / "settings.json").exists() else []
    _run(["train", *options, "--out", str(folder), *resume])
    RESULTS.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / "curve.csv", RESULTS / f"{name}-curve.csv")
    return folder / "policy"


def evaluate(name: str, policies: Sequence[Path | str], options: Sequence[str]) -> None:
    """Flies policies on missions they have never seen; results go under `training/results`.

    Args:
        name: Of the results.
        policies: Folders, or names of hand-written policies.
        options: Of `swarm-mj evaluate`.

    Raises:
        Failed: The command failed or was interrupted.
    """
    out = RESULTS / f"{name}.csv"
    command = ["evaluate", "--policy", *map(str, policies), "--seed", str(FIRST_SEED)]
    _run([*command, *options, "--csv", str(out), "--force"])


def run(experiment: object) -> int:
    """Runs an experiment, a callable; returns its exit code."""
    assert callable(experiment)
    argparse.ArgumentParser(
        description=sys.modules["__main__"].__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    ).parse_args()
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
