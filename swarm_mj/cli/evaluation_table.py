"""Results on the terminal: one table per regime, the freshest knowledge first."""

from collections.abc import Sequence
from itertools import groupby

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.table import Table

from swarm_mj.evaluation.results import Result

MIN_WIDTH = 100  # of the console; narrower ones wrap lines rather than cut numbers off
NAME_WIDTH = 22  # of a policy that fits in there; a longer directory's name widens the table
NONE = "-"


def print_results(results: Sequence[Result]) -> None:
    """Prints a table per regime; results of a regime stand together."""
    longest = max(len(result.policy) for result in results)
    width = max(MIN_WIDTH + max(0, longest - NAME_WIDTH), Console().width)
    console = Console(highlight=False, markup=False, width=width)
    for regime, group in groupby(results, _regime):
        of_regime = sorted(group, key=lambda result: result.aoi_mean)
        console.print(regime)
        console.print(_table(of_regime))
        console.print(_floor(of_regime))
        console.print()
    console.print(_legend(results[0]))


def _regime(result: Result) -> str:
    """A table's title."""
    fate = f", {result.switched_off:.0%} of the robots off half-way" if result.switched_off else ""
    return (
        f"{result.task}, preset {result.preset}: {result.num_robots} robots, range ratio "
        f"{result.range_ratio:g}, velocity ratio {result.velocity_ratio:g}, boundary "
        f"{result.boundary},\n{result.num_windows} windows of {result.physics} physics{fate}"
    )


def _table(results: Sequence[Result]) -> Table:
    table = Table(box=SIMPLE_HEAD, show_edge=False, padding=0)
    table.add_column("policy", no_wrap=True)
    for name in ("AoI ± SEM\n95 %", "median", "p95", "difference\n95 %"):
        table.add_column(name, justify="right")
    for name in ("velocity\nvariance", "packets\narrived", "published\nvariance"):
        table.add_column(name, justify="right")
    for r in results:
        table.add_row(
            r.policy,
            f"{_with_error(r.aoi_mean, r.aoi_sem)}\n{_interval(r.aoi_ci_low, r.aoi_ci_high)}",
            _number(r.aoi_median),
            _number(r.aoi_p95),
            f"{_number(r.aoi_difference_mean)}\n"
            f"{_interval(r.aoi_difference_ci_low, r.aoi_difference_ci_high)}",
            _number(r.velocity_variance_mean, 4),
            f"{_number(r.packets_per_window)}\n{_share(r.delivery_ratio)}",
            _published(r),
        )
    return table


def _published(result: Result) -> str:
    """The paper's age and, of flocks, its velocity variance below."""
    age = _with_error(result.published_aoi_mean, result.published_aoi_sem)
    if result.published_velocity_variance_mean is None:
        return age
    return f"{age}\n{_number(result.published_velocity_variance_mean, 4)}"


def _floor(results: Sequence[Result]) -> str:
    """The floor; flocks fly as they are told, so each policy may have its own."""
    floors = [result.aoi_floor_mean for result in results]
    low, high = f"{min(floors):.2f}", f"{max(floors):.2f}"
    return f"connectivity floor: {low}" + (f" to {high}, by policy" if low != high else "")


def _legend(result: Result) -> str:
    """What the columns mean."""
    return (
        f"AoI: age of information [windows], mean over {result.episodes} missions from seed "
        f"{result.seed}, its standard error and its 95 % interval; median and p95 over missions. "
        f"Difference: to {result.baseline}, mission by mission. Velocity variance [m²/s²]. Packets "
        "sent in a window, and the share that arrived. Floor: the age that sharing within "
        "connected parts at once would leave."
    )


def _number(value: float | None, digits: int = 2) -> str:
    return NONE if value is None else f"{value:.{digits}f}"


def _share(value: float | None) -> str:
    return NONE if value is None else f"{value:.0%}"


def _with_error(mean: float | None, sem: float | None) -> str:
    if mean is None:
        return NONE
    return f"{mean:.2f}" if sem is None else f"{mean:.2f} ± {sem:.2f}"


def _interval(low: float | None, high: float | None) -> str:
    return "" if low is None else f"{low:.2f}, {_number(high)}"
