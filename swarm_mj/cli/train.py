"""`swarm-mj train`: trains a network by PPO, or an index by evolution, in missions."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, get_args

from rich.console import Console

from swarm_mj.api.live import check_live, keep_open, live_option, open_viewer
from swarm_mj.cli import train_settings
from swarm_mj.cli.mission_options import mission_flags, values_of
from swarm_mj.cli.options import Given, nested
from swarm_mj.cli.train_report import Watch, has_stopped_early, report, verdicts
from swarm_mj.cli.train_sweep import run_sweep
from swarm_mj.evaluation.engines import PROCESSES, EngineOptions
from swarm_mj.learning import run_folder
from swarm_mj.learning.run_folder import Limits, TrainingRun
from swarm_mj.learning.selection import Progress
from swarm_mj.learning.settings import Device, Training
from swarm_mj.policies.stored import POLICY, read_policy
from swarm_mj.system.exit_codes import DONE, FAILED, INTERRUPTED
from swarm_mj.system.fields import common_setting, files_read, same_as, setting, the_file
from swarm_mj.system.interrupt import deferred_interrupt
from swarm_mj.system.needs import YES, check_fits, memory_errors
from swarm_mj.system.terminal import named_values, plain_console, tell_cores, this_command
from swarm_mj.system.user_code import files_named, load
from swarm_mj.system.writing import Output, check_outputs

ONE_LIVE = "--live shows one training; leave it out of a --sweep"


@dataclass(frozen=True, kw_only=True)
class TrainOptions(EngineOptions):
    """The options of `swarm-mj train`."""

    EPILOG: ClassVar = (
        "A run that was interrupted, or killed, goes on with --out OUT --resume and ends as if it "
        "had not been. OUT holds policy.safetensors, the one to fly; settings.json, curve.csv, "
        "tensorboard and checkpoint.pt. Exit codes: 0 done, 1 the machine failed, 2 bad input, 130 "
        "interrupted (--resume goes on)."
    )
    out: Path = setting(help="the run's folder", metavar="runs/NAME")
    resume: bool = common_setting(False, "go on with the run in OUT")
    budget: int | None = same_as(Limits, "decisions")
    minutes: float | None = same_as(Limits, "minutes")
    patience: int | None = same_as(Limits, "patience")
    replay_every: int | None = same_as(Limits, "replay_every")
    live: str | None = live_option(
        help="show the first held-out mission of each evaluation and the learning curve meanwhile, "
        "in rerun's viewer or, with web, in a browser",
        group="",
        is_common=False,
    )
    device: str | None = setting(
        None,
        "where the networks learn: cpu, or cuda, an NVIDIA GPU; auto takes a GPU if there is one. "
        "Missions are on the CPU",
        choices=get_args(Device),
        shown="auto, --resume: as before",
    )
    init: Path | None = common_setting(
        None, "begin with a stored policy", metavar="POLICY", reads=the_file
    )
    logger: str | None = setting(
        None,
        "a logger of your own, which gets every evaluation; one that fails does not end the run",
        metavar="module:Name",
        reads=files_named,
    )
    sweep: Path | None = setting(
        None,
        "a training for each combination of values in a file, all below OUT",
        metavar="FILE.toml",
        reads=the_file,
        group=PROCESSES,
    )
    yes: bool = setting(False, YES)
    settings: Given = nested(train_settings.setting_options, train_settings.given_settings)
    typed: tuple[str, ...] = ()


def run(options: TrainOptions) -> int:
    """Run the command; return its exit code."""
    if options.sweep is not None:
        if options.live is not None:
            raise ValueError(ONE_LIVE)
        return _sweep(options, options.sweep)
    if (options.jobs, options.engine, options.address) != (1, "local", None):
        raise ValueError(
            "--jobs, --engine and --address are of several trainings; add --sweep FILE"
        )
    check_live(options.live, None)
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    with console.status("Preparing ..."):
        asked = asked_run(options)
        tell_cores(asked.training.threads, "threads")
        from swarm_mj.learning.live import LiveTraining
        from swarm_mj.learning.loggers import make_logger
        from swarm_mj.learning.train import train  # stable-baselines3 is slow to import

        trains = partial(
            train,
            asked,
            options.out,
            is_resumed=options.resume,
            logger=make_logger(options.logger, options.out) if options.logger else None,
            complain=console.print,
        )
    if options.live is None:
        return _train(options, asked, console, trains)
    with open_viewer(options.live, console) as viewer:
        code = _train(options, asked, console, partial(trains, live=LiveTraining(viewer)))
        if code == DONE:
            keep_open(viewer)  # whether it failed or was closed, the run has not
        return code


def _train(
    options: TrainOptions, asked: TrainingRun, console: Console, trains: Callable[..., Progress]
) -> int:
    """Train, and say what came of it; return the exit code."""
    try:
        with memory_errors(), deferred_interrupt() as is_interrupted:
            watch = Watch(console, asked, is_interrupted)
            with watch:
                progress = trains(listener=watch)
            _print(options.out, asked, progress, is_over=not watch.has_stopped)
    except (KeyboardInterrupt, MemoryError) as error:
        is_memory = isinstance(error, MemoryError)
        go_on = _resume_command(options.out, asked.training)
        ending = "Out of memory" if is_memory else "Broken off"
        console.print(f"{ending}; the last checkpoint is kept.\nGo on:    {go_on}", markup=False)
        return FAILED if is_memory else INTERRUPTED
    if not watch.has_begun:
        limit = asked.limits.minutes
        of = "" if limit is None else f" of {limit:g}"
        console.print(
            f"Nothing was left to train: the run made {progress.decisions:,} decisions in "
            f"{progress.minutes:.1f}{of} minutes. Raise --budget or --minutes, which count in all "
            "and leave time to select a policy, or give --patience 0 if the run stopped early."
        )
    if watch.has_stopped:
        console.print(f"Interrupted after {progress.decisions:,} decisions; all is kept.")
        return INTERRUPTED
    return DONE


def _sweep(options: TrainOptions, path: Path) -> int:
    """Run several trainings; return the exit code."""
    alone = TrainOptions(
        out=options.out,
        sweep=path,
        resume=options.resume,
        jobs=options.jobs,
        engine=options.engine,
        address=options.address,
        settings={},
        typed=options.typed,
    )
    if options != alone:
        raise ValueError(
            f"with --sweep, options of trainings stand in {path}; leave out the others"
        )

    def check_training(one: TrainOptions) -> None:
        if one.live is not None:
            raise ValueError(f"sweep {path}: {ONE_LIVE}")
        asked_run(one)

    engine = options.engine_with([])
    return run_sweep(path, options.out, engine, check_training, is_resumed=options.resume)


def asked_run(options: TrainOptions) -> TrainingRun:
    """Return the run that the options ask for; raise ValueError before anything is written."""
    run = _begun_run(options) if options.resume else _new_run(options)
    if options.device is not None and not run.training.way.is_network:
        raise ValueError(
            f"--device is of training a gnn, not of {run.training.policy}; leave it out"
        )
    device = options.device or run.device
    run = replace(run, limits=asked_limits(run.limits, options), device=device)
    names = (run_folder.SETTINGS, run_folder.CHECKPOINT, run_folder.CURVE, POLICY)
    written = (Output("run", options.out / name) for name in names)
    check_outputs(*written, inputs=[*files_read(options), *files_read(run.training)])
    is_shown = options.live is not None
    needs = run_folder.training_needs(run.training, run.limits, is_shown=is_shown)
    check_fits(needs, options.out, "choose fewer --missions or --robots", is_forced=options.yes)
    if options.logger:  # before a long start; and what is loaded travels to other machines
        load("logger", options.logger)
    return run


def _begun_run(options: TrainOptions) -> TrainingRun:
    run = run_folder.read_run(options.out, train_settings.own_names(options.settings))
    if options.init is not None:
        raise ValueError(f"{options.out} has begun, so --init {options.init} is too late")
    train_settings.refuse_others(options.settings, run.training, f"the run in {options.out}")
    train_settings.load_own(run.training.features, run.training.own_network, run.training)
    return run


def _new_run(options: TrainOptions) -> TrainingRun:
    run_folder.check_new(options.out)
    init = options.init
    given = options.settings
    begun_with = None
    if init is not None:
        if train_settings.are_of_index(given):
            raise ValueError("--init begins with a gnn, not with an index; leave it out")
        begun_with = read_policy(init)[1]
    training = train_settings.asked_settings(given, begun_with, init)
    limits = Limits(decisions=training.way.budget, patience=training.way.patience)
    command = shlex.join(["swarm-mj", "train", *options.typed])
    return TrainingRun(training=training, limits=limits, command=command, init=init)


def asked_limits(limits: Limits, options: TrainOptions) -> Limits:
    """Return a run's limits, changed by the options that were given."""
    if options.budget is not None or options.minutes is not None:  # either replaces both
        limits = replace(limits, decisions=options.budget, minutes=options.minutes)
    if options.patience is not None:
        limits = replace(limits, patience=options.patience)
    if options.replay_every is not None:
        limits = replace(limits, replay_every=options.replay_every)
    return limits


