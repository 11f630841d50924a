"""Results of the paper's figures as Markdown tables, ours with the published values beside them.

    python tools/results_table.py training/results/paper-*.csv

One table per file, task, preset, fraction switched off and cost: policies down, the swept number
across, mean ± standard error over missions, published values in brackets. A file of several bit
rates has one table per team size, with the rates across.
"""

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import mean

from swarm_mj.cli import script
from swarm_mj.evaluation.published import SWEEPS
from swarm_mj.evaluation.results import CARRIES_MORE, Result, carries_more, read_results
from swarm_mj.mission.presets import bits_per_second
from swarm_mj.system.fields import setting

COSTS = {
    "aoi": ("age of information [windows]", 1),
    "velocity_variance": ("velocity variance [m²/s²]", 3),
}


def table(results: Sequence[Result], cost: str) -> str:
    """Return the table of one cost of one task and preset.

    Args:
        results: Of one task and preset, and one fraction of robots switched off.
        cost: `aoi` or `velocity_variance`.

    Returns:
        Markdown; the policies of least cost first.
    """
    swept = "bit_rate" if _is_by_rate(results) else SWEEPS[results[0].task].x_name
    xs = sorted({getattr(result, swept) for result in results}, key=_place)
    if len({(result.policy, getattr(result, swept)) for result in results}) < len(results):
        raise ValueError(f"results must have each policy once at each {swept}")
    cells = {(result.policy, getattr(result, swept)): _cell(result, cost) for result in results}
    policies = sorted(
        {result.policy for result in results},
        key=lambda policy: mean(
            getattr(result, f"{cost}_mean") for result in results if result.policy == policy
        ),
    )
    label, _ = COSTS[cost]
    rows = [
        [f"{swept.replace('_', ' ')}, {label}", *(_shown(swept, x) for x in xs)],
        ["---"] * (len(xs) + 1),
        *(
            [_name(policy, results), *(cells.get((policy, x), "") for x in xs)]
            for policy in policies
        ),
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)


def _is_by_rate(results: Sequence[Result]) -> bool:
    """Return whether the bit rate was swept."""
    return len({result.bit_rate for result in results}) > 1


def _place(x: float | None) -> float:
    """Return where a column stands; no limit comes last."""
    return math.inf if x is None else x


def _shown(swept: str, x: float | None) -> str:
    """Return a column's head."""
    if x is None:
        return "no limit"
    return bits_per_second(x) if swept == "bit_rate" else f"{x:g}"


def _name(policy: str, results: Sequence[Result]) -> str:
    """Return a policy's name, and whether its packets carry more than the paper's."""
    more = any(carries_more(result) for result in results if result.policy == policy)
    return f"{policy} (packets {CARRIES_MORE})" if more else policy


def _cell(result: Result, cost: str) -> str:
    """Return our value, and the published one in brackets if there is one."""
    _, digits = COSTS[cost]
    ours = _plus_minus(result, cost, digits)
    published = _plus_minus(result, f"published_{cost}", digits)
    return f"{ours} ({published})" if published else ours


def _plus_minus(result: Result, name: str, digits: int) -> str:
    value, sem = getattr(result, f"{name}_mean"), getattr(result, f"{name}_sem")
    if value is None:
        return ""
    return f"{value:.{digits}f}" if sem is None else f"{value:.{digits}f} ± {sem:.{digits}f}"


def _kind(result: Result, *, is_by_rate: bool) -> tuple[str, ...]:
    """Return what distinguishes tables, in words."""
    fate = (
        [f"{result.failure_fraction:.0%} of the robots off half-way"]
        if result.failure_fraction
        else []
    )
    team = [f"{result.num_robots} robots"] if is_by_rate else []
    return (result.task, f"preset {result.preset}", *team, *fate)


@dataclass(frozen=True, kw_only=True)
class Options:
    """The files that are shown."""

    files: tuple[Path, ...] = setting(
        help="made by swarm-mj evaluate --csv", metavar="RESULTS.csv", is_positional=True
    )


def run(options: Options) -> int:
    """Print the tables; return the exit code."""
    for path in options.files:
        results = read_results(path)
        kinds = [_kind(result, is_by_rate=_is_by_rate(results)) for result in results]
        for kind in sorted(set(kinds)):
            own = [result for result, its in zip(results, kinds, strict=True) if its == kind]
            for cost in COSTS if own[0].task == "flocking" else ["aoi"]:
                print(f"{', '.join(kind)}\n\n{table(own, cost)}\n")
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the tool; return its exit code."""
    return script(Options, run, arguments)


if __name__ == "__main__":
    sys.exit(main())
