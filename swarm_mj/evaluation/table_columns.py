"""The columns that tables of results print, and what is said of them below.

A table has more room for some readers than for others: `BRIEF` is what most of them read, `WIDE`
what `--wide` shows. A new entry prints another column of `Result`.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from swarm_mj.evaluation.results import Result, has_own_cost, is_flock
from swarm_mj.protocol.mission_costs import AOI, VELOCITY_VARIANCE
from swarm_mj.system.shares import percent

NONE = "-"  # a cell of what does not exist
# All samples are on one side of the truth with a probability of 2^(1 - n), so no interval between
# them holds it in 95 % of cases with fewer.
FEWEST_FOR_INTERVALS = 6
VARIANCE_FORM = f".{VELOCITY_VARIANCE.digits}f"
Text = str | Callable[[Result], str]  # the same of every result, or not


@dataclass(frozen=True, kw_only=True)
class Shown:
    """A column of printed tables. Headings and cells have up to two lines.

    `meaning` is a sentence below the tables, or more of them; empty where none is needed. It is of
    the first result if every table has the column. If `applies` tells which do, it may differ from
    result to result, and comes after the others.
    """

    heading: Text
    cell: Callable[[Result], str]
    meaning: Text
    applies: Callable[[Result], bool] | None = None  # None: to every result


def said(text: Text, result: Result) -> str:
    """Return a text, as it is of a result."""
    return text if isinstance(text, str) else text(result)


def number(value: float | None, form: str = ".2f") -> str:
    """Return a cell's number."""
    return NONE if value is None else format(value, form)


def plus_minus(mean: float | None, sem: float | None) -> str:
    """Return a mean and its standard error, if there is one."""
    return number(mean) if sem is None else f"{number(mean)} ± {sem:.2f}"


def interval(low: float | None, high: float | None) -> str:
    """Return both ends, or nothing where there is no interval."""
    return "" if low is None or high is None else f"{low:.2f}, {high:.2f}"


def _reached(result: Result) -> str:
    """Return the share of requests that reached their addressee, of broadcasts anybody."""
    reached = result.heard_ratio if result.delivery_ratio is None else result.delivery_ratio
    return NONE if reached is None else percent(reached)


def _difference(result: Result) -> str:
    ends = interval(result.aoi_difference_ci_low, result.aoi_difference_ci_high)
    return f"{number(result.aoi_difference_mean)}\n{ends}"


def _difference_in_a_line(result: Result) -> str:
    ends = interval(result.aoi_difference_ci_low, result.aoi_difference_ci_high)
    mean = number(result.aoi_difference_mean)
    return f"{mean} [{ends}]" if ends else mean


def _with_note(meaning: str, result: Result) -> str:
    """Return what a column with intervals means; say where missions are too few for them."""
    if result.episodes >= FEWEST_FOR_INTERVALS:
        return meaning
    return f"{meaning} With under {FEWEST_FOR_INTERVALS} missions, these are too narrow."


def _complete(result: Result) -> str:
    return percent(result.complete_share)


def _agreed(result: Result) -> str:
    """Return the share of flocks that agreed and, if half did, by when in the median."""
    share = NONE if result.agreed_share is None else percent(result.agreed_share)
    median = result.agreed_window_median
    return share if median is None else f"{share}, {median:.0f}"


def _task_cost(result: Result) -> str:
    return plus_minus(result.task_cost_mean, result.task_cost_sem)


def _task_cost_at_the_end(result: Result) -> str:
    return plus_minus(result.task_cost_last_mean, result.task_cost_last_sem)


def _task_cost_difference(result: Result) -> str:
    ends = interval(result.task_cost_difference_ci_low, result.task_cost_difference_ci_high)
    return f"{number(result.task_cost_difference_mean)}\n{ends}"


def _task_cost_meaning(result: Result) -> str:
    if not has_own_cost(result):
        return ""
    cost = f"{result.task_cost_name} [{result.task_cost_unit}]"
    return f"Task cost: {cost}, mean over windows ± standard error over missions."


def _shows_variance(result: Result) -> bool:
    return is_flock(result) and not has_own_cost(result)


def _variance_meaning(result: Result) -> str:
    if not is_flock(result):
        return ""
    cost = VELOCITY_VARIANCE
    variance = f"{cost.title.capitalize()} (var.): of the robots' velocities [{cost.unit}]."
    return f"{variance} {AGREED_MEANING}"


