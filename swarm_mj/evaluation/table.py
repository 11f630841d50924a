"""Results on the terminal: one table per regime, the lowest age first."""

import io
import tomllib
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from swarm_mj.control.motion import Flocking
from swarm_mj.evaluation.results import CARRIES_MORE, Result, carries_more, config_of
from swarm_mj.mission.presets import paper
from swarm_mj.mission.specification import NOTHING, OPEN
from swarm_mj.protocol.packets import BITS_PER_BYTE
from swarm_mj.radio.words import bits_per_second

MIN_WIDTH = 100  # of a table; narrower consoles wrap its lines rather than cut numbers off
NAME_WIDTH = 17  # of a policy that fits in there; a longer path widens the table
NONE = "-"
LEGEND = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))


def results_text(results: Sequence[Result]) -> str:
    """Return the tables of `print_results` as plain text, for any terminal."""
    file = io.StringIO()
    print_results(results, file)
    return file.getvalue().rstrip()


def print_results(
    results: Sequence[Result], file: io.StringIO | None = None, *, is_wide: bool = False
) -> None:
    """Print a table per regime; a wide one has all columns. A file gets plain text."""
    how: dict[str, Any] = {"file": file, "force_terminal": None if file is None else False}
    how |= {"force_jupyter": False, "highlight": False, "markup": False}
    console = Console(**how)
    longest = max(len(line) for result in results for line in _name(result).splitlines())
    width = max(MIN_WIDTH + max(0, longest - NAME_WIDTH), console.width)
    wide = Console(width=width, **how)
    for regime, group in groupby(results, missions_of):
        of_regime = sorted(group, key=lambda result: result.aoi_mean)
        console.print(regime)
        wide.print(_table(of_regime, _cells if is_wide else _brief_cells))
        for line in _below(of_regime, is_wide=is_wide):
            console.print(line)
        console.print()
    console.print(" ".join(_legend(results, is_wide=is_wide)))


def missions_of(result: Result) -> str:
    """Return the missions that a result is of, in lines: results of others are not compared."""
    parts: dict[str, object] = {
        "radio": result.radio,
        "channel": result.channel,
        "controller": result.controller,
        "scene": result.scene,
        "bit rate": None if result.bit_rate is None else bits_per_second(result.bit_rate),
        "arena": None if result.arena == OPEN else result.arena,
        "prior knowledge": None if result.prior_knowledge == NOTHING else result.prior_knowledge,
    }
    own = "".join(f",\n{kind} {name}" for kind, name in parts.items() if name)
    fates = ", robots collide" if config_of(result).get("collide") else ""
    if result.failure_fraction:
        fates += f", {result.failure_fraction:.0%} of the robots off half-way"
    flown = f"{result.episodes} mission{'s' * (result.episodes != 1)} from seed {result.seed}"
    usual, moves = paper("stationary"), "\n"
    # At rest neither counts, but what was asked for tells missions apart.
    motion = (result.task, result.velocity_ratio, result.boundary)
    if motion != (usual.task, usual.velocity_ratio, usual.boundary):
        moves = f" velocity ratio {result.velocity_ratio:g},\nboundary {result.boundary}, "
    return (
        f"{result.task}, preset {result.preset}: {result.num_robots} robots, range ratio "
        f"{result.range_ratio:g},{moves}{result.num_windows} windows of {result.physics} "
        f"physics{fates}, {flown}{own}"
    )


def _table(results: Sequence[Result], cells_of: Callable[[Result], dict[str, str]]) -> Table:
    gap = 0 if cells_of is _cells else (0, 1)
    table = Table(box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=gap)
    table.add_column("policy", no_wrap=True)
    rows = [cells_of(result) for result in results]
    headings = list(rows[0])
    for heading in headings:
        table.add_column(heading, justify="right")
    for result, cells in zip(results, rows, strict=True):
        table.add_row(_name(result), *(cells.get(heading, NONE) for heading in headings))
    return table


def _brief_cells(result: Result) -> dict[str, str]:
    """Return the cells that most people read, in one line."""
    heard = result.heard_ratio if result.delivery_ratio is None else result.delivery_ratio
    mean, interval = _difference(result, "aoi").split("\n")
    own_cost = {}
    if _has_own_cost(result):
        own_cost["task cost ± SEM"] = _plus_minus(result.task_cost_mean, result.task_cost_sem)
    return {
        "AoI ± SEM": _plus_minus(result.aoi_mean, result.aoi_sem),
        f"minus {result.baseline}'s [95 %]": f"{mean} [{interval}]" if interval else mean,
        **own_cost,
        "heard": _number(heard, ".0%"),
    }


