"""`swarm-mj replay`: opens a recorded mission."""

import argparse
from pathlib import Path
from typing import Any

from rich.console import Console

from swarm_mj.cli.options import new_parser
from swarm_mj.replay.view import run as run_viewer
from swarm_mj.replay.view import serve_command, view_command


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(commands, "replay", "Open a replay in rerun's viewer.")
    parser.add_argument("file", type=Path, help="an .rrd file that `swarm-mj fly` recorded")
    parser.add_argument(
        "--web",
        action="store_true",
        help="serve it to a browser, on this machine's loopback address only, until Ctrl-C",
    )
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    from swarm_mj.replay.read import check_replay  # rerun takes its time to import

    check_replay(options.file)
    if not options.web:
        return run_viewer(view_command(options.file))
    command, address = serve_command(options.file)
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(f"Open {address}\nCtrl-C ends it.")
    return run_viewer(command)