def _published(result: Result) -> str:
    age = plus_minus(result.published_aoi_mean, result.published_aoi_sem)
    variance = result.published_velocity_variance_mean
    if variance is None or not is_flock(result):
        return age
    return f"{age}\n{number(variance, VARIANCE_FORM)}"


def _published_meaning(result: Result) -> str:
    return "" if result.published_aoi_mean is None else "Published: by the paper."


AGE_MEANING = (
    f"AoI: {AOI.title}, how old a robot's news of another is [{AOI.unit}]; mean over the missions,"
)

AGREED_MEANING = (
    "Agreed: flocks that ended with under 1% of their first variance, and the median window from "
    "which they had."
)
COMPLETE_MEANING = "All: missions that ended with everyone having heard of everyone."

# What most people read, in one line.
BRIEF = (
    Shown(
        heading="AoI ± SEM",
        cell=lambda result: plus_minus(result.aoi_mean, result.aoi_sem),
        meaning=f"{AGE_MEANING} with its standard error.",
    ),
    Shown(
        heading="median, p95",
        cell=lambda result: f"{result.aoi_median:.1f}, {result.aoi_p95:.1f}",
        meaning="Median and 95th percentile (p95) are over missions: means hide their tail.",
    ),
    Shown(
        heading="all",
        cell=_complete,
        meaning=COMPLETE_MEANING,
    ),
    Shown(
        heading=lambda result: f"minus {result.baseline}'s [95 %]",
        cell=_difference_in_a_line,
        meaning=partial(_with_note, "Differences are mission by mission, with 95 % intervals."),
    ),
    Shown(
        heading="task cost ± SEM",
        cell=_task_cost,
        meaning=_task_cost_meaning,
        applies=has_own_cost,
    ),
    Shown(
        heading="agreed",
        cell=_agreed,
        meaning=AGREED_MEANING,
        applies=_shows_variance,
    ),
    Shown(
        heading="heard",
        cell=_reached,
        meaning=(
            "Heard: packets that reached their addressee or, of broadcasts, at least one robot."
        ),
        # Both would not fit into 80 characters; `--wide` has it of flocks, too.
        applies=lambda result: not _shows_variance(result),
    ),
)

# What `--wide` shows.
WIDE = (
    Shown(
        heading="AoI ± SEM\n95 %",
        cell=lambda result: (
            f"{plus_minus(result.aoi_mean, result.aoi_sem)}\n"
            f"{interval(result.aoi_ci_low, result.aoi_ci_high)}"
        ),
        meaning=partial(_with_note, f"{AGE_MEANING} standard error and 95 % interval."),
    ),
    Shown(
        heading="median\np95",
        cell=lambda result: f"{result.aoi_median:.2f}\n{result.aoi_p95:.2f}",
        meaning="Median and p95 are over missions.",
    ),
    Shown(
        heading="all",
        cell=_complete,
        meaning=COMPLETE_MEANING,
    ),
    Shown(
        heading="difference\n95 %",
        cell=_difference,
        meaning=lambda result: (
            f"Difference: AoI minus that of {result.baseline}, mission by mission."
        ),
    ),
    Shown(
        heading="packets\nreached",
        cell=lambda result: f"{result.packets_per_window:.2f}\n{_reached(result)}",
        meaning=(
            "Packets: sent in a window, and the share that reached its addressee or, of "
            "broadcasts, at least one robot;"
        ),
    ),
    Shown(
        heading="hearers\nbytes",
        cell=lambda result: (
            f"{number(result.hearers_per_packet)}\n{number(result.packet_bytes, ',d')}"
        ),
        meaning=("hearers: robots that decoded a broadcast, on average. Bytes: of a packet."),
    ),
    Shown(
        heading="task cost\nat the end",
        cell=lambda result: f"{_task_cost(result)}\n{_task_cost_at_the_end(result)}",
        meaning=_task_cost_meaning,
        applies=has_own_cost,
    ),
    Shown(
        heading="difference\nof task cost",
        cell=_task_cost_difference,
        meaning="",
        applies=has_own_cost,
    ),
    Shown(
        heading="variance\nagreed",
        cell=lambda result: (
            f"{number(result.velocity_variance_mean, VARIANCE_FORM)}\n{_agreed(result)}"
        ),
        meaning=_variance_meaning,
        applies=_shows_variance,
    ),
    Shown(
        heading=lambda result: "published\nAoI, var." if is_flock(result) else "published\nAoI",
        cell=_published,
        meaning=_published_meaning,
        applies=lambda result: not has_own_cost(result),
    ),
)
