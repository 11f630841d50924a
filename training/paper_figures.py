"""All results of the paper's four result figures, for every policy and both presets (V).

    python training/paper_figures.py
    make figures    # this, then the figures themselves

Evaluates what `training/results/` lacks, one file per preset and task; Fig. 3's missions are among
Fig. 4's. An interrupted run continues where it broke off. Results wait under `runs/` until all are
there, so that all carry the commit they were started from.
"""

import argparse
import os
import sys
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli import main as swarm_mj
from swarm_mj.figures.contents import RESULT_FIGURES, ResultFigure

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is evaluated, and where it goes."""

    presets: tuple[str, ...] = ("reference", "paper")
    figures: tuple[str, ...] = ("fig4", "fig5", "fig6")
    episodes: int = 100  # missions per policy and regime, as many as the paper's
    first_seed: int = 1000
    results: Path = ROOT / "training" / "results"
    drafts: Path = ROOT / "runs" / "paper_figures"


@dataclass(frozen=True, kw_only=True)
class Part:
    """One figure's results under one preset."""

    figure: ResultFigure
    preset: str

    @property
    def name(self) -> str:
        """The file's name."""
        return f"{self.preset}-{self.figure.task}.csv"

    def command(self, settings: Settings, jobs: int, *, force: bool) -> list[str]:
        """What `swarm-mj` is called with."""
        return [
            *self.figure.arguments(self.preset),
            *("--episodes", f"{settings.episodes}", "--seed", f"{settings.first_seed}"),
            *("--jobs", f"{jobs}", "--csv", str(settings.drafts / self.name)),
            "--force" if force else "--resume",
        ]


def evaluate(settings: Settings, jobs: int, *, force: bool) -> int:
    """Makes the results that are missing, or all by force; returns the exit code."""
    parts = [
        Part(figure=RESULT_FIGURES[name], preset=preset)
        for preset in settings.presets
        for name in settings.figures
    ]
    missing = [part for part in parts if force or not (settings.results / part.name).exists()]
    for part in missing:
        if force or not (settings.drafts / part.name).exists():
            code = swarm_mj(part.command(settings, jobs, force=force))
            if code != 0:
                return code
    settings.results.mkdir(parents=True, exist_ok=True)
    for part in missing:
        (settings.drafts / part.name).replace(settings.results / part.name)
    return 0


def main() -> int:
    """Runs the experiment; returns its exit code."""
    parser = argparse.ArgumentParser(
        description="Make the results of the paper's figures under training/results/."
    )
    jobs = os.cpu_count() or 1
    parser.add_argument("--jobs", type=int, default=jobs, help=f"processes (default: {jobs})")
    parser.add_argument("--force", action="store_true", help="make all anew")
    options = parser.parse_args()
    return evaluate(Settings(), options.jobs, force=options.force)


if __name__ == "__main__":
    sys.exit(main())
