"""What `reproduce.py` trains and flies: its settings, and the form of the files in `reproduce/`."""

import shlex
import tomllib
from dataclasses import dataclass
from pathlib import Path

from swarm_mj.system.fields import setting
from swarm_mj.system.reading import read_file, read_plain

MOST_BYTES = 10_000_000  # of a file that is read
ROOT = Path(__file__).resolve().parent.parent
PAPERS = ("fig3", "fig6", "fig5", "fig4")
FIGURES = (*PAPERS, "one", "rewards", "tutorial", "recipes")
SCALES = ("quick", "full")


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much is made, of what, and where everything goes."""

    scale: str = setting("quick", "how much is trained and flown", choices=SCALES)
    figures: tuple[str, ...] = setting(FIGURES, "which figures", choices=FIGURES)
    experiments: Path = setting(
        ROOT / "training" / "reproduce",
        "what is trained and flown for each figure",
        metavar="DIR",
        shown="training/reproduce",
    )
    results: Path = setting(
        ROOT / "training" / "results" / "reproduce",
        "where results go, in a folder of the scale",
        metavar="DIR",
        shown="training/results/reproduce",
    )
    policies: Path = setting(
        ROOT / "training" / "reproduce",
        "where trained policies go, in folders of the scale and the figure",
        metavar="DIR",
        shown="training/reproduce",
    )
    fly: str = setting("", "options of swarm-mj evaluate that override the file's")
    runs: Path = setting(
        ROOT / "runs" / "reproduce",
        "where runs are kept, to go on with",
        metavar="DIR",
        shown="runs/reproduce",
    )
    jobs: int = setting(1, "processes that fly", low=1, high=256)
    force: bool = setting(False, "make everything again")


@dataclass(frozen=True, kw_only=True)
class Scale:
    """The options that all trainings share, and all flights."""

    train: str  # of `swarm-mj train`
    fly: str  # of `swarm-mj evaluate`
    own: dict[str, str]  # of single trainings, by their names


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """A figure's trainings and flights, as its file has them."""

    quick: Scale
    full: Scale
    trainings: dict[str, str]  # their own options, by their names
    flights: dict[str, dict[str, list[str]]]  # by missions' options: trainings and their curves


def read_experiment(path: Path) -> Experiment:
    """Return the experiment in a file.

    Raises:
        ValueError: It holds no such thing.
        OSError: It cannot be read.
    """
    text = read_file(path, "experiment", MOST_BYTES)
    try:
        table = tomllib.loads(text.decode())
        for name in ("quick", "full"):
            table[name] = {"own": {}} | table.get(name, {})
        return read_plain(table, Experiment)
    except ValueError as error:
        raise ValueError(f"experiment {path} cannot be read: {error}") from error


def typed(shared: str, own: str) -> list[str]:
    """Return options as words; those of a training or a flight override the shared ones."""
    groups: dict[str, list[str]] = {}
    for options in (shared, own):
        its: dict[str, list[str]] = {}
        for word in shlex.split(options):
            if word.startswith("--"):
                its[word] = []
            elif not its:
                raise ValueError(f"options begin with --, and not with {word!r:.60}")
            else:
                its[list(its)[-1]].append(word)
        groups |= its
    return [word for flag, values in groups.items() for word in (flag, *values)]
