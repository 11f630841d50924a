"""What commands will take of memory and disk, estimated before the work.

The numbers are measured: peaks on Linux, of all tasks and policies, of 2 to 1000 robots. A test
holds estimates against peaks; they are meant to be right within a factor of 2, rather too high.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from swarm_mj.evaluation.study import Study
from swarm_mj.learning.choice import MANY_DECISIONS, OTHER_FLIGHTS, num_missions
from swarm_mj.mission import Mission
from swarm_mj.policies.registry import is_learned
from swarm_mj.replay.recorder import AGE_BYTES, MAX_AGE_MATRIX_BYTES
from swarm_mj.system.machine import free_addresses, free_memory, free_room, largest_file

if TYPE_CHECKING:  # they load torch, which flights may do without
    from swarm_mj.learning.run_folder import Limits
    from swarm_mj.learning.settings import Training

GB = 1e9
LIBRARIES, TORCH = 0.15 * GB, 0.4 * GB  # and compiling; torch with what trains
ADDRESSES, OF_TORCH, OF_RERUN = 0.5 * GB, 0.7 * GB, 3.0 * GB  # that are asked for, never filled


@dataclass(frozen=True, kw_only=True)
class Needs:
    """What a command takes beyond what its process has when it starts [bytes]."""

    memory: float
    addresses: float = ADDRESSES  # of these, beyond the memory
    file: float = 0.0  # all that it writes
    largest_file: float | None = None  # the largest file of these; None is all in one


def check_fits(
    needs: Needs,
    output: Path | None,
    way_out: str,
    *,
    is_forced: bool,
    way_on: str = ", or try it with --yes",
) -> None:
    """Pass if a command's needs will be met, or nobody minds.

    Args:
        needs: The command's.
        output: Where it writes, if it does.
        way_out: What to choose instead.
        is_forced: Whether `--yes` was given.
        way_on: How to start all the same, if there is a way.

    Raises:
        ValueError: Memory, addresses or the disk will not suffice; it says by how much.
    """
    addresses = free_addresses()
    has = [("of memory", needs.memory, free_memory(), "are free")]
    if addresses is not None:
        asked = needs.memory + needs.addresses
        has.append(("of address space", asked, addresses, "are left by ulimit -v"))
    if output is not None:
        has.append(("on disk", needs.file, free_room(output), f"fit at {output}"))
        most = largest_file()
        if most is not None:
            largest = needs.file if needs.largest_file is None else needs.largest_file
            has.append(("in one file", largest, most, "are allowed by ulimit -f"))
    for what, needed, free, where in has:
        if needed > free and not is_forced:
            raise ValueError(
                f"this takes about {in_gb(needed)} {what}, and {in_gb(free)} {where}; "
                f"{way_out}{way_on}"
            )


def flight_needs(mission: Mission, policy: str, *, is_recorded: bool) -> Needs:
    """Of `fly`."""
    memory = missions_memory(mission, 1, is_learned=is_learned(policy))
    addresses = ADDRESSES + (OF_TORCH if is_learned(policy) else 0.0)
    if not is_recorded:
        return Needs(memory=memory, addresses=addresses)
    return Needs(
        memory=memory + replay_memory(mission, mission.num_windows),
        addresses=addresses + OF_RERUN,
        file=replay_file(mission),
    )


def study_needs(study: Study, num_jobs: int) -> Needs:
    """Of `evaluate`: processes with a batch each, what they found, and the files of that."""
    batches = study.batches
    largest = max(
        missions_memory(batch.mission, len(batch.seeds), is_learned=is_learned(batch.policy))
        for batch in batches
    )
    ages = sum(2 * batch.mission.num_windows + 1 for batch in batches)  # counts
    missions = study.episodes * len(study.pairs)
    return Needs(
        memory=min(num_jobs, len(batches)) * largest + 50.0 * ages + 1000.0 * missions,
        addresses=ADDRESSES + (OF_TORCH if any(map(is_learned, study.policies)) else 0.0),
        file=5.0 * ages + 300.0 * missions,
    )


def training_needs(training: "Training", limits: "Limits") -> Needs:
    """Of `train`: a rollout and the passes over it, held-out missions, checkpoints, replays."""
    missions = [replace(training.mission, num_robots=size) for size in training.robots]
    largest, rollout = max(missions, key=lambda each: each.num_robots), rollout_bytes(training)
    decisions = limits.decisions or MANY_DECISIONS
    num_flown = num_missions(training, decisions, 1 + OTHER_FLIGHTS)  # at most, to choose
    held_out = missions_memory(largest, num_flown, is_learned=True)
    under_way = missions_memory(largest, training.missions, is_learned=True) - LIBRARIES - TORCH
    # What leaves out silent rows sorts a copy of the others before it passes over them.
    memory = held_out + under_way + max(2.0 * rollout, rollout + passes_bytes(training))
    file = 2.0 * training.missions * largest.num_robots * largest.num_windows + 0.01 * GB
    if limits.replay_every is None:
        return Needs(memory=memory, addresses=ADDRESSES + OF_TORCH, file=file)
    num_replays = 1 + (limits.decisions or 0) // limits.replay_every
    return Needs(
        memory=memory + replay_memory(missions[0], missions[0].num_windows),
        addresses=ADDRESSES + OF_TORCH + OF_RERUN,
        file=file + num_replays * replay_file(missions[0]),
        largest_file=max(file, replay_file(missions[0])),
    )


def video_needs(width: int, height: int, num_pictures: int | float, suffix: str) -> Needs:
    """Of `replay --video`: a GIF's pictures are kept until the last one is drawn."""
    pixels = width * height
    kept = num_pictures if suffix == ".gif" else 0.0
    return Needs(
        memory=3.0 * LIBRARIES + (130.0 + 1.5 * kept) * pixels,
        addresses=ADDRESSES + OF_RERUN,
        file=0.1e6 + 0.05 * num_pictures * pixels,
    )


