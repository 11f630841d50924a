"""Results on the terminal: one table per regime, the lowest age first."""

import io
import re
from collections.abc import Iterator, Sequence
from itertools import groupby
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from swarm_mj.control.motion import Flocking
from swarm_mj.evaluation.results import CARRIES_MORE, Result, carries_more
from swarm_mj.mission.specification import NOTHING, OPEN
from swarm_mj.protocol.packets import BITS_PER_BYTE, bits_per_second

MIN_WIDTH = 100  # of a table; narrower consoles wrap its lines rather than cut numbers off
NAME_WIDTH = 17  # of a policy that fits in there; a longer directory's name widens the table
NONE = "-"


def results_text(results: Sequence[Result]) -> str:
    """Return the tables of `print_results` as plain text, for any terminal."""
    file = io.StringIO()
    print_results(results, file=file, force_terminal=False)
    return file.getvalue().rstrip()


def print_results(results: Sequence[Result], **where: Any) -> None:
    """Print a table per regime, whose results stand together, on a console made of `where`."""
    how: dict[str, Any] = {"highlight": False, "markup": False, "force_jupyter": False, **where}
    console = Console(**how)
    longest = max(len(line) for result in results for line in _name(result).splitlines())
    width = max(MIN_WIDTH + max(0, longest - NAME_WIDTH), console.width)
    wide = Console(**how, width=width)
    for regime, group in groupby(results, _regime):
        of_regime = sorted(group, key=lambda result: result.aoi_mean)
        console.print(regime)
        wide.print(_table(of_regime))
        for line in _below(of_regime):
            console.print(line)
        console.print()
    console.print(" ".join(_legend(results)))


def _regime(result: Result) -> str:
    parts: dict[str, object] = {
        "radio": result.radio,
        "channel": result.channel,
        "controller": result.controller,
        "scene": result.scene,
        "bit rate": None if result.bit_rate is None else bits_per_second(result.bit_rate),
        "arena": None if result.arena == OPEN else result.arena,
        "known": None if result.prior_knowledge == NOTHING else result.prior_knowledge,
    }
    own = "".join(f",\n{kind} {name}" for kind, name in parts.items() if name)
    failing = result.failure_fraction
    fate = f", {failing:.0%} of the robots off half-way" if failing else ""
    return (
        f"{result.task}, preset {result.preset}: {result.num_robots} robots, range ratio "
        f"{result.range_ratio:g}, velocity ratio {result.velocity_ratio:g},\nboundary "
        f"{result.boundary}, {result.num_windows} windows of {result.physics} physics{fate}{own}"
    )


# Forms of cells by their columns' headings: a number that does not exist is a dash, and a part in
# angle brackets is left out with it. `reached` is of packets, or of broadcasts at least one robot.
COLUMNS = {
    "AoI ± SEM\n95 %": "{aoi_mean:.2f}< ± {aoi_sem:.2f}>\n<{aoi_ci_low:.2f}, {aoi_ci_high:.2f}>",
    "median\np95": "{aoi_median:.2f}\n{aoi_p95:.2f}",
    "difference\n95 %": (
        "{aoi_difference_mean:.2f}\n<{aoi_difference_ci_low:.2f}, {aoi_difference_ci_high:.2f}>"
    ),
    "packets\nreached": "{packets_per_window:.2f}\n{reached:.0%}",
    "hearers\nbytes": "{hearers_per_packet:.2f}\n{packet_bytes:,d}",
}
OF_COSTED = {
    "task cost\nat the end": (
        "{task_cost_mean:.2f}< ± {task_cost_sem:.2f}>\n"
        "{task_cost_last_mean:.2f}< ± {task_cost_last_sem:.2f}>"
    ),
    "difference\nof task cost": (
        "{task_cost_difference_mean:.2f}\n"
        "<{task_cost_difference_ci_low:.2f}, {task_cost_difference_ci_high:.2f}>"
    ),
}
PUBLISHED = "{published_aoi_mean:.2f}< ± {published_aoi_sem:.2f}>"
OF_FLOCKS = {
    "velocity\nvariance": "{velocity_variance_mean:.4f}",
    "published\nAoI, var.": PUBLISHED + "<\n{published_velocity_variance_mean:.4f}>",
}
OF_OTHERS = {"published\nAoI": PUBLISHED}


