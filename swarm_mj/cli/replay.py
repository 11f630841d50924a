"""`swarm-mj replay`: opens a recorded mission."""

from dataclasses import dataclass
from pathlib import Path

from swarm_mj.cli.terminal import plain_console
from swarm_mj.fields import setting
from swarm_mj.replay.view import run as run_viewer
from swarm_mj.replay.view import serve_command, view_command


@dataclass(frozen=True, kw_only=True)
class Options:
    """The options of `swarm-mj replay`."""

    file: Path = setting(help="an .rrd file that `swarm-mj fly` recorded", is_positional=True)
    web: bool = setting(
        False, "serve it to a browser, on this machine's loopback address only, until Ctrl-C"
    )


def run(options: Options) -> int:
    """Runs the command; returns its exit code."""
    from swarm_mj.replay.read import check_replay  # rerun takes its time to import

    check_replay(options.file)
    if not options.web:
        return run_viewer(view_command(options.file))
    command, address = serve_command(options.file)
    plain_console().print(f"Open {address}\nCtrl-C ends it.")
    return run_viewer(command)
