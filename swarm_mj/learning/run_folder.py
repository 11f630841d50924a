"""A run's folder: its files, what was asked for, and what memory and disk the run takes.

It holds `settings.json`, `checkpoint.pt`, `curve.csv` (one row an evaluation), `tensorboard/`,
`policy.safetensors` (the one that is kept), `init.safetensors` (the one it began with, if any) and,
on request, `replays/`.
"""

import os
from collections.abc import Collection
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from swarm_mj.learning.selection import (
    OTHER_FLIGHTS,
    Columns,
    Cost,
    differences,
    num_missions,
    reference_ages,
)
from swarm_mj.learning.settings import MAX_DECISIONS, Device, Training
from swarm_mj.learning.ways import ROBOT, TEAM
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.feature_sets import remembers_packets
from swarm_mj.policies.policy_config import NO_BOUND
from swarm_mj.policies.stored import POLICY
from swarm_mj.replay.replay_size import IN_MEMORY, ON_DISK
from swarm_mj.simulation.memory import LIBRARIES, TORCH, learned_memory, policy_memory
from swarm_mj.system import needs
from swarm_mj.system.fields import check, common_setting, setting
from swarm_mj.system.reading import read_document, read_file, read_plain, read_rows
from swarm_mj.system.writing import write_json

Document: TypeAlias = dict[str, Any]  # JSON as it was read
SETTINGS = "settings.json"
CHECKPOINT = "checkpoint.pt"
CURVE = "curve.csv"
INIT = "init.safetensors"
REPLAYS = "replays"
TENSORBOARD = "tensorboard"
FORMAT = "swarm_mj training run"
FORMAT_VERSION = 2  # 1 called the kind of credit `arm`
# Settings that version 1.0 had no names for, as it trained.
AS_1_0_TRAINED: Document = {"most_speech": NO_BOUND, "unknown_age": 0.0, "train_windows": []}
AS_1_0_OPTIMISED: Document = {"horizon": 1, "considered": 1.0, "kept": 0.0}
MAX_BYTES = 1_000_000  # of the settings
MAX_CURVE_BYTES = 10_000_000
KEPT_ROWS = 0.5  # share that PPO passes over where it considers speech; rather too high
WINDOW_BYTES = 2.0  # of the checkpoint, for each robot and window of a mission
CHECKPOINT_BYTES = 0.01 * needs.GB  # and in any case


