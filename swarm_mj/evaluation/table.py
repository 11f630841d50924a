"""Results on the terminal: one table per regime, the freshest knowledge first."""

import io
from collections.abc import Callable, Sequence
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
    """What `print_results` prints, as plain text, whatever the terminal and its variables say."""
    file = io.StringIO()
    print_results(results, file=file, force_terminal=False)
    return file.getvalue().rstrip()


def print_results(results: Sequence[Result], **where: Any) -> None:
    """Print a table per regime; results of a regime stand together.

    Args:
        results: One or more.
        **where: Arguments of the console that prints; usually none.
    """
    how: dict[str, Any] = {"highlight": False, "markup": False, "force_jupyter": False, **where}
    console = Console(**how)
    longest = max(len(line) for result in results for line in _name(result).splitlines())
    width = max(MIN_WIDTH + max(0, longest - NAME_WIDTH), console.width)
    wide = Console(**how, width=width)
    for regime, group in groupby(results, _regime):
        of_regime = sorted(group, key=lambda result: result.aoi_mean)
        console.print(regime)
        wide.print(_table(of_regime))
        for line in (*_sent(of_regime), *_bound(of_regime)):
            console.print(line)
        console.print()
    console.print(_legend(results))


def _regime(result: Result) -> str:
    """Return a table's title."""
    parts = {name: getattr(result, name) for name in ("radio", "channel", "controller", "scene")}
    rate = result.bit_rate
    parts |= {"bit rate": bits_per_second(rate)} if rate is not None else {}
    parts |= {"arena": result.arena} if result.arena != OPEN else {}
    parts |= {"known": result.known} if result.known != NOTHING else {}
    own = "".join(f",\n{kind} {name}" for kind, name in parts.items() if name)
    fate = f", {result.switched_off:.0%} of the robots off half-way" if result.switched_off else ""
    return (
        f"{result.task}, preset {result.preset}: {result.num_robots} robots, range ratio "
        f"{result.range_ratio:g}, velocity ratio {result.velocity_ratio:g},\nboundary "
        f"{result.boundary}, {result.num_windows} windows of {result.physics} physics{fate}{own}"
    )


def _table(results: Sequence[Result]) -> Table:
    """Two lines a policy."""
    columns = COLUMNS | _columns_of(results[0])
    table = Table(box=SIMPLE_HEAD, show_edge=False, padding=0)
    table.add_column("policy", no_wrap=True)
    for name in columns:
        table.add_column(name, justify="right")
    for result in results:
        table.add_row(_name(result), *(cell(result) for cell in columns.values()))
    return table


COLUMNS: dict[str, Callable[[Result], str]] = {
    "AoI ± SEM\n95 %": lambda r: (
        f"{_with_error(r.aoi_mean, r.aoi_sem)}\n{_interval(r.aoi_ci_low, r.aoi_ci_high)}"
    ),
    "median\np95": lambda r: f"{_number(r.aoi_median)}\n{_number(r.aoi_p95)}",
    "difference\n95 %": lambda r: (
        f"{_number(r.aoi_difference_mean)}\n"
        f"{_interval(r.aoi_difference_ci_low, r.aoi_difference_ci_high)}"
    ),
    "packets\nreached": lambda r: f"{_number(r.packets_per_window)}\n{_number(_reached(r), '.0%')}",
    "hearers\nbytes": lambda r: f"{_number(r.hearers_per_packet)}\n{_number(r.packet_bytes, ',d')}",
}


def _columns_of(result: Result) -> dict[str, Callable[[Result], str]]:
    """Return a task's own columns: what it costs, if anything, or else what the paper says."""
    if _has_own_cost(result):
        return {
            "task cost\nat the end": lambda r: (
                f"{_with_error(r.task_cost_mean, r.task_cost_sem)}\n"
                f"{_with_error(r.task_cost_last_mean, r.task_cost_last_sem)}"
            ),
            "difference\nof task cost": lambda r: (
                f"{_number(r.task_cost_difference_mean)}\n"
                f"{_interval(r.task_cost_difference_ci_low, r.task_cost_difference_ci_high)}"
            ),
        }
    if result.task == "flocking":
        return {
            "velocity\nvariance": lambda r: _number(r.velocity_variance_mean, ".4f"),
            "published\nAoI, var.": _published,
        }
    return {"published\nAoI": _published}


