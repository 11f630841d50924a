"""The command line, one file per command.

`swarm-mj fly | evaluate | train | figures | replay | scene | bench`.

Exit codes: 0 done, 2 bad input, 130 interrupted.
"""

import argparse
import sys
from collections.abc import Sequence
from typing import NoReturn

BAD_INPUT, INTERRUPTED = 2, 130


class _Parser(argparse.ArgumentParser):
    """Complains in one line."""

    def error(self, message: str) -> NoReturn:
        """Prints the complaint and where to read on; exits with 2."""
        self.exit(BAD_INPUT, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def make_parser() -> argparse.ArgumentParser:
    """The parser of all commands; imported here, so that Ctrl-C is heard while they load."""
    from swarm_mj.cli import bench, evaluate, figures, fly, replay, scene, train
    from swarm_mj.io.provenance import version

    parser = _Parser(
        prog="swarm-mj",
        description="Robot swarms on MuJoCo that share their state over a radio they compete for.",
    )
    parser.add_argument("--version", action="version", version=f"swarm-mj {version()}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")
    for command in (fly, evaluate, train, figures, replay, scene, bench):
        command.add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command.

    Args:
        arguments: The command line after the program's name; None is this process's.

    Returns:
        The exit code.
    """
    try:
        typed = sys.argv[1:] if arguments is None else list(arguments)
        options = make_parser().parse_args(typed)
        options.typed = typed
        return options.run(options)
    except (ValueError, OSError) as error:
        sys.stderr.write(f"swarm-mj: error: {error}\n")
        return BAD_INPUT
    except KeyboardInterrupt:
        sys.stderr.write("swarm-mj: interrupted\n")
        return INTERRUPTED
