"""A run's folder: what is where, what was asked for, and how far the run has come."""

import csv
import json
import shutil
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path

from swarm_mj.io.atomic import atomic_directory, atomic_write, present_folder, write_json
from swarm_mj.learning.settings import Training, from_json
from swarm_mj.protocol.costs import WindowCosts

SETTINGS, CHECKPOINT, CURVE = "settings.json", "checkpoint.pt", "curve.csv"
INIT, POLICY, REPLAYS, TENSORBOARD = "init", "policy", "replays", "tensorboard"
FORMAT = "swarm_mj training run"
FORMAT_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How far a run goes, and what it leaves behind on the way."""

    decisions: int | None = None  # team decisions in all sessions together
    minutes: float | None = None  # in all sessions together, evaluations included
    replay_every: int | None = None  # team decisions between two replays
    checkpoint_every_s: float = 10.0  # least time between two checkpoints


@dataclass(frozen=True, kw_only=True)
class Run:
    """What a run was asked for."""

    training: Training
    limits: Limits
    command: str = ""  # that began it
    init: Path | None = None  # the stored policy that it begins with


@dataclass(kw_only=True)
class Accumulator:
    """What the missions in training cost since the last evaluation."""

    seconds: float = 0.0
    decisions: int = 0  # of teams
    age_windows: float = 0.0  # summed over the decisions
    attempted: int = 0  # packets
    delivered: int = 0

    def add(self, batches: Iterable[WindowCosts]) -> None:
        """Adds a window of all missions, but no time."""
        for costs in batches:
            self.decisions += len(costs.age_windows)
            self.age_windows += float(costs.age_windows.sum())
            self.attempted += int(costs.packets.attempted.sum())
            self.delivered += int(costs.packets.delivered.sum())

    def means(self) -> dict[str, float]:
        """Per mission and window; empty before the first."""
        if not self.decisions:
            return {}
        return {
            "rollout/aoi": self.age_windows / self.decisions,
            "rollout/packets_per_window": self.attempted / self.decisions,
            "rollout/delivery_ratio": self.delivered / max(1, self.attempted),
            "rollout/decisions_per_s": self.decisions / max(self.seconds, 1e-9),
        }


@dataclass(kw_only=True)
class Progress:
    """Where a run stands."""

    decisions: int = 0  # of teams, in all sessions
    minutes: float = 0.0  # in all sessions, evaluations included
    next_evaluation: int = 0  # team decisions
    next_replay: int = 0  # team decisions
    best_objective: float = float("inf")
    curve: list[dict[str, float]] = field(default_factory=list)  # one row an evaluation
    since_evaluation: Accumulator = field(default_factory=Accumulator)
    optimiser: dict[str, float] = field(default_factory=dict)  # what PPO last logged of itself

    @property
    def best(self) -> dict[str, float] | None:
        """The evaluation of the policy that is kept."""
        return min(self.curve, key=lambda row: row["objective"], default=None)


def write_run(folder: Path, run: Run) -> None:
    """Writes a run's `settings.json`.

    Raises:
        OSError: The folder cannot be written.
    """
    document = {
        "format": FORMAT,
        "format_version": FORMAT_VERSION,
        **asdict(run),
        "init": None if run.init is None else str(run.init.resolve()),
    }
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / SETTINGS, document)


def read_run(folder: Path) -> Run:
    """What a run was asked for when it began, or last went on.

    Raises:
        ValueError: There is no run, or its settings are damaged, foreign or of a newer version.
        OSError: The settings cannot be read.
    """
    path = folder / SETTINGS
    if not path.is_file():
        raise ValueError(f"{folder} holds no run to go on with; to begin one, leave out --resume")
    try:
        document = json.loads(path.read_bytes())
        if not isinstance(document, dict) or document.get("format") != FORMAT:
            raise ValueError(f'the format must be "{FORMAT}"')
        if document["format_version"] != FORMAT_VERSION:
            raise ValueError(
                f"the format_version is {document['format_version']!r:.40}, and this swarm_mj "
                f"reads {FORMAT_VERSION}; resume with the version that wrote it"
            )
        return Run(
            training=from_json(document["training"]),
            limits=Limits(**document["limits"]),
            command=str(document["command"]),
            init=None if document["init"] is None else Path(document["init"]),
        )
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ValueError(f"settings {path} are damaged, or no run's: {error}") from error


def check_new(folder: Path) -> None:
    """Passes if a run can begin in a folder.

    Raises:
        ValueError: It holds a run, or anything else.
    """
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"run {folder} is a file; name a folder")
    if (folder / SETTINGS).exists():
        raise ValueError(
            f"{folder} holds a run; go on with it by --resume, or name another folder by --out"
        )
    others = sorted(path.name for path in folder.glob("*") if not path.name.endswith(".part"))
    if others:
        raise ValueError(f"{folder} holds {others[0]}, which is no run's; name another by --out")


def own_init(folder: Path, init: Path) -> Path:
    """A run's own copy of the policy that it begins with, made if it is not there.

    Raises:
        OSError: The policy cannot be read, or the folder not be written.
    """
    own = folder / INIT
    if not own.exists():
        with atomic_directory(own) as part:
            shutil.copytree(present_folder(init), part, dirs_exist_ok=True)
    return own


def remove_parts(folder: Path) -> None:
    """Removes what killed sessions of a run had not finished writing."""
    for part in folder.glob(".*.part"):
        if part.is_dir():
            shutil.rmtree(part, ignore_errors=True)
        else:
            part.unlink(missing_ok=True)


def write_curve(path: Path, curve: list[dict[str, float]]) -> None:
    """Writes a learning curve, one row an evaluation; later rows may have more columns.

    Raises:
        OSError: The file cannot be written.
    """
    names = list(dict.fromkeys(name for row in curve for name in row))
    with atomic_write(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(curve)
