"""The command line without a command: the overview, the version, completion for shells."""

import argparse
import sys
from collections.abc import Mapping, Sequence
from typing import NoReturn

from swarm_mj.cli import COMMANDS
from swarm_mj.cli.options import Parser
from swarm_mj.system.exit_codes import BAD_INPUT, DONE
from swarm_mj.system.fields import did_you_mean
from swarm_mj.system.provenance import version

SHELLS = ("bash", "zsh")
NAME = "swarm-mj"
BEGINNING = {
    "fly": "a flock of 40 robots flies 50 s; it records a replay",
    "replay FILE": "opens that replay",
    "policies": "what you can give to --policy, and what each one knows",
    "evaluate": "flies several policies on the same missions",
}


def overview_parser() -> Parser:
    """Return the parser of a line without a command; its help lists the commands."""
    begin_with = {f"{NAME} {command}": what for command, what in BEGINNING.items()}
    parser = Parser(
        prog=NAME,
        usage=f"{NAME} COMMAND [OPTIONS]",
        description="Robot swarms on MuJoCo that share their state over a radio they compete for.",
        epilog=f"{_listed('commands', COMMANDS)}\n{_listed('begin with', begin_with)}\n"
        f"`{NAME} COMMAND --help` explains a command and its options.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"{NAME} {version()}")
    parser.add_argument(
        "--print-completion",
        choices=SHELLS,
        metavar="SHELL",
        help=f"print what completes a command line in {' or '.join(SHELLS)}",
    )
    return parser


def _listed(title: str, meanings: Mapping[str, str]) -> str:
    width = max(map(len, meanings))
    lines = [f"  {name:{width}}  {meaning}\n" for name, meaning in meanings.items()]
    return f"{title}:\n{''.join(lines)}"


def show_or_refuse(arguments: Sequence[str]) -> NoReturn:
    """Show what was asked for: help, version, completion; or says what is wrong with the line."""
    parser = overview_parser()
    if not arguments:
        parser.print_help(sys.stderr)
        parser.exit(BAD_INPUT)
    if not arguments[0].startswith("-"):
        hint = did_you_mean(arguments[0], COMMANDS)
        parser.error(f"there is no command {arguments[0]!r}{hint}")
    shell = parser.known(arguments).print_completion
    if shell is None:
        parser.error("name the command first")
    from swarm_mj.cli.completion import completion  # all commands take their time to import

    sys.stdout.write(completion(shell))
    parser.exit(DONE)