@dataclass(frozen=True, kw_only=True)
class Limits:
    """How far a run goes, and what it leaves behind; raises ValueError for what is out of range."""

    decisions: int | None = common_setting(
        None,
        "stop after this many team decisions, earlier sessions included",
        label="budget",
        low=1,
        high=MAX_DECISIONS,
        shown=f"{ROBOT.budget}, team and index-csma: {TEAM.budget}; none with --minutes",
    )
    minutes: float | None = common_setting(
        None,
        "stop after this many minutes, evaluations and earlier sessions included",
        low=1e-9,
        high=1e9,
    )
    replay_every: int | None = setting(
        None,
        "record the first held-out mission in OUT/replays every N team decisions",
        label="replay-every",
        low=1,
        high=MAX_DECISIONS,
    )
    patience: int | None = setting(
        None,
        "stop after this many evaluations in a row without improvement; 0: never",
        low=0,
        high=1_000_000,
        shown=f"{ROBOT.patience}, team: {TEAM.patience}",
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
    device: Device = "auto"  # that optimises the networks, in this session


def write_run(folder: Path, run: TrainingRun) -> None:
    """Write a run's `settings.json`; raises OSError if the folder cannot be written."""
    init = None if run.init is None else str(run.init.resolve())
    header = {"format": FORMAT, "format_version": FORMAT_VERSION}
    write_json(folder / SETTINGS, header | asdict(run) | {"init": init})


def read_run(folder: Path, named: Collection[str] | None = ()) -> TrainingRun:
    """Return what a run was asked for when it began, or last went on.

    Users' own components, as `module:Name`, must be `named`: to go on runs their code, and a folder
    may come from anyone; None is to look only, as one may at runs of version 1.0, too. Raises
    ValueError if one is not named, if there is no run, or if its settings are damaged, foreign or
    of another version; OSError if they cannot be read.
    """
    path = folder / SETTINGS
    if not os.path.lexists(path):
        raise ValueError(f"{folder} holds no run to go on with; to begin one, leave out --resume")
    text = read_file(path, "settings", MAX_BYTES)
    try:
        document: Document = read_document(text, FORMAT, FORMAT_VERSION, dict)
        is_of_1_0 = _is_of_1_0(document)
        run = read_plain(_as_1_0_trained(document) if is_of_1_0 else document, TrainingRun)
    except ValueError as error:
        raise ValueError(
            f"settings {path} are damaged, no run's, or from an earlier version: {error}"
        ) from error
    if is_of_1_0 and named is not None:
        raise ValueError(
            f"{folder} began with version 1.0 or before, whose way of training is gone; begin "
            f"another run with its policy, --init {folder} --features "
            f"{run.training.features:.200}, in another folder, --out"
        )
    for name in run.training.own.values():
        if named is not None and name not in named:
            raise ValueError(
                f"{folder} goes on with someone's own {name:.200}; if you trust that code, give "
                f"the run's {run.training.own_options} again"
            )
    return run


def _is_of_1_0(document: Document) -> bool:
    """Return whether settings are of version 1.0, which alone left out some of the silent rows."""
    training = document.get("training")
    ppo = training.get("ppo") if isinstance(training, dict) else None
    return isinstance(ppo, dict) and "silent_share" in ppo


def _as_1_0_trained(document: Document) -> Document:
    """Return settings of version 1.0 with what it did where they now say more."""
    training = document["training"]
    ppo = AS_1_0_OPTIMISED | training["ppo"]
    del ppo["silent_share"]
    return document | {"training": AS_1_0_TRAINED | training | {"ppo": ppo}}


class CurvePoint(NamedTuple):
    """A point of the curve that is drawn; a file need have no more than the first two columns."""

    decisions: float
    aoi: float  # [windows]
    aoi_sem: float | None  # [windows]
    references: dict[str, float]  # ages of reference policies, by their names [windows]
    compared: dict[str, Cost]  # with them, pair by pair; none in runs of 1.0.0


def read_curve(path: Path) -> list[CurvePoint]:
    """Return a learning curve, a point an evaluation; raise ValueError if the file holds none."""
    rows = read_rows(path, "learning curve", MAX_CURVE_BYTES)
    try:
        curve: list[CurvePoint] = []
        for _, cells in rows:
            row: Columns = {}
            for name, cell in cells.items():
                if cell:
                    row[name] = float(cell)
            point = CurvePoint(
                decisions=row["decisions"],
                aoi=row["aoi"],
                aoi_sem=row.get("aoi_sem"),
                references=reference_ages(row),
                compared=differences(row),
            )
            if not (point.decisions >= 0 and point.aoi >= 0):
                raise ValueError("a cell is negative, or no number")
            curve.append(point)
        return curve
    except (KeyError, ValueError) as error:
        raise ValueError(f"{path} is no learning curve, of decisions and aoi: {error}") from error


def check_new(folder: Path) -> None:
    """Raise ValueError if a folder holds a run, or anything else, so that none can begin there."""
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"run {folder} is a file; name a folder")
    left = (".part", ".lock")  # by a run that was killed while it began
    others = sorted(path.name for path in folder.glob("*") if not path.name.endswith(left))
    if others:
        raise ValueError(
            f"{folder} holds {others[0]}; go on with a run by --resume, or name another folder"
        )


def check_begun(folder: Path) -> None:
    """Raise ValueError if a folder's run cannot go on: it lost its checkpoint, or has links."""
    # Through links that lead out of the folder, the run would replace other files.
    for path in folder.rglob("*"):
        if path.is_symlink() and not path.resolve().is_relative_to(folder.resolve()):
            raise ValueError(f"{path} is a link that leads out of the run; copy what it leads to")
    has_begun = (folder / CURVE).exists() or (folder / POLICY).exists()
    if has_begun and not (folder / CHECKPOINT).exists():
        raise ValueError(
            f"{folder} has lost its {CHECKPOINT}, so its run cannot go on; put it back, or begin "
            "another run in another folder, by --out without --resume"
        )


