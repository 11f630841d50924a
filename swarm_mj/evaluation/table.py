"""Results on the terminal: one table per regime, the lowest age first."""

import io
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import groupby

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from swarm_mj.evaluation.results import (
    LARGER_PACKETS,
    Result,
    carries_more,
    config_of,
    has_memory,
    mission_field,
)
from swarm_mj.evaluation.table_columns import BRIEF, NONE, WIDE, Shown, number, said
from swarm_mj.mission import Mission
from swarm_mj.mission.bodies import POINT
from swarm_mj.mission.knowledge import NOTHING
from swarm_mj.mission.presets import paper
from swarm_mj.mission.surroundings import OPEN
from swarm_mj.mission.words import bodies_in_words
from swarm_mj.protocol.packets import BITS_PER_BYTE
from swarm_mj.radio.words import bits_per_second
from swarm_mj.system.shares import percent

MIN_WIDTH = 100  # of a table; narrower consoles wrap its lines rather than cut numbers off
NAME_WIDTH = 17  # of a policy that fits in there; a longer path widens the table


def results_text(results: Sequence[Result]) -> str:
    """Return the tables of `print_results` as plain text, for any terminal."""
    file = io.StringIO()
    print_results(results, file)
    return file.getvalue().rstrip()


def print_results(
    results: Sequence[Result], file: io.StringIO | None = None, *, is_wide: bool = False
) -> None:
    """Print a table for each regime, the lowest age first, and what its columns mean.

    Args:
        results: Those of a regime follow each other.
        file: Gets plain text; None is the terminal.
        is_wide: Whether to print all columns, and not only what most people read.
    """
    console_of_width = partial(
        Console,
        file=file,
        force_terminal=None if file is None else False,  # None: rich finds out
        force_jupyter=False,
        # Names and numbers stay as they are, even where they look like rich's markup.
        highlight=False,
        markup=False,
    )
    console = console_of_width()
    longest = 0
    for result in results:
        for line in _name(result).splitlines():
            longest = max(longest, len(line))
    width = max(MIN_WIDTH + max(0, longest - NAME_WIDTH), console.width)
    wide = console_of_width(width=width)
    columns = WIDE if is_wide else BRIEF
    for regime, group in groupby(results, missions_title):
        of_regime = sorted(group, key=lambda result: result.aoi_mean)
        console.print(regime)
        # The wide table just fits, without spaces between its columns.
        wide.print(_table(of_regime, columns, gap=0 if is_wide else 1))
        for line in _below(of_regime, is_wide=is_wide):
            console.print(line)
        console.print()
    console.print(" ".join(_legend(results, columns)))


def missions_title(result: Result) -> str:
    """Return the missions that a result is of, in lines: results of others are not compared."""
    parts = {
        "density": _density(result),
        "radio": result.radio,
        "channel": result.channel,
        "controller": result.controller,
        "scene": result.scene,
        "pilot": result.pilot,
        "robot": None if result.robot == POINT else _bodies(result),
        "bit rate": None if result.bit_rate is None else bits_per_second(result.bit_rate),
        "arena": None if result.arena == OPEN else result.arena,
        "prior knowledge": None if result.prior_knowledge == NOTHING else result.prior_knowledge,
    }
    own = ""
    for kind, name in parts.items():
        if name:
            own += f",\n{kind} {name}"
    fates = ""
    if mission_field(result, "collide"):
        fates += ", robots collide"
    if result.failure_fraction:
        fates += f", {result.failure_fraction:.0%} of the robots off half-way"
    missions = "1 mission" if result.episodes == 1 else f"{result.episodes} missions"
    usual = paper("stationary")
    # At rest neither counts, but what was asked for tells missions apart.
    is_usual = (
        result.task == usual.task
        and result.velocity_ratio == usual.velocity_ratio
        and result.boundary == usual.boundary
    )
    moves = "\n"
    if not is_usual:
        moves = f" velocity ratio {result.velocity_ratio:g},\nboundary {result.boundary}, "
    return (
        f"{result.task}, preset {result.preset}: {result.num_robots} robots, range ratio "
        f"{result.range_ratio:g},{moves}{result.num_windows} windows of {result.physics} "
        f"physics{fates}, {missions} from seed {result.seed}{own}"
    )


