"""Flies a study's missions, and writes what each policy cost."""

from collections.abc import Callable, Mapping
from contextlib import closing
from dataclasses import dataclass

from rich.console import Console

from swarm_mj.evaluation.batch import BatchCosts, fly_batch
from swarm_mj.evaluation.jobs import run_jobs
from swarm_mj.evaluation.published import BASELINES
from swarm_mj.evaluation.study import Study
from swarm_mj.system.fields import setting
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.progress import WorkBar

DEFAULT_POLICIES = ("planner", *BASELINES)


@dataclass(frozen=True, kw_only=True)
class Processes:
    """How many processes share a study's missions."""

    jobs: int = setting(1, "processes", low=1, high=256)


def num_flown(study: Study, costs: Mapping[int, BatchCosts]) -> int:
    """Return how many of a study's missions have been flown."""
    return sum(len(study.batches[index].seeds) for index in costs)


def study_bar(
    study: Study, costs: Mapping[int, BatchCosts], console: Console, *, after_s: float = 0.0
) -> WorkBar:
    """Return a bar of a study's missions, as far as they are flown."""
    total, done = study.episodes * len(study.pairs), num_flown(study, costs)
    return WorkBar("Flying", total, "missions", completed=done, console=console, after_s=after_s)


def fly_study(
    study: Study,
    costs: dict[int, BatchCosts],
    num_jobs: int,
    keep: Callable[[int, BatchCosts], None] | None,
    bar: WorkBar,
) -> None:
    """Flies the batches that `costs` lacks, into `costs` and where they are kept.

    Raises:
        KeyboardInterrupt: Ctrl-C was pressed; `costs` has all batches that were flown.
    """
    left = [index for index in range(len(study.batches)) if index not in costs]
    flown = run_jobs(fly_batch, [study.batches[index] for index in left], num_jobs)
    with bar, closing(flown):
        for which, batch_costs in flown:
            index = left[which]
            with deferred_interrupt() as is_interrupted:
                costs[index] = batch_costs
                if keep:
                    keep(index, batch_costs)
            if is_interrupted():
                raise KeyboardInterrupt
            bar.move_to(num_flown(study, costs))
