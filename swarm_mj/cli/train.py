"""`swarm-mj train`: trains a communication policy by PPO on the physics scene."""

import argparse
import shlex
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from swarm_mj.cli.interrupt import deferred_interrupt
from swarm_mj.cli.options import DEFAULTS, listed, new_parser, this_command
from swarm_mj.graphs.graph import FeatureSet
from swarm_mj.mission import PRESETS, Boundary, Task

if TYPE_CHECKING:
    from swarm_mj.learning.session import Status

DONE, INTERRUPTED = 0, 130
EVERYTHING = 1.0  # the bar's whole
BUDGETS = {"robot": 200_000, "team": 2_000_000}  # team decisions; the paper's for the paper's arm


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(
        commands,
        "train",
        "Train a communication policy by PPO; the best one is OUT/policy.",
        epilog="A run that was interrupted, or killed, goes on with --out OUT --resume. "
        "TensorBoard: tensorboard --logdir runs. "
        "Exit codes: 0 done, 2 bad input, 130 interrupted (all is kept).",
    )
    parser.add_argument("--out", type=Path, required=True, metavar="runs/NAME", help="the run")
    parser.add_argument("--resume", action="store_true", help="go on with the run in OUT")
    parser.add_argument(
        "--budget", type=int, help="team decisions (default: 200000; 2000000 with arm team)"
    )
    parser.add_argument("--minutes", type=float, help="stop after so long, evaluations included")
    _add_learning_options(parser.add_argument_group("learning"))
    _add_mission_options(parser.add_argument_group("missions"))
    parser.set_defaults(run=run)


def _add_learning_options(group: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """What a resumed run takes from its folder; unset means the arm's own."""
    group.add_argument(
        "--arm",
        help="robot (default): every robot is paid its own credit, learns in minutes; team: the "
        "paper's way",
    )
    group.add_argument("--seed", type=int, help="the same seed is the same policy (default: 0)")
    group.add_argument(
        "--features",
        help=f"{listed(get_args(FeatureSet))} (default: extended; the preset's own with arm team)",
    )
    group.add_argument("--receptive-field", type=int, help="K, message passes (default: 1; team 5)")
    group.add_argument("--latent", type=int, help="width of every layer (default: 32; team 64)")
    group.add_argument("--linear", action="store_true", default=None, help="the linear variant")
    group.add_argument("--reward", help="aoi (default), or velocity-variance with arm team")
    group.add_argument(
        "--missions", type=int, help="side by side, a multiple of 4 (default: 16; team 32)"
    )
    group.add_argument("--init", type=Path, metavar="POLICY", help="begin with a stored policy")
    group.add_argument("--evaluate-every", type=int, help="team decisions (default: 10000)")
    group.add_argument("--replay-every", type=int, help="team decisions between two replays")
    group.add_argument("--learning-rate", type=float, help="of Adam, at the start")
    group.add_argument("--entropy", type=float, help="weight of the entropy bonus")
    group.add_argument("--discount", type=float, help="gamma (default: 0; team 0.99)")
    group.add_argument("--threads", type=int, help="torch's (default: 1)")


def _add_mission_options(group: Any) -> None:  # noqa: ANN401 - argparse names no public type
    group.add_argument("--task", help=f"{listed(get_args(Task))} (default: stationary)")
    group.add_argument("--preset", help=f"{listed(PRESETS)} (default: paper)")
    group.add_argument(
        "--robots", type=int, nargs="+", help="size of the team; several are trained on together"
    )
    group.add_argument("--range-ratio", type=float, help=f"(default: {DEFAULTS.range_ratio})")
    group.add_argument("--velocity-ratio", type=float, help=f"(default: {DEFAULTS.velocity_ratio})")
    group.add_argument("--windows", type=int, help=f"per mission (default: {DEFAULTS.num_windows})")
    group.add_argument("--boundary", help=f"{listed(get_args(Boundary))} (default: the preset's)")


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    console = Console(stderr=True, highlight=False)
    with console.status("Preparing (torch takes its time; compiles once) ..."):
        from swarm_mj.learning.run import train
        from swarm_mj.learning.session import POLICY, Limits
        from swarm_mj.policies.stored import read_policy

        init = read_policy(options.init)[0] if options.init else None
        training = _stored(options) if options.resume else _asked(options)
        _check(options, training, init)
    limits = Limits(
        decisions=options.budget or (None if options.minutes else BUDGETS[training.arm]),
        minutes=options.minutes,
        replay_every=options.replay_every,
    )
    bar = Progress(
        TextColumn("Training"),
        BarColumn(),
        TextColumn("{task.fields[text]}"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    with deferred_interrupt() as is_interrupted, bar:
        task = bar.add_task("train", total=EVERYTHING, text="")

        def listen(status: "Status") -> bool:
            _show(bar, task, status, limits.decisions, limits.minutes)
            return not is_interrupted()

        progress = train(
            training,
            options.out,
            limits,
            listener=listen,
            init=init,
            is_resumed=options.resume,
            command=shlex.join(["swarm-mj", *sys.argv[1:]]),
        )
        was_interrupted = is_interrupted()
    Console(highlight=False, soft_wrap=True, markup=False).print(
        "todo", progress, POLICY, this_command()
    )
    return INTERRUPTED if was_interrupted else DONE
