"""`swarm-mj train`: trains a communication policy by PPO on the physics scene."""

import argparse
import os
import shlex
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.table import Table

from swarm_mj.cli.interrupt import deferred_interrupt
from swarm_mj.cli.options import DEFAULTS, new_parser, this_command
from swarm_mj.cli.outputs import check_writable
from swarm_mj.cli.train_options import add_options
from swarm_mj.cli.train_progress import Watch, age_of
from swarm_mj.cli.train_settings import (
    asked_limits,
    asked_settings,
    check_memory,
    stored_settings,
)
from swarm_mj.mission import PRESETS

if TYPE_CHECKING:
    from swarm_mj.learning.progress import Progress
    from swarm_mj.learning.run_folder import Run

DONE, INTERRUPTED = 0, 130


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(
        commands,
        "train",
        "Train a communication policy by PPO; the best one is OUT/policy.",
        epilog="A run that was interrupted, or killed, goes on with --out OUT --resume and ends "
        "as if it had not been. OUT holds settings.json, curve.csv, tensorboard, policy and "
        "checkpoint.pt. Exit codes: 0 done, 2 bad input, 130 interrupted (--resume goes on).",
    )
    add_options(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    with console.status("Preparing (torch takes its time to load) ..."):
        asked = _asked_run(options)
        from swarm_mj.learning.run import train
    try:
        with deferred_interrupt() as is_interrupted:
            with Watch(console, asked.limits, is_interrupted) as watch:
                progress = train(
                    asked.training,
                    options.out,
                    asked.limits,
                    listener=watch,
                    init=asked.init,
                    is_resumed=options.resume,
                    command=asked.command,
                )
            is_over = not watch.has_stopped
            _print(options.out, asked, progress, is_over=is_over)
    except KeyboardInterrupt:
        go_on = _resume_command(options.out)
        console.print(f"Broken off; the last checkpoint is kept.\nGo on:    {go_on}", markup=False)
        return INTERRUPTED
    if not watch.has_begun:
        console.print("Nothing was left to train: raise --budget or --minutes, which count in all.")
    if not is_over:
        console.print(f"Interrupted after {progress.decisions:,} decisions; all is kept.")
    return DONE if is_over else INTERRUPTED


def _asked_run(options: argparse.Namespace) -> "Run":
    """What the options ask for; raises ValueError before anything is written."""
    from swarm_mj.learning.run_folder import SETTINGS, Run, check_new, read_run
    from swarm_mj.policies.stored import read_policy

    if options.resume:
        stored = read_run(options.out)
        training = stored_settings(options, stored.training)
        limits = asked_limits(options, training.arm, stored.limits)
        asked = replace(stored, training=training, limits=limits)
    else:
        check_new(options.out)
        init = read_policy(options.init)[1] if options.init else None
        training = asked_settings(options, init)
        limits = asked_limits(options, training.arm)
        command = shlex.join(["swarm-mj", *options.typed])
        asked = Run(training=training, limits=limits, command=command, init=options.init)
    check_writable(options.out / SETTINGS, "run")
    check_memory(asked.training, _memory_bytes())
    return asked


def _memory_bytes() -> int | None:
    """This machine's memory, if it tells."""
    try:
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return None


def _print(out: Path, asked: "Run", progress: "Progress", *, is_over: bool) -> None:
    """Prints what the run came to, and what to do with it."""
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(_table(out, asked, progress))
    for label, line in _next_commands(out, asked, progress, is_over=is_over):
        console.print(f"{label:10}{line}")


def _table(out: Path, asked: "Run", progress: "Progress") -> Table:
    training = asked.training
    sizes = ", ".join(map(str, training.robots))
    table = Table(
        title=f"{out}: arm {training.arm}, {training.mission.task}, {sizes} robots",
        title_justify="left",
        show_header=False,
    )
    best = progress.best
    if best is not None:
        table.add_row("held-out age, at first", f"{age_of(progress.curve[0])} windows")
        table.add_row(
            "held-out age, best policy",
            f"{age_of(best)} windows, after {best['decisions']:,.0f} decisions; chosen on these",
        )
        if training.reward == "velocity-variance":
            first, last = (row["velocity_variance"] for row in (progress.curve[0], best))
            table.add_row("velocity variance, of these", f"{first:.4f}, {last:.4f} m²/s²")
    table.add_row("decisions", f"{progress.decisions:,}")
    table.add_row("minutes", f"{progress.minutes:.1f}")
    table.add_row("best policy", str(out / "policy") if best else "none yet")
    return table


def _next_commands(
    out: Path, asked: "Run", progress: "Progress", *, is_over: bool
) -> list[tuple[str, str]]:
    """What to do next, and the commands that do it."""
    name, policy, mission = this_command(), shlex.quote(str(out / "policy")), _mission_flags(asked)
    lines = [
        ("Watch:", f"{this_command('tensorboard')} --logdir {shlex.quote(str(out))}"),
        ("Go on:", _resume_command(out, 2 * progress.decisions if is_over else None)),
    ]
    if progress.best is None:
        return lines
    return [
        ("Fly:", f"{name} fly --policy {policy} {mission}"),
        ("Evaluate:", f"{name} evaluate --policy {policy} tdma {mission}"),
        *lines,
    ]


def _mission_flags(asked: "Run") -> str:
    """The options that name the missions trained on, for commands whose defaults are others."""
    mission, training = asked.training.mission, asked.training
    values = {
        "--task": (mission.task, None),
        "--preset": (mission.preset, DEFAULTS.preset),
        "--robots": (training.robots[0], DEFAULTS.num_robots),
        "--range-ratio": (mission.range_ratio, DEFAULTS.range_ratio),
        "--velocity-ratio": (mission.velocity_ratio, DEFAULTS.velocity_ratio),
        "--windows": (mission.num_windows, DEFAULTS.num_windows),
        "--boundary": (mission.boundary, PRESETS[mission.preset](mission.task).boundary),
    }
    return " ".join(f"{flag} {value}" for flag, (value, usual) in values.items() if value != usual)


def _resume_command(out: Path, budget: int | None = None) -> str:
    more = "" if budget is None else f" --budget {budget}"
    return f"{this_command()} train --out {shlex.quote(str(out))} --resume{more}"
