"""All results of the paper's four result figures, for every policy and both presets (V).

    python training/paper_figures.py
    make figures    # this, then the figures themselves

Evaluates what `training/results/` lacks, one file per preset and task; Fig. 3's missions are among
Fig. 4's. `--force` removes what is there first. An interrupted run continues where it broke off,
as long as the commit is the same. Results wait under `runs/` until all are there.
"""

import os
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli import main as swarm_mj
from swarm_mj.cli import script
from swarm_mj.evaluation.flying import progress_path
from swarm_mj.evaluation.published import RESULT_FIGURES, ResultFigure
from swarm_mj.evaluation.results import MAX_BYTES, read_results
from swarm_mj.mission import PAPERS
from swarm_mj.policies.registry import WITHOUT_PAYLOAD, flown_name
from swarm_mj.system.fields import setting
from swarm_mj.system.packages import commit
from swarm_mj.system.reading import read_file
from swarm_mj.system.writing import Output, check_outputs, write_bytes

ROOT = Path(__file__).resolve().parent.parent
# All but sotdma, which is slow, and those that sense, which are younger than these results. The
# planners and gnn are drawn under `paper` only: gnn was trained there, and they take several times
# as long as all others together.
DRAWN = (
    "tdma",  # first: the others are compared to it
    *("random-flooding", "round-robin", "mst", "aloha", "gossip", "spatial-tdma"),
    *("planner", WITHOUT_PAYLOAD, "gnn", "greedy-oracle"),
)
PAPER_ONLY = ("planner", WITHOUT_PAYLOAD, "gnn")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What is evaluated, and where it goes."""

    presets: tuple[str, ...] = setting(("paper", "reference"), "which", choices=tuple(PAPERS))
    figures: tuple[str, ...] = setting(
        ("fig4", "fig5", "fig6"), "which results", choices=tuple(RESULT_FIGURES)
    )
    # The planner's numbers were chosen on missions from 1000.
    episodes: int = setting(50, "missions per policy and regime", low=1, high=100_000)
    first_seed: int = setting(2000, "of the first mission")
    results: Path = setting(
        ROOT / "training" / "results", "where they go", metavar="DIR", shown="training/results"
    )
    drafts: Path = setting(
        ROOT / "runs" / "paper_figures",
        "where they wait until all are there",
        metavar="DIR",
        shown="runs/paper_figures",
    )
    jobs: int = setting(os.cpu_count() or 1, "processes", low=1, high=256)
    force: bool = setting(False, "make everything again")


@dataclass(frozen=True, kw_only=True)
class Part:
    """One figure's results under one preset."""

    figure: ResultFigure
    preset: str

    @property
    def name(self) -> str:
        """The file's name."""
        return f"{self.preset}-{self.figure.task}.csv"

    @property
    def policies(self) -> Iterable[str]:
        """The policies that are drawn."""
        drawn = [name for name in DRAWN if self.preset == "paper" or name not in PAPER_ONLY]
        mission = self.figure.mission(self.preset)
        return dict.fromkeys(flown_name(name, mission) for name in drawn)

    def command(self, settings: Settings, jobs: int) -> list[str]:
        """Return the arguments of `swarm-mj`."""
        return [
            *self.figure.arguments(self.preset),
            *("--policy", *self.policies),
            *("--episodes", f"{settings.episodes}", "--seed", f"{settings.first_seed}"),
            *("--jobs", f"{jobs}", "--csv", str(settings.drafts / self.name)),
            "--resume",
        ]


def evaluate(settings: Settings, jobs: int, *, force: bool) -> int:
    """Make the results that are missing, or all by force; return the exit code."""
    parts = [
        Part(figure=RESULT_FIGURES[name], preset=preset)
        for preset in settings.presets
        for name in settings.figures
    ]
    places = (settings.results, settings.drafts)
    check_outputs(*(Output("results", place / part.name) for part in parts for place in places))
    if force:
        _remove(settings, parts)
    missing = [part for part in parts if not (settings.results / part.name).exists()]
    for part in missing:
        if not _is_current(settings.drafts / part.name):
            code = swarm_mj(part.command(settings, jobs))
            if code != 0:
                return code
    for part in missing:
        draft = settings.drafts / part.name
        write_bytes(settings.results / part.name, read_file(draft, "draft", MAX_BYTES))
        draft.unlink()
    return 0


def _remove(settings: Settings, parts: Sequence[Part]) -> None:
    """Remove all results and drafts."""
    for part in parts:
        draft = settings.drafts / part.name
        for path in (settings.results / part.name, draft, progress_path(draft)):
            path.unlink(missing_ok=True)


def _is_current(draft: Path) -> bool:
    """Return whether a draft is of this commit; remove one of another."""
    if draft.exists() and {result.commit for result in read_results(draft)} != {commit()}:
        draft.unlink()
    return draft.exists()


def run(settings: Settings) -> int:
    """Run the experiment; return its exit code."""
    return evaluate(settings, settings.jobs, force=settings.force)


if __name__ == "__main__":
    sys.exit(script(Settings, run))
