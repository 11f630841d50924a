"""`swarm-mj evaluate`: policies over the same missions, with error bars."""

import argparse
from contextlib import closing
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from swarm_mj.cli.evaluation_table import print_results
from swarm_mj.cli.interrupt import deferred_interrupt
from swarm_mj.cli.options import new_parser
from swarm_mj.cli.outputs import check_writable
from swarm_mj.cli.study_options import add_study_options, study_of
from swarm_mj.evaluation import progress
from swarm_mj.evaluation.batch import BatchCosts, fly_batch
from swarm_mj.evaluation.jobs import run_jobs
from swarm_mj.evaluation.results import write_csv, write_json
from swarm_mj.evaluation.study import Study
from swarm_mj.evaluation.summary import Evaluated, summarise

DONE, INTERRUPTED = 0, 130
MAX_JOBS = 256


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(
        commands,
        "evaluate",
        "Fly policies over the same missions and say where they stand, with error bars.",
        epilog="Exit codes: 0 done, 2 bad input, 130 interrupted (with --json or --csv, --resume "
        "continues).",
    )
    add_study_options(parser)
    parser.add_argument("--jobs", type=int, default=1, help="processes, 1 to 256")
    group = parser.add_argument_group("output")
    group.add_argument(
        "--json", type=Path, metavar="FILE", help="write all figures and each mission's costs"
    )
    group.add_argument(
        "--csv", type=Path, metavar="FILE", help="write all figures, one row a result"
    )
    group.add_argument("--force", action="store_true", help="replace existing results and progress")
    group.add_argument(
        "--resume", action="store_true", help="continue where an interruption broke off"
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    if not 1 <= options.jobs <= MAX_JOBS:
        raise ValueError(f"jobs must be from 1 to {MAX_JOBS}, not {options.jobs}")
    study = study_of(options)
    kept = _check_outputs(options)
    console = Console(stderr=True, highlight=False)
    header = study.header()
    costs = _begin(kept, header, is_resumed=options.resume) if kept else {}
    try:
        _fly(study, costs, options.jobs, kept, console)
    except KeyboardInterrupt:
        console.print(_interrupted(study, costs, kept))
        return INTERRUPTED
    with deferred_interrupt():
        evaluated = summarise(study, costs, header)
        _write(options, evaluated)
        if kept:
            kept.unlink()
    print_results([each.result for each in evaluated])
    return DONE


def _check_outputs(options: argparse.Namespace) -> Path | None:
    """The progress file, or None without outputs; raises ValueError for what cannot be written."""
    outputs = [path for path in (options.json, options.csv) if path]
    if not outputs:
        if options.resume:
            raise ValueError("--resume needs the --json or --csv of the run that was interrupted")
        return None
    for path in outputs:
        check_writable(path, "results", must_be_new=not options.force)
    if len({path.resolve() for path in outputs}) < len(outputs):
        raise ValueError(f"--json and --csv name the same file, {options.csv}")
    kept = progress.progress_path(outputs[0])
    if kept.exists() and not (options.resume or options.force):
        raise ValueError(
            f"progress {kept} of an interrupted run exists; continue it with --resume, or start "
            "over with --force"
        )
    return kept


def _begin(kept: Path, header: dict[str, Any], *, is_resumed: bool) -> dict[int, BatchCosts]:
    """The batches already flown; begins the progress file if there are none."""
    if is_resumed and kept.exists():
        return progress.resume(kept, header)
    progress.start(kept, header)
    return {}


def _fly(
    study: Study,
    costs: dict[int, BatchCosts],
    num_jobs: int,
    kept: Path | None,
    console: Console,
) -> None:
    """Flies the batches that `costs` lacks, into `costs` and the progress file."""
    left = [index for index in range(len(study.batches)) if index not in costs]
    missions = [len(batch.seeds) for batch in study.batches]
    bar = Progress(
        TextColumn("Flying"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("missions"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    flown = run_jobs(fly_batch, [study.batches[index] for index in left], num_jobs)
    with bar, closing(flown):
        task = bar.add_task(
            "fly", total=sum(missions), completed=sum(missions[index] for index in costs)
        )
        for which, batch_costs in flown:
            index = left[which]
            with deferred_interrupt() as is_interrupted:
                costs[index] = batch_costs
                if kept:
                    progress.append(kept, index, batch_costs)
            if is_interrupted():
                raise KeyboardInterrupt
            bar.update(task, advance=missions[index])


def _interrupted(study: Study, costs: dict[int, BatchCosts], kept: Path | None) -> str:
    flown = sum(len(study.batches[index].seeds) for index in costs)
    total = sum(len(batch.seeds) for batch in study.batches)
    hint = "the same command with --resume continues" if kept else "nothing was kept"
    return f"Interrupted after {flown} of {total} missions; {hint}."


def _write(options: argparse.Namespace, evaluated: list[Evaluated]) -> None:
    results = [each.result for each in evaluated]
    if options.json:
        missions = [
            {"episode_aoi": each.aoi, "episode_velocity_variance": each.velocity_variance}
            for each in evaluated
        ]
        write_json(options.json, results, missions)
    if options.csv:
        write_csv(options.csv, results)