def training_needs(training: Training, limits: Limits, *, is_shown: bool = False) -> needs.Needs:
    """Estimate a run: a rollout and the passes over it, held-out missions, checkpoints, replays.

    One that is shown while it goes on records a mission at a time, as replays do.
    """
    if not training.way.is_network:
        return _index_needs(training, limits, is_shown=is_shown)
    first = training.kinds[0]  # of the replays
    size = training.most_robots
    rollout = rollout_bytes(training)
    decisions = limits.decisions or MAX_DECISIONS
    num_flown = num_missions(training, decisions, 1 + OTHER_FLIGHTS)  # at most, to choose
    remembers = remembers_packets(training.features)
    held_out = learned_memory(size, num_flown, remembers_packets=remembers)
    under_way = learned_memory(size, training.missions, remembers_packets=remembers)
    # What leaves out silent rows sorts a copy of the others before it passes over them.
    passes = max(2.0 * rollout, rollout + passes_bytes(training))
    memory = held_out + (under_way - LIBRARIES - TORCH) + passes
    file = WINDOW_BYTES * training.missions * size * training.most_windows + CHECKPOINT_BYTES
    return _with_replays(needs.Needs(memory=memory, file=file), first, limits, is_shown=is_shown)


def _index_needs(training: Training, limits: Limits, *, is_shown: bool) -> needs.Needs:
    """Estimate a search for an index: the missions of all kinds, and those that choose."""
    flown = num_missions(training, limits.decisions or MAX_DECISIONS, 1 + OTHER_FLIGHTS)
    num_kinds = len(training.kinds)
    # Swarms of two sizes stay of each kind, if missions do not divide by the kinds.
    times, rest = divmod(training.missions, num_kinds)
    of_each = training.evolution.candidates * (2 * times + 1 if rest else times)
    memory = LIBRARIES + TORCH
    largest = 0.0
    for kind in training.kinds:  # their swarms stay, and missions begin anew in them
        memory += policy_memory(training.policy, kind, of_each) - LIBRARIES
        largest = max(largest, policy_memory(training.policy, kind, flown) - LIBRARIES)
    made = needs.Needs(memory=memory + largest, file=CHECKPOINT_BYTES)
    return _with_replays(made, training.kinds[0], limits, is_shown=is_shown)


def _with_replays(
    made: needs.Needs, first: Mission, limits: Limits, *, is_shown: bool
) -> needs.Needs:
    """Return the needs of a run with those of the replays of its first kind of mission."""
    memory = made.memory
    file = made.file
    if is_shown or limits.replay_every is not None:
        memory += IN_MEMORY.of(first, first.num_windows)
    if limits.replay_every is not None:
        num_replays = 1 + (limits.decisions or 0) // limits.replay_every
        file += num_replays * ON_DISK.of(first, first.num_windows)
    return needs.Needs(memory=memory, file=file)


def rollout_bytes(training: Training) -> int:
    """Return the size of a run's largest arrays: the rollout, and the robots' packet memory.

    And of what credits are made of, window by window: T before and after it, and whom all robots
    decode in both slots if a robot acts otherwise, which is at most once for each of them; and of
    the copies of one of these that are made meanwhile.
    """
    nodes = training.most_robots
    rows = training.missions * nodes  # a graph each
    graph = nodes * (4 * training.network.num_features + 4 + 1)  # features, parent, may address
    remembered = 4 * nodes**2 if remembers_packets(training.features) else 0
    replayed = 5 * 8 * nodes * training.ppo.num_steps if training.considers_speech else 0
    return rows * (graph * (training.ppo.num_steps + 1) + remembered + replayed)


def passes_bytes(training: Training) -> float:
    """Return the size of the activations that a minibatch keeps for its gradient."""
    nodes = training.most_robots
    ppo = training.ppo
    shape = training.network
    rows = training.missions * nodes * ppo.num_steps / ppo.num_minibatches
    kept = KEPT_ROWS if training.considers_speech else 1.0
    directions = 2 if shape.edges == "both" else 1
    layers = (shape.receptive_field + 1) * (shape.depth + 1) * (2 + directions)
    networks = 1 if training.shares_trunk else 2
    return 4.0 * kept * rows * nodes * shape.latent * layers * networks