def _cells(result: Result) -> dict[str, str]:
    """Return a result's cells, of one or two lines, by the headings of their columns."""
    # Requests reach their addressee, broadcasts at least one robot.
    reached = result.heard_ratio if result.delivery_ratio is None else result.delivery_ratio
    mean = _plus_minus(result.aoi_mean, result.aoi_sem)
    cells = {
        "AoI ± SEM\n95 %": f"{mean}\n{_interval(result.aoi_ci_low, result.aoi_ci_high)}",
        "median\np95": f"{result.aoi_median:.2f}\n{result.aoi_p95:.2f}",
        "difference\n95 %": _difference(result, "aoi"),
        "packets\nreached": f"{result.packets_per_window:.2f}\n{_number(reached, '.0%')}",
        "hearers\nbytes": (
            f"{_number(result.hearers_per_packet)}\n{_number(result.packet_bytes, ',d')}"
        ),
    }
    published = _plus_minus(result.published_aoi_mean, result.published_aoi_sem)
    if _has_own_cost(result):
        whole = _plus_minus(result.task_cost_mean, result.task_cost_sem)
        last = _plus_minus(result.task_cost_last_mean, result.task_cost_last_sem)
        cells["task cost\nat the end"] = f"{whole}\n{last}"
        cells["difference\nof task cost"] = _difference(result, "task_cost")
    elif result.task == "flocking":
        variance = result.published_velocity_variance_mean
        cells["velocity\nvariance"] = f"{result.velocity_variance_mean:.4f}"
        cells["published\nAoI, var."] = (
            published if variance is None else f"{published}\n{variance:.4f}"
        )
    else:
        cells["published\nAoI"] = published
    return cells


def _number(value: float | None, form: str = ".2f") -> str:
    return NONE if value is None else format(value, form)


def _plus_minus(mean: float | None, sem: float | None) -> str:
    return _number(mean) if sem is None else f"{_number(mean)} ± {sem:.2f}"


def _interval(low: float | None, high: float | None) -> str:
    """Return both ends, or nothing where there is no interval."""
    return "" if low is None or high is None else f"{low:.2f}, {high:.2f}"


def _difference(result: Result, cost: str) -> str:
    mean, low, high = (
        getattr(result, f"{cost}_difference_{figure}") for figure in ("mean", "ci_low", "ci_high")
    )
    return f"{_number(mean)}\n{_interval(low, high)}"


def _has_own_cost(result: Result) -> bool:
    return result.task_cost_name not in (None, Flocking.cost_name)


def _name(result: Result) -> str:
    """Return a policy's name; below it its option, or the payload beyond T, M and P."""
    name = result.policy.replace(" --", "\n  --")
    return f"{name}\n  + {result.payload}" if carries_more(result) else name


def _below(results: Sequence[Result], *, is_wide: bool) -> Iterator[str]:
    sent = [
        f"{result.policy} {BITS_PER_BYTE * result.bytes_per_second / 1000.0:,.1f}"
        for result in results
        if result.bytes_per_second is not None
    ]
    if sent and is_wide:
        yield f"sent by the team [kbit/s]: {', '.join(sent)}"
    late = [f"{r.policy} {r.complete_share:.0%}" for r in results if r.complete_share < 0.5]
    if late:
        yield f"missions that ended with everyone having heard of everyone: {', '.join(late)}"
    # A flock's course depends on its policy, so each policy may have a bound of its own.
    bounds = [result.aoi_floor_mean for result in results if result.aoi_floor_mean is not None]
    low, high = f"{min(bounds, default=0):.2f}", f"{max(bounds, default=0):.2f}"
    if float(high) > 0.0:  # or it says nothing
        shown = low if low == high else f"{low} to {high}, by policy"
        yield f"lower bound (connectivity): {shown}"


def _legend(results: Sequence[Result], *, is_wide: bool) -> Iterator[str]:
    """Yield the meanings of the columns, a sentence each."""
    yield LEGEND["age"]
    yield LEGEND["wide" if is_wide else "brief"].format(results[0].baseline)
    costs = [f"{r.task_cost_name} [{r.task_cost_unit}]" for r in results if _has_own_cost(r)]
    yield from (LEGEND["task_cost"].format(cost) for cost in dict.fromkeys(costs))
    if is_wide and any(result.task == "flocking" for result in results):
        yield LEGEND["velocity_variance"]
    if is_wide and any(result.published_aoi_mean is not None for result in results):
        yield LEGEND["published"]
    if any(_number(result.aoi_floor_mean) not in (NONE, "0.00") for result in results):
        yield LEGEND["lower_bound"]
    if any(map(carries_more, results)):
        yield LEGEND["payload"].format(CARRIES_MORE)