def figures_needs(results: Iterable[Path], num_files: int) -> Needs:
    """Of `figures`: the results as objects, and pictures of 1 MB at most."""
    read = sum(path.stat().st_size for path in results if path.is_file())
    return Needs(memory=2.0 * LIBRARIES + 10.0 * read, file=1e6 * num_files)


def missions_memory(mission: Mission, num_missions: int, *, is_learned: bool) -> float:
    """What missions side by side take: what each robot knows, and what a network makes of it."""
    pairs = num_missions * mission.num_robots**2
    if not is_learned:
        return LIBRARIES + 100.0 * pairs
    return LIBRARIES + TORCH + 450.0 * pairs + 4.0 * pairs * mission.num_robots


def replay_memory(mission: Mission, num_windows: int) -> float:
    """What recording so many windows takes, at its peak: when they are written."""
    matrices = min(MAX_AGE_MATRIX_BYTES, AGE_BYTES * num_windows * mission.num_robots**2)
    return 0.1 * GB + (15e3 + 1e3 * mission.num_robots) * num_windows + 2.2 * matrices


def replay_file(mission: Mission) -> float:
    """Return a replay's size, of teams that move; others' are smaller."""
    matrices = min(MAX_AGE_MATRIX_BYTES, AGE_BYTES * mission.num_windows * mission.num_robots**2)
    return 0.5e6 + (500.0 + 150.0 * mission.num_robots) * mission.num_windows + 0.25 * matrices


def rollout_bytes(training: "Training") -> int:
    """What a run's largest arrays take: the rollout, and what robots remember of packets."""
    nodes = max(training.robots)
    rows = training.missions * nodes  # a graph each
    graph = nodes * (4 * training.network.num_features + 4 + 1)  # features, parent, may address
    remembered = 4 * nodes**2 if training.features in ("local", "extended") else 0
    return rows * (graph * (training.ppo.num_steps + 1) + remembered)


def passes_bytes(training: "Training") -> float:
    """What a minibatch leaves behind in the networks on its way to the gradient."""
    nodes, ppo, shape = max(training.robots), training.ppo, training.network
    rows = training.missions * nodes * ppo.num_steps / ppo.num_minibatches
    kept = 0.4 if training.drops_silence else 1.0  # of the rows
    directions = 2 if shape.edges == "both" else 1
    layers = (shape.receptive_field + 1) * (shape.depth + 1) * (2 + directions)
    networks = 1 if training.shares_trunk else 2
    return 4.0 * kept * rows * nodes * shape.latent * layers * networks


def in_gb(size: int | float) -> str:
    """Return a size as messages name it."""
    return f"{float(f'{size / GB:.3g}'):,g} GB"