def _has_own_cost(result: Result) -> bool:
    """Whether the task costs something else than the paper's velocity variance."""
    return result.task_cost_name not in (None, Flocking.cost_name)


def _name(result: Result) -> str:
    """Return a policy's name; below it its option, or what its packets carry beyond T, M and P."""
    name = result.policy.replace(" --", "\n  --")
    return f"{name}\n  + {result.payload}" if carries_more(result) else name


def _reached(result: Result) -> float | None:
    """Return the share of packets that reached whom they were meant for; of broadcasts, anyone."""
    return result.heard_ratio if result.delivery_ratio is None else result.delivery_ratio


def _sent(results: Sequence[Result]) -> list[str]:
    """What each team sends in a second, where that is known."""
    told = [
        f"{result.policy} {BITS_PER_BYTE * result.bytes_per_second / 1000.0:,.1f}"
        for result in results
        if result.bytes_per_second is not None
    ]
    return [f"sent by the team [kbit/s]: {', '.join(told)}"] if told else []


def _published(result: Result) -> str:
    """Return the paper's age and, of flocks, its velocity variance below."""
    age = _with_error(result.published_aoi_mean, result.published_aoi_sem)
    if result.published_velocity_variance_mean is None:
        return age
    return f"{age}\n{_number(result.published_velocity_variance_mean, '.4f')}"


def _bound(results: Sequence[Result]) -> list[str]:
    """The lower bound, if known; flocks fly as they are told, so each policy may have its own."""
    bounds = [result.aoi_floor_mean for result in results if result.aoi_floor_mean is not None]
    if not bounds:
        return []
    low, high = f"{min(bounds):.2f}", f"{max(bounds):.2f}"
    return [
        f"lower bound (connectivity): {low}" + (f" to {high}, by policy" if low != high else "")
    ]


def _legend(results: Sequence[Result]) -> str:
    """What the columns mean, a sentence each."""
    first = results[0]
    sentences = [
        "AoI: age of information, how old a robot's news of another is [windows]; mean over "
        f"{first.episodes} missions from seed {first.seed}, standard error and 95 % interval.",
        "Median and p95 are over missions.",
        f"Difference: AoI minus that of {first.baseline}, mission by mission.",
        "Packets: sent in a window, and the share that reached its addressee or, of broadcasts, "
        "at least one robot; hearers: robots that decoded a broadcast, on average.",
        "Bytes: of a packet.",
    ]
    for result in filter(_has_own_cost, results):
        named = f"{result.task_cost_name} [{result.task_cost_unit}]"
        cost = f"Task cost: {named}, mean over windows ± standard error over missions."
        sentences += [] if cost in sentences else [cost]
    if any(result.task == "flocking" for result in results):
        sentences.append("Velocity variance (var.): of the robots' velocities [m²/s²].")
    if any(result.published_aoi_mean is not None for result in results):
        sentences.append("Published: by the paper.")
    if any(result.aoi_floor_mean is not None for result in results):
        sentences.append(
            "Lower bound: the AoI if all robots with a path between them shared everything at once."
        )
    if any(carries_more(result) for result in results):
        sentences.append(f"+: packets {CARRIES_MORE}, which the paper's carry.")
    return " ".join(sentences)


def _number(value: float | int | None, form: str = ".2f") -> str:
    return NONE if value is None else format(value, form)


def _with_error(mean: float | None, sem: float | None) -> str:
    return _number(mean) if sem is None else f"{_number(mean)} ± {sem:.2f}"


def _interval(low: float | None, high: float | None) -> str:
    return "" if low is None else f"{low:.2f}, {_number(high)}"
