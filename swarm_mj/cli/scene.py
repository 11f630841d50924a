"""`swarm-mj scene`: writes the composed MJCF model."""

import argparse
import shlex
from pathlib import Path
from typing import Any

from rich.console import Console

from swarm_mj.cli.options import add_mission_options, mission_of, new_parser, this_command
from swarm_mj.cli.outputs import check_writable
from swarm_mj.io.atomic_file import atomic_write
from swarm_mj.physics.scene import compose
from swarm_mj.swarm import Swarm


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(commands, "scene", "Write the scene of a mission as one MJCF file.")
    add_mission_options(parser)
    parser.add_argument("--seed", type=int, default=1, help="of the mission whose start is shown")
    parser.add_argument("--out", type=Path, default=Path("scene.xml"), help="the file to write")
    parser.add_argument("--force", action="store_true", help="replace an existing file")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    mission = mission_of(options)
    check_writable(options.out, "scene", must_be_new=not options.force)
    spec = compose(mission, start=Swarm(mission, [options.seed]).states)
    spec.compile()
    with atomic_write(options.out) as part:
        part.write_text(spec.to_xml(), encoding="utf-8")
    console = Console(highlight=False, soft_wrap=True, markup=False)
    side = f"{mission.side_m:.0f} m"
    console.print(f"Wrote {options.out}: {mission.num_robots} robots on {side} by {side}")
    file = shlex.quote(str(options.out))
    console.print("The viewer opens on their start; Load key also gives them their velocities.")
    console.print(f"Open it:  {this_command('python')} -m mujoco.viewer --mjcf={file}")
    return 0