def _print(out: Path, asked: TrainingRun, progress: Progress, *, is_over: bool) -> None:
    training = asked.training
    console = plain_console()
    sizes = ", ".join(map(str, training.robots))
    tasks = ", ".join(values_of("task", training.all_missions))
    rows = {
        **report(asked, progress),
        "decisions": f"{progress.decisions:,}",
        "minutes": f"{progress.minutes:.1f}",
        "its policy": str(out / POLICY) if progress.best else "none yet",
    }
    title = f"{out}: {training.way.label}, {tasks}, {sizes} robots"
    console.print(named_values(title, rows))
    for line in verdicts(asked, progress):
        console.print(line)
    more = f" --budget {2 * progress.decisions}" if is_over else ""
    if has_stopped_early(asked, progress) and progress.has_chosen:
        more = " --patience 0"
    if progress.best is not None:
        flown = f"--policy {shlex.quote(str(out / POLICY))}"
        flags = mission_flags(training.kinds[0])
        flags += f" {training.own_options}" if training.own else ""
        console.print(f"Fly:      {this_command()} fly {flown} {flags}")
        console.print(f"Evaluate: {this_command()} evaluate {flown} tdma {flags}")
    console.print(f"Watch:    {this_command('tensorboard')} --logdir {shlex.quote(str(out))}")
    console.print(f"Go on:    {_resume_command(out, training, more)}")


def _resume_command(out: Path, training: Training, more: str = "") -> str:
    more += f" {training.own_options}" if training.own else ""
    return f"{this_command()} train --out {shlex.quote(str(out))} --resume{more}"