def _table(results: Sequence[Result]) -> Table:
    of_task = OF_FLOCKS if results[0].task == "flocking" else OF_OTHERS
    columns = COLUMNS | (OF_COSTED if _has_own_cost(results[0]) else of_task)
    table = Table(box=SIMPLE_HEAD, show_edge=False, padding=0)
    table.add_column("policy", no_wrap=True)
    for name in columns:
        table.add_column(name, justify="right")
    for result in results:
        table.add_row(_name(result), *(_cell(form, result) for form in columns.values()))
    return table


def _cell(form: str, result: Result) -> str:
    reached = result.heard_ratio if result.delivery_ratio is None else result.delivery_ratio
    numbers = {**vars(result), "reached": reached}

    def optional(part: re.Match[str]) -> str:
        """Return a part of the form, or nothing if a number in it is missing."""
        names = re.findall(r"{(\w+):", part[1])
        return "" if any(numbers[name] is None for name in names) else part[1]

    def number(field: re.Match[str]) -> str:
        """Return a number in its format."""
        value = numbers[field[1]]
        return NONE if value is None else format(value, field[2])

    return re.sub(r"{(\w+):([^}]+)}", number, re.sub(r"<(.+?)>", optional, form, flags=re.DOTALL))


def _has_own_cost(result: Result) -> bool:
    return result.task_cost_name not in (None, Flocking.cost_name)


def _name(result: Result) -> str:
    """Return a policy's name; below it its option, or the payload beyond T, M and P."""
    name = result.policy.replace(" --", "\n  --")
    return f"{name}\n  + {result.payload}" if carries_more(result) else name


def _below(results: Sequence[Result]) -> Iterator[str]:
    sent = [
        f"{result.policy} {BITS_PER_BYTE * result.bytes_per_second / 1000.0:,.1f}"
        for result in results
        if result.bytes_per_second is not None
    ]
    if sent:
        yield f"sent by the team [kbit/s]: {', '.join(sent)}"
    # A flock's course depends on its policy, so each policy may have a bound of its own.
    bounds = [result.aoi_floor_mean for result in results if result.aoi_floor_mean is not None]
    if bounds:
        low, high = f"{min(bounds):.2f}", f"{max(bounds):.2f}"
        shown = low if low == high else f"{low} to {high}, by policy"
        yield f"lower bound (connectivity): {shown}"


def _legend(results: Sequence[Result]) -> Iterator[str]:
    """Yield the meanings of the columns, a sentence each."""
    first = results[0]
    yield (
        "AoI: age of information, how old a robot's news of another is [windows]; mean over "
        f"{first.episodes} missions from seed {first.seed}, standard error and 95 % interval. "
        "Median and p95 are over missions. "
        f"Difference: AoI minus that of {first.baseline}, mission by mission. "
        "Packets: sent in a window, and the share that reached its addressee or, of broadcasts, "
        "at least one robot; hearers: robots that decoded a broadcast, on average. "
        "Bytes: of a packet."
    )
    costs = [f"{r.task_cost_name} [{r.task_cost_unit}]" for r in results if _has_own_cost(r)]
    for cost in dict.fromkeys(costs):
        yield f"Task cost: {cost}, mean over windows ± standard error over missions."
    if any(result.task == "flocking" for result in results):
        yield "Velocity variance (var.): of the robots' velocities [m²/s²]."
    if any(result.published_aoi_mean is not None for result in results):
        yield "Published: by the paper."
    if any(result.aoi_floor_mean is not None for result in results):
        yield "Lower bound: the AoI if all robots with a path between them shared everything at"
        yield "once."
    if any(map(carries_more, results)):
        yield f"+: packets {CARRIES_MORE}, which the paper's carry."
