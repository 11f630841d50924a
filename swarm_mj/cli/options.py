"""Options that several commands share, and the mission they name."""

import argparse
import os
import shutil
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any, get_args

from swarm_mj.mission import PRESETS, Boundary, Mission, PhysicsMode, Task

DEFAULTS = Mission()


class _Formatter(argparse.ArgumentDefaultsHelpFormatter):
    """Shows a default where there is one to show."""

    def _get_help_string(self, action: argparse.Action) -> str | None:
        if action.default in (None, False):
            return action.help
        return super()._get_help_string(action)


def new_parser(commands: Any, name: str, summary: str, epilog: str = "") -> argparse.ArgumentParser:  # noqa: ANN401 - argparse names no public type
    """A command's parser: its summary as its help, defaults shown with every option."""
    return commands.add_parser(
        name,
        help=summary,
        description=summary,
        epilog=epilog,
        formatter_class=_Formatter,
    )


def this_command(name: str = "swarm-mj") -> str:
    """How the reader can call a program beside this Python: by name, or by path if it must be."""
    program = Path(sys.executable).with_name(name)
    found = shutil.which(name)
    if (found and Path(found) == program) or not program.exists():
        return name
    return os.path.relpath(program)


def add_mission_options(parser: argparse.ArgumentParser) -> None:
    """The options that make a mission."""
    group = parser.add_argument_group("mission")
    group.add_argument(
        "--task", default="flocking", help=f"what the robots do: {listed(get_args(Task))}"
    )
    group.add_argument(
        "--robots", type=int, default=DEFAULTS.num_robots, help="size of the team, 2 to 1000"
    )
    group.add_argument(
        "--velocity-ratio",
        type=float,
        default=DEFAULTS.velocity_ratio,
        help="largest velocity per axis, as the share of 1 km covered in 50 s (0.15 is 3 m/s), "
        "0.001 to 5",
    )
    group.add_argument(
        "--range-ratio",
        type=float,
        default=DEFAULTS.range_ratio,
        help="range of a packet in silence, as a share of 1 km, 0.01 to 10",
    )
    group.add_argument(
        "--windows",
        type=int,
        default=DEFAULTS.num_windows,
        help="length, in windows of 100 ms, 1 to 100000",
    )
    group.add_argument(
        "--preset",
        default="paper",
        help=f"{listed(PRESETS)}: the paper's text, or what its authors' code does",
    )
    group.add_argument(
        "--physics",
        default=DEFAULTS.physics,
        help=f"{listed(get_args(PhysicsMode))}: Eq. 15 to rounding error, or forces and bounces",
    )
    group.add_argument(
        "--boundary",
        default=DEFAULTS.boundary,
        help=f"{listed(get_args(Boundary))}; the paper's flocks fly out of the area: none",
    )
    group.add_argument(
        "--switched-off",
        type=float,
        default=DEFAULTS.switched_off,
        help="fraction of the robots that is switched off half-way, and nobody is told, 0 to 0.9",
    )


def mission_of(options: argparse.Namespace) -> Mission:
    """The mission that the options name.

    Raises:
        ValueError: A value is unknown or outside its range.
    """
    if options.preset not in PRESETS:
        raise ValueError(f"preset must be one of {listed(PRESETS)}, not {options.preset!r}")
    return PRESETS[options.preset](
        options.task,
        num_robots=options.robots,
        velocity_ratio=options.velocity_ratio,
        range_ratio=options.range_ratio,
        num_windows=options.windows,
        physics=options.physics,
        boundary=options.boundary,
        switched_off=options.switched_off,
    )


def listed(names: Iterable[str]) -> str:
    """Names in a row."""
    return ", ".join(names)
