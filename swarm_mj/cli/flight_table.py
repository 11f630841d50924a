"""The numbers of one flight: for the terminal and for `--json`."""

import argparse
import math
from dataclasses import asdict
from typing import Any

from rich.table import Table

from swarm_mj.rollout import Summary


def flight_numbers(summary: Summary) -> dict[str, Any]:
    """The summary of the one mission flown; what never happened is None."""
    numbers: dict[str, Any] = {}
    for name, value in asdict(summary).items():
        number = value if isinstance(value, int) else float(value[0])
        is_count = name.startswith("packets_") or name == "complete_window"
        if math.isnan(number):
            number = None
        numbers[name] = int(number) if is_count and number is not None else number
    return numbers


def _fates(numbers: dict[str, Any]) -> dict[str, str]:
    """What became of the packets: broadcasts are heard or not, addressed ones delivered or lost."""
    if numbers["packets_attempted"] is None:
        hearers = numbers["hearers_per_packet"]
        return {
            "  heard by somebody": f"{numbers['packets_heard']}",
            "  robots that heard a packet, mean": "-" if hearers is None else f"{hearers:.2f}",
        }
    return {
        "  delivered, lost": f"{numbers['packets_delivered']}, {numbers['packets_lost']}",
        "  answered": f"{numbers['packets_answered']}",
        "  overheard by others": f"{numbers['packets_overheard']}",
    }


def flight_table(options: argparse.Namespace, summary: Summary, wall_s: float) -> Table:
    """What the flight cost, as a table for the terminal."""
    numbers = flight_numbers(summary)
    team = f"{options.robots} robots"
    if options.switched_off:
        team += f", {options.switched_off:.0%} of them off half-way"
    table = Table(
        title=f"{options.task}, {options.policy}, {team}, seed {options.seed}",
        title_justify="left",
        show_header=False,
    )
    complete = numbers["complete_window"]
    rows = {
        "age of information, mean": f"{numbers['aoi_mean']:.2f} windows",
        "velocity variance, mean": f"{numbers['velocity_variance_mean']:.4f} m²/s²",
        "velocity variance, first to last": (
            f"{numbers['velocity_variance_first']:.4f} to "
            f"{numbers['velocity_variance_last']:.4f} m²/s²"
        ),
        "packets sent": f"{numbers['packets_sent']}",
        **_fates(numbers),
        "hops in the parent trees, mean": f"{numbers['hops_mean']:.2f}",
        "everyone had heard of everyone": f"window {complete}" if complete else "never",
        "windows flown": f"{summary.num_windows} in {wall_s:.2f} s",
    }
    for name, value in rows.items():
        table.add_row(name, value)
    return table
