"""Results of evaluations as files: one row per policy and regime, as CSV or JSON."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import msgspec

from swarm_mj.mission.specification import NOTHING, Mission
from swarm_mj.system.fields import former_names
from swarm_mj.system.reading import read_json, read_rows
from swarm_mj.system.writing import write_csv


@dataclass(frozen=True, kw_only=True)
class Result:
    """Costs of one policy in one regime, over all missions; None is what does not exist.

    Age of information (AoI, Eq. 10) and ages are in windows, velocity variance (Eq. 17) in m²/s².
    `_std` is the sample's standard deviation, `_sem` the mean's standard error, `_ci_` the mean's
    bootstrap interval of 95 %; all are over missions unless a comment says otherwise.
    """

    policy: str
    task: str
    preset: str
    num_robots: int
    range_ratio: float
    velocity_ratio: float
    boundary: str
    physics: str
    num_windows: int
    failure_fraction: float = 0.0  # of the robots, half-way; files made before it have none
    episodes: int
    seed: int  # of the first mission; the others follow one by one
    probability: float | None  # of a transmission, for the policies that have one
    arena: str = "open"  # what stands in the area
    radio: str | None = None  # what the channel has beyond free space; None is nothing
    prior_knowledge: str = NOTHING  # what robots knew before the mission
    channel: str | None = None  # the user's own, as module:Name; None is the mission's
    controller: str | None = None  # as above
    scene: str | None = None  # as above
    bit_rate: float | None = None  # of the radio [bit/s]; None: packets of any size fit
    payload: str | None = None  # what packets carry beyond T, M and P (II-B); "none" or its name

    aoi_mean: float
    aoi_std: float | None
    aoi_sem: float | None
    aoi_ci_low: float | None
    aoi_ci_high: float | None
    aoi_median: float
    aoi_p95: float
    aoi_worst: float
    aoi_steady_mean: float  # second half of the mission
    aoi_steady_sem: float | None
    age_p95: float  # over all ordered pairs of two robots and all windows of all missions
    age_worst: float  # as above
    # What instant sharing within connected parts would leave; None over a custom channel.
    aoi_floor_mean: float | None
    aoi_floor_sem: float | None

    velocity_variance_mean: float
    velocity_variance_std: float | None
    velocity_variance_sem: float | None
    velocity_variance_ci_low: float | None
    velocity_variance_ci_high: float | None
    velocity_variance_median: float

    # What the task costs, as its controller calls it; none of the older files has these.
    task_cost_name: str | None = None
    task_cost_unit: str | None = None
    task_cost_mean: float | None = None
    task_cost_sem: float | None = None
    task_cost_last_mean: float | None = None  # after the last window
    task_cost_last_sem: float | None = None

    packets_per_window: float  # requests or broadcasts, no responses
    packet_bytes: int | None = None  # of a packet; none of the older files has it
    bytes_per_second: float | None = None  # sent by the team, responses too
    delivery_ratio: float | None  # of requests: decoded by their addressee
    heard_ratio: float | None = None  # of broadcasts: decoded by at least one robot
    hearers_per_packet: float | None = None  # robots that decoded a broadcast, on average
    hops_mean: float  # depth of the parent trees, over windows and missions
    complete_window_median: float | None  # over all missions; None if half never were
    complete_share: float  # of missions in which everyone heard of everyone

    baseline: str  # differences are this policy's minus the baseline's, on the same missions
    aoi_difference_mean: float | None
    aoi_difference_ci_low: float | None
    aoi_difference_ci_high: float | None
    velocity_variance_difference_mean: float | None
    velocity_variance_difference_ci_low: float | None
    velocity_variance_difference_ci_high: float | None

    task_cost_difference_mean: float | None = None
    task_cost_difference_ci_low: float | None = None
    task_cost_difference_ci_high: float | None = None

    published_aoi_mean: float | None  # the paper's value where the regime is one of its own
    published_aoi_sem: float | None
    published_velocity_variance_mean: float | None
    published_velocity_variance_sem: float | None

    version: str
    commit: str | None
    config: str  # JSON: every field of the mission, the policy and its parameters


CARRIES_MORE = "carry more than T, M, P"  # said wherever such policies are shown


def carries_more(result: Result) -> bool:
    """Return whether packets carry more than T, M and P (II-B); older files do not say."""
    return result.payload not in (None, "none")


def config_of(result: Result) -> dict[str, Any]:
    """Return everything that a result depends on; raise ValueError if that is no JSON object."""
    try:
        return read_json(result.config, dict)
    except ValueError as error:
        raise ValueError(
            f"config of {result.policy} must be a JSON object, not {result.config!r:.60}"
        ) from error


COLUMNS = tuple(spec.name for spec in fields(Result))
MAX_BYTES = 100_000_000  # of a file


def read_results(path: Path) -> list[Result]:
    """Return the rows of a file that `swarm-mj evaluate --csv` wrote, one or more, in its order.

    Columns that no result has are ignored, and those with a default may be missing. Raises
    ValueError if the file cannot be read as such, or has no rows.
    """
    try:
        rows = read_rows(path, "results file", MAX_BYTES)
        if not rows:
            raise ValueError(f"results file {path} has no rows")
        return [_result(f"results file {path}, line {line}", row) for line, row in rows]
    except ValueError as error:
        raise ValueError(f"{error}; make them with `swarm-mj evaluate --csv FILE`") from error


def write_results(path: Path, results: Iterable[Result]) -> None:
    """Write results as the rows of a CSV file, replaced if it exists; None is an empty cell."""
    write_csv(path, COLUMNS, (asdict(result) for result in results))


def _result(place: str, row: dict[str, str]) -> Result:
    present = former_names(Mission)
    cells = {present.get(name, name): cell or None for name, cell in row.items()}
    try:
        return msgspec.convert(cells, Result, strict=False)
    except msgspec.ValidationError as error:
        raise ValueError(f"{place}: {error}") from error