def _density(result: Result) -> str | None:
    """Return how densely robots are spread, in words; None where it is the paper's."""
    per_km2 = mission_field(result, "density_per_km2")
    return None if per_km2 in (None, Mission().density_per_km2) else f"{per_km2:g}/km²"


def _bodies(result: Result) -> str:
    """Return the robots' kind, how high they fly, and the wind, in words."""
    return ", ".join([result.robot, *bodies_in_words(result.robot, config_of(result))])


def _table(results: Sequence[Result], columns: Sequence[Shown], *, gap: int) -> Table:
    """Return the table of a regime, whose first result decides which columns there are."""
    table = Table(
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, gap),
        collapse_padding=True,
    )
    table.add_column("policy", no_wrap=True)
    shown = [column for column in columns if _applies(column, results[0])]
    for column in shown:
        table.add_column(said(column.heading, results[0]), justify="right")
    for result in results:
        cells = [column.cell(result) if _applies(column, result) else NONE for column in shown]
        table.add_row(_name(result), *cells)
    return table


def _applies(column: Shown, result: Result) -> bool:
    return column.applies is None or column.applies(result)


def _name(result: Result) -> str:
    """Return a policy's name; below it its option, or what it has beyond the paper's policies."""
    name = result.policy.replace(" --", "\n  --")
    if has_memory(result):
        name = f"{name}\n  + memory"
    return f"{name}\n  + {result.payload}" if carries_more(result) else name


def _below(results: Sequence[Result], *, is_wide: bool) -> Iterator[str]:
    """Yield the lines below a regime's table: what is of few policies, or the same for most."""
    sent: list[str] = []
    late: list[str] = []
    bounds: list[float] = []  # [windows]
    for result in results:
        if result.bytes_per_second is not None:  # older files do not say
            kbit_per_s = BITS_PER_BYTE * result.bytes_per_second / 1000.0
            sent.append(f"{result.policy} {kbit_per_s:,.1f}")
        if result.complete_share < 0.5:
            late.append(f"{result.policy} {percent(result.complete_share)}")
        if result.aoi_floor_mean is not None:
            bounds.append(result.aoi_floor_mean)
    if sent and is_wide:
        yield f"sent by the team [kbit/s]: {', '.join(sent)}"
    if late:
        yield f"missions that ended with everyone having heard of everyone: {', '.join(late)}"
    # A flock's course depends on its policy, so each policy may have a bound of its own.
    low = f"{min(bounds, default=0.0):.2f}"
    high = f"{max(bounds, default=0.0):.2f}"
    if float(high) > 0.0:  # a bound of 0 says nothing
        shown = low if low == high else f"{low} to {high}, by policy"
        yield f"lower bound (connectivity): {shown}"


def _legend(results: Sequence[Result], columns: Sequence[Shown]) -> Iterator[str]:
    """Yield the meanings of the columns, a sentence each or more; then of what stands below."""
    for column in columns:
        if column.applies is None:
            yield said(column.meaning, results[0])
    for column in columns:
        if column.applies is not None:
            # Each sentence once, in the order of the results that have such a column.
            having = [result for result in results if _applies(column, result)]
            meanings = dict.fromkeys(said(column.meaning, result) for result in having)
            yield from filter(None, meanings)
    if any(number(result.aoi_floor_mean) not in (NONE, "0.00") for result in results):
        yield (
            "Lower bound: the AoI if all robots with a path between them shared everything at once."
        )
    if any(map(carries_more, results)):
        yield f"+: {LARGER_PACKETS} than the paper's."
    if any(map(has_memory, results)):
        yield "+ memory: robots also decide by earlier windows, which the paper's do not."
