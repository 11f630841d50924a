"""Results of evaluations as files: one row per policy and regime, as CSV or JSON."""

import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import MISSING, Field, asdict, dataclass, fields
from pathlib import Path
from types import NoneType
from typing import Any, get_args

from swarm_mj.fields import kind_of
from swarm_mj.io import atomic


@dataclass(frozen=True, kw_only=True)
class Result:
    """What one policy cost in one regime, over all missions; None is what does not exist.

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
    switched_off: float = 0.0  # fraction of the robots, half-way; files made before it have none
    episodes: int
    seed: int  # of the first mission; the others follow one by one
    probability: float | None  # of a transmission, for the policies that have one
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
    aoi_floor_mean: float  # what instant sharing within connected parts would leave
    aoi_floor_sem: float | None

    velocity_variance_mean: float
    velocity_variance_std: float | None
    velocity_variance_sem: float | None
    velocity_variance_ci_low: float | None
    velocity_variance_ci_high: float | None
    velocity_variance_median: float

    packets_per_window: float  # requests or broadcasts, no responses
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

    published_aoi_mean: float | None  # the paper's value where the regime is one of its own
    published_aoi_sem: float | None
    published_velocity_variance_mean: float | None
    published_velocity_variance_sem: float | None

    version: str
    commit: str | None
    config: str  # JSON: every field of the mission, the policy and its parameters


CARRIES_MORE = "carry more than T, M, P"  # what is said of such policies wherever they are shown


def carries_more(result: Result) -> bool:
    """Whether packets carry more than T, M and P (II-B); older files do not tell."""
    return result.payload not in (None, "none")


COLUMNS = tuple(spec.name for spec in fields(Result))
NEEDED = tuple(spec.name for spec in fields(Result) if spec.default is MISSING)
NUMBERS = {int: "a whole number", float: "a finite number", str: "a text"}
WAY_OUT = "make them with `swarm-mj evaluate --csv FILE`"


def read_results(path: Path) -> list[Result]:
    """The rows of a results file that `swarm-mj evaluate --csv` wrote, one or more, in its order.

    Columns that no result has are passed over, and those with a default may be missing.

    Raises:
        ValueError: The file is no CSV, lacks columns or rows, or a cell is not what it must be.
        OSError: The file cannot be read.
    """
    try:
        with path.open(newline="", encoding="utf-8") as file:
            reader = csv.DictReader(file, strict=True)
            missing = [name for name in NEEDED if name not in (reader.fieldnames or ())]
            if missing:
                raise ValueError(f"results {path} lack the columns {', '.join(missing)}; {WAY_OUT}")
            results = [_result(f"{path}, line {reader.line_num}", row) for row in reader]
    except (csv.Error, UnicodeDecodeError) as error:
        raise ValueError(f"results {path} are no CSV ({error}); {WAY_OUT}") from error
    if not results:
        raise ValueError(f"results {path} have no rows; {WAY_OUT}")
    return results


def write_csv(path: Path, results: Sequence[Result]) -> None:
    """Writes results as the rows of a CSV file, replaced if it exists; None is an empty cell.

    Raises:
        OSError: The file cannot be written.
    """
    atomic.write_csv(path, COLUMNS, (asdict(result) for result in results))


def write_json(
    path: Path, results: Sequence[Result], missions: Sequence[Mapping[str, Sequence[float]]]
) -> None:
    """Writes `{"results": [...]}`; what does not exist is null.

    Args:
        path: The file, replaced if it exists.
        results: Its objects.
        missions: For each result, lists over its missions in the order of their seeds.

    Raises:
        ValueError: Not as many lists as results.
        OSError: The file cannot be written.
    """
    objects = [{**asdict(one), **lists} for one, lists in zip(results, missions, strict=True)]
    atomic.write_json(path, {"results": objects})


def _result(place: str, row: dict[str, Any]) -> Result:
    """One row; `place` says which, for the message."""
    if None in row or None in row.values():
        raise ValueError(f"results {place}: as many cells as columns are needed; {WAY_OUT}")
    given = (spec for spec in fields(Result) if spec.name in row)
    return Result(**{spec.name: _value(place, spec, row[spec.name]) for spec in given})


def _value(place: str, spec: Field[Any], text: str) -> Any:  # noqa: ANN401 - any field's value
    """A cell as its field's type."""
    if text == "" and NoneType in get_args(spec.type):
        return None
    kind = kind_of(spec)
    try:
        value = kind(text)
    except ValueError:
        value = math.nan
    if text == "" or (isinstance(value, float) and not math.isfinite(value)):
        raise ValueError(f"results {place}: {spec.name} must be {NUMBERS[kind]}, not {text!r}")
    return value
