"""A run's folder: its files, what was asked for, and how far the run has come.

It holds `settings.json`, `checkpoint.pt`, `curve.csv` (one row an evaluation), `tensorboard/`,
`policy.safetensors` (the one that is kept), `init.safetensors` (the one it began with, if any) and,
on request, `replays/`.
"""

import math
import os
from collections.abc import Callable, Collection, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from swarm_mj.learning.selection import Amount, Choice, Count, Row
from swarm_mj.learning.settings import Training
from swarm_mj.policies.stored import POLICY
from swarm_mj.protocol.costs import WindowCosts
from swarm_mj.system.atomic import write_csv, write_json
from swarm_mj.system.fields import check, setting
from swarm_mj.system.reading import read_document, read_file

SETTINGS, CHECKPOINT, CURVE = "settings.json", "checkpoint.pt", "curve.csv"
INIT, REPLAYS, TENSORBOARD = "init.safetensors", "replays", "tensorboard"
FORMAT = "swarm_mj training run"
FORMAT_VERSION = 2  # 1 called the kind of credit `arm`
MAX_BYTES = 1_000_000  # of the settings
BUDGETS = {"robot": 200_000, "team": 2_000_000}  # team decisions; the paper's for the paper's way
PATIENCE = {"robot": 8, "team": 40}  # evaluations
MAX_DECISIONS, MAX_EVALUATIONS = 10**12, 1_000_000


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How far a run goes, and what it leaves behind; raises ValueError for what is out of range."""

    decisions: int | None = setting(
        None,
        "stop after so many decisions of teams, in all",
        label="budget",
        low=1,
        high=MAX_DECISIONS,
        shown=f"{BUDGETS['robot']}, team: {BUDGETS['team']}; none with --minutes",
    )
    minutes: float | None = setting(
        None, "stop after so long, in all, evaluations included", low=1e-9, high=1e6
    )
    replay_every: int | None = setting(
        None,
        "record the first held-out mission in OUT/replays whenever so many decisions are made",
        label="replay-every",
        low=1,
        high=MAX_DECISIONS,
    )
    patience: int | None = setting(
        None,
        "stop after so many evaluations in a row without gain; 0: never",
        low=0,
        high=MAX_EVALUATIONS,
        shown=f"{PATIENCE['robot']}, team: {PATIENCE['team']}",
    )
    checkpoint_every_s: float = setting(10.0, low=0.0, high=1e6)  # at least, between two

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, kw_only=True)
class TrainingRun:
    """A request for a training run."""

    training: Training
    limits: Limits
    command: str = ""  # that began it
    init: Path | None = None  # the stored policy that it begins with


@dataclass(kw_only=True)
class Accumulator:
    """Costs of the missions in training since the last evaluation.

    The logger's own means would not survive an interruption: these are in the checkpoint.
    """

    seconds: Amount = 0.0
    decisions: Count = 0  # of teams
    age_windows: Amount = 0.0  # summed over the decisions
    attempted: Count = 0  # packets
    delivered: Count = 0

    def add(self, batches: Iterable[WindowCosts]) -> None:
        """Add a window of all missions, but no time."""
        for costs in batches:
            self.decisions += len(costs.age_windows)
            self.age_windows += float(costs.age_windows.sum())
            self.attempted += int(costs.packets.attempted.sum())
            self.delivered += int(costs.packets.delivered.sum())

    def means(self) -> Row:
        """Return means per mission and window; none before the first."""
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
    """The state of a run, but for its weights and missions."""

    decisions: Count = 0  # of teams, in all sessions
    minutes: Amount = 0.0  # in all sessions, evaluations included
    next_evaluation: Count = 0  # team decisions
    next_replay: Count = 0  # team decisions
    best_objective: Annotated[float, Meta(ge=0.0)] = math.inf
    curve: list[Row] = field(default_factory=list)  # one row an evaluation
    since_evaluation: Accumulator = field(default_factory=Accumulator)
    optimiser: Row = field(default_factory=dict)  # what PPO last logged of itself
    choice: Choice | None = None  # of the policy that is kept; None: it is of the best evaluation
    evaluation_minutes: Amount = 0.0  # that the last one took

    @property
    def has_chosen(self) -> bool:
        """True if the kept policy was selected after the last training step."""
        return self.choice is not None and self.choice.run_decisions == self.decisions

    @property
    def best(self) -> Row | None:
        """The best evaluation."""
        return min(self.curve, key=lambda row: row["objective"], default=None)

    def write_curve(self, folder: Path) -> None:
        """Write the learning curve into a run's folder; later rows may have more columns."""
        names = list(dict.fromkeys(name for row in self.curve for name in row))
        write_csv(folder / CURVE, names, self.curve)


