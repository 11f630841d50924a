"""Estimates of the memory and disk that flights, studies and figures take, from measured peaks."""

from collections.abc import Iterable
from pathlib import Path

from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission
from swarm_mj.policies.registry import is_learned
from swarm_mj.replay.recorder import replay_file, replay_memory
from swarm_mj.system.needs import ADDRESSES, LIBRARIES, OF_RERUN, OF_TORCH, Needs, missions_memory


def flight_needs(mission: Mission, policy: str, *, is_recorded: bool) -> Needs:
    """Return the needs of `fly`."""
    memory = missions_memory(mission.num_robots, 1, is_learned=is_learned(policy))
    addresses = ADDRESSES + (OF_TORCH if is_learned(policy) else 0.0)
    if not is_recorded:
        return Needs(memory=memory, addresses=addresses)
    return Needs(
        memory=memory + replay_memory(mission, mission.num_windows),
        addresses=addresses + OF_RERUN,
        file=replay_file(mission),
    )


def study_needs(study: Study, num_jobs: int) -> Needs:
    """Return the needs of `evaluate`: a batch in each process, and the results of all."""
    batches = study.batches
    largest = max(
        missions_memory(
            batch.mission.num_robots, len(batch.seeds), is_learned=is_learned(batch.policy)
        )
        for batch in batches
    )
    ages = sum(2 * batch.mission.num_windows + 1 for batch in batches)  # counts
    missions = study.episodes * len(study.pairs)
    return Needs(
        memory=min(num_jobs, len(batches)) * largest + 50.0 * ages + 1000.0 * missions,
        addresses=ADDRESSES + (OF_TORCH if any(map(is_learned, study.policies)) else 0.0),
        file=5.0 * ages + 300.0 * missions,
    )


def figures_needs(results: Iterable[Path], num_files: int) -> Needs:
    """Return the needs of `figures`: the results as objects, and pictures of 1 MB at most."""
    read = sum(path.stat().st_size for path in results if path.is_file())
    return Needs(memory=2.0 * LIBRARIES + 10.0 * read, file=1e6 * num_files)
