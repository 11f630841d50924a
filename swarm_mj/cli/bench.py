"""`swarm-mj bench`: how fast the simulation is on this machine."""

import argparse
from typing import Any

from rich.console import Console
from rich.table import Table

from swarm_mj.bench import AUTHORS_WINDOWS_PER_S, Timing, bench
from swarm_mj.cli.options import new_parser

LIMITS = {"missions": 10_000, "threads": 256}


def add_parser(commands: Any) -> None:  # noqa: ANN401 - argparse names no public type
    """Adds the command."""
    parser = new_parser(
        commands, "bench", "Time the simulation: random walks of 40 robots with round robin."
    )
    parser.add_argument(
        "--missions",
        type=int,
        nargs="+",
        default=[1, 32, 256],
        help="how many missions stand side by side",
    )
    parser.add_argument("--threads", type=int, default=1, help="of MuJoCo")
    parser.add_argument("--seconds", type=float, default=2.0, help="per measurement, about")
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Runs the command; returns its exit code."""
    for name, values in (("missions", options.missions), ("threads", [options.threads])):
        for value in values:
            if not 1 <= value <= LIMITS[name]:
                raise ValueError(f"{name} must be from 1 to {LIMITS[name]}, not {value}")
    if not 0.1 <= options.seconds <= 600.0:
        raise ValueError(f"seconds must be from 0.1 to 600, not {options.seconds:g}")
    timings = []
    with Console(stderr=True).status("Measuring ...") as status:
        for num_missions in options.missions:
            status.update(f"Measuring {num_missions} missions side by side ...")
            timing = bench(num_missions, num_threads=options.threads, seconds=options.seconds)
            timings.append(timing)
    Console(highlight=False).print(_table(timings))
    return 0


def _table(timings: list[Timing]) -> Table:
    table = Table(title="Random walk of 40 robots, round robin", title_justify="left")
    table.add_column("missions side by side")
    for timing in timings:
        table.add_column(f"{timing.num_missions}", justify="right")
    table.add_row("windows per second", *(f"{t.windows_per_s:,.0f}" for t in timings))
    table.add_row(
        f"  of the authors' {AUTHORS_WINDOWS_PER_S:.0f}",
        *(f"{t.windows_per_s / AUTHORS_WINDOWS_PER_S:.1f} x" for t in timings),
    )
    table.add_row("one window, µs", *(f"{1e6 / t.windows_per_s:.2f}" for t in timings))
    table.add_row("  in plain mj_steps", *(f"{t.in_mj_steps:.2f} x" for t in timings))
    table.add_row("plain mj_step, µs", *(f"{t.mj_step_us:.2f}" for t in timings), end_section=True)
    for part in timings[0].parts_us:
        table.add_row(f"{part}, µs", *(f"{t.parts_us[part]:.2f}" for t in timings))
    return table