@dataclass(frozen=True, kw_only=True)
class Status:
    """A run's state after a window of training or of an evaluation, for listeners."""

    decisions: int
    minutes: float
    aoi: float  # of the missions in training, in the last window [windows]
    progress: Progress  # with the curve so far; the run's own, so only to be read
    evaluated: float | None  # the share of an evaluation that is flown; None while training
    what: str = "Training"  # or what is flown


# Returns whether to go on; if not, the rollout is finished, or the evaluation left for later.
Listener = Callable[[Status], bool]


def write_run(folder: Path, run: TrainingRun) -> None:
    """Write a run's `settings.json`; raises OSError if the folder cannot be written."""
    init = None if run.init is None else str(run.init.resolve())
    header = {"format": FORMAT, "format_version": FORMAT_VERSION}
    write_json(folder / SETTINGS, header | asdict(run) | {"init": init})


def read_run(folder: Path, named: Collection[str] = ()) -> TrainingRun:
    """Return what a run was asked for when it began, or last went on.

    Users' own components, as `module:Name`, must be `named`: to go on runs their code, and a folder
    may come from anyone. Raises ValueError if one is not, if there is no run, or if its settings
    are damaged, foreign or of another version; OSError if they cannot be read.
    """
    path = folder / SETTINGS
    if not os.path.lexists(path):
        raise ValueError(f"{folder} holds no run to go on with; to begin one, leave out --resume")
    text = read_file(path, "settings", MAX_BYTES, folder=folder)
    try:
        run = read_document(text, FORMAT, FORMAT_VERSION, TrainingRun)
    except ValueError as error:
        raise ValueError(
            f"settings {path} are damaged, no run's, or from an earlier version: {error}"
        ) from error
    for name in run.training.own.values():
        if name not in named:
            raise ValueError(
                f"{folder} goes on with someone's own {name:.200}; if you trust that code, give "
                f"the run's {run.training.own_options} again"
            )
    return run


def check_new(folder: Path) -> None:
    """Raise ValueError if a folder holds a run, or anything else, so that none can begin there."""
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"run {folder} is a file; name a folder")
    if (folder / SETTINGS).exists():
        raise ValueError(
            f"{folder} holds a run; go on with it by --resume, or name another folder by --out"
        )
    left = (".part", ".lock")  # by a run that was killed while it began
    others = sorted(path.name for path in folder.glob("*") if not path.name.endswith(left))
    if others:
        raise ValueError(f"{folder} holds {others[0]}, which is no run's; name another by --out")


def check_begun(folder: Path) -> None:
    """Raise ValueError if the run in a folder cannot go on: it lost its checkpoint, or has links.

    Links that lead out of the folder would have the run replace other files there.
    """
    for path in folder.rglob("*"):
        if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"{path} is a link that leads out of the run; copy what it leads to")
    has_begun = (folder / CURVE).exists() or (folder / POLICY).exists()
    if has_begun and not (folder / CHECKPOINT).exists():
        raise ValueError(
            f"{folder} has lost its {CHECKPOINT}, so its run cannot go on; put it back, or begin "
            "another run in another folder, by --out without --resume"
        )
