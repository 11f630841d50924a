"""Results of evaluations, and their columns; `results_files` has the files of them.

A new column is a field of `Result`; `table_columns` says which of them are printed.
"""

import math
from collections.abc import Callable
from dataclasses import Field, asdict, dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from swarm_mj.control.motion import Flocking
from swarm_mj.evaluation.measurements import HOW, Measurements, column, later_column
from swarm_mj.mission import Mission
from swarm_mj.mission.bodies import POINT
from swarm_mj.mission.knowledge import NOTHING
from swarm_mj.mission.surroundings import OPEN
from swarm_mj.policies.about import NO_PAYLOAD
from swarm_mj.protocol.mission_costs import (
    AOI,
    MISSION_COSTS,
    VELOCITY_VARIANCE,
    MissionCost,
)
from swarm_mj.radio.words import radio_in_words
from swarm_mj.system.arguments import check_names
from swarm_mj.system.reading import read_json

LARGER_PACKETS = "larger packets"  # said wherever such policies are shown


@dataclass(frozen=True, kw_only=True)
class Result:
    """Costs of one policy in one regime, over all missions; None is what does not exist.

    Age of information (AoI) and ages are in windows, velocity variance in m²/s².
    `_std` is the sample's standard deviation, `_sem` the mean's standard error, `_ci_` the mean's
    bootstrap interval of 95 %; all are over missions unless a comment says otherwise.

    Each field is a column, in the files' order, with the way it is computed from what was measured.
    """

    policy: str = column(lambda own: own.policy)
    task: str = column(lambda own: own.mission.task)
    preset: str = column(lambda own: own.mission.preset)
    num_robots: int = column(lambda own: own.mission.num_robots)
    range_ratio: float = column(lambda own: own.mission.range_ratio)
    velocity_ratio: float = column(lambda own: own.mission.velocity_ratio)
    boundary: str = column(lambda own: own.mission.boundary)
    physics: str = column(lambda own: own.mission.physics)
    num_windows: int = column(lambda own: own.mission.num_windows)
    # Of the robots, half-way.
    failure_fraction: float = later_column(lambda own: own.mission.failure_fraction, older=0.0)
    episodes: int = column(lambda own: own.study.episodes)
    # Of the first mission; the others follow one by one.
    seed: int = column(lambda own: own.study.seed)
    # Of a transmission, for the policies that have one.
    probability: float | None = column(lambda own: own.probability)
    # What stands in the area.
    arena: str = later_column(lambda own: own.mission.arena, older=OPEN)
    # What the channel has beyond free space; None is nothing.
    radio: str | None = later_column(lambda own: radio_in_words(own.mission) or None, older=None)
    # What robots knew before the mission.
    prior_knowledge: str = later_column(lambda own: own.mission.prior_knowledge, older=NOTHING)
    # The user's own, as module:Name; None is the mission's.
    channel: str | None = later_column(lambda own: own.component("channel"), older=None)
    controller: str | None = later_column(lambda own: own.component("controller"), older=None)
    scene: str | None = later_column(lambda own: own.component("scene"), older=None)
    pilot: str | None = later_column(lambda own: own.component("pilot"), older=None)
    # The robots' bodies.
    robot: str = later_column(lambda own: own.mission.robot, older=POINT)
    # Of the radio [bit/s]; None: packets of any size fit.
    bit_rate: float | None = later_column(lambda own: own.mission.bit_rate, older=None)
    # What packets carry beyond T, M and P (II-B): its name, or `NO_PAYLOAD`.
    payload: str | None = later_column(lambda own: own.made.payload, older=None)

    aoi_mean: float = column(lambda own: own.aoi.mean)
    aoi_std: float | None = column(lambda own: own.aoi.std)
    aoi_sem: float | None = column(lambda own: own.aoi.sem)
    aoi_ci_low: float | None = column(lambda own: own.aoi.interval.low)
    aoi_ci_high: float | None = column(lambda own: own.aoi.interval.high)
    aoi_median: float = column(lambda own: own.aoi.median)
    aoi_p95: float = column(lambda own: own.aoi.p95)
    aoi_worst: float = column(lambda own: own.aoi.worst)
    # Over the second half of the mission.
    aoi_steady_mean: float = column(lambda own: own.aoi_steady.mean)
    aoi_steady_sem: float | None = column(lambda own: own.aoi_steady.sem)
    # Over all ordered pairs of two robots and all windows of all missions.
    age_p95: float = column(lambda own: own.age_quantile(0.95))
    age_worst: float = column(lambda own: own.age_quantile(1.0))
    # What instant sharing within connected parts would leave; None over a custom channel.
    aoi_floor_mean: float | None = column(lambda own: own.aoi_floor.mean)
    aoi_floor_sem: float | None = column(lambda own: own.aoi_floor.sem)

    velocity_variance_mean: float = column(lambda own: own.velocity_variance.mean)
    velocity_variance_std: float | None = column(lambda own: own.velocity_variance.std)
    velocity_variance_sem: float | None = column(lambda own: own.velocity_variance.sem)
    velocity_variance_ci_low: float | None = column(lambda own: own.velocity_variance.interval.low)
    velocity_variance_ci_high: float | None = column(
        lambda own: own.velocity_variance.interval.high
    )
    velocity_variance_median: float = column(lambda own: own.velocity_variance.median)

    # What the task costs, as its controller calls it.
    task_cost_name: str | None = later_column(lambda own: own.task_cost_name, older=None)
    task_cost_unit: str | None = later_column(lambda own: own.task_cost_unit, older=None)
    task_cost_mean: float | None = later_column(lambda own: own.task_cost.mean, older=None)
    task_cost_sem: float | None = later_column(lambda own: own.task_cost.sem, older=None)
    # After the last window.
    task_cost_last_mean: float | None = later_column(
        lambda own: own.task_cost_last.mean, older=None
    )
    task_cost_last_sem: float | None = later_column(lambda own: own.task_cost_last.sem, older=None)

    # Requests or broadcasts, no responses.
    packets_per_window: float = column(lambda own: own.num_sent / own.num_windows)
    packet_bytes: int | None = later_column(lambda own: own.packet_bytes, older=None)  # of each
    # Sent by the team, responses too.
    bytes_per_second: float | None = later_column(lambda own: own.bytes_per_second, older=None)
    # Of requests: decoded by their addressee.
    delivery_ratio: float | None = column(lambda own: own.per_packet(own.costs.packets_delivered))
    # Of broadcasts: decoded by at least one robot.
    heard_ratio: float | None = later_column(
        lambda own: own.per_packet(own.costs.packets_heard), older=None
    )
    # Robots that decoded a broadcast, on average.
    hearers_per_packet: float | None = later_column(
        lambda own: own.per_packet(own.costs.packets_receptions), older=None
    )
    # Depth of the parent trees, over windows and missions.
    hops_mean: float = column(lambda own: float(np.mean(own.costs.hops)))
    # Over all missions; None if half never were.
    complete_window_median: float | None = column(lambda own: float(np.median(own.complete)))
    # Of missions in which everyone heard of everyone.
    complete_share: float = column(lambda own: float(np.mean(np.isfinite(own.complete))))
    # Flocks: when under 1 % of the first velocity variance was left, to the end, over all missions;
    # None if half never came so far, or for robots that do not flock.
    agreed_window_median: float | None = later_column(
        lambda own: own.agreed_window_median, older=None
    )
    # Of missions in which it was, with the share's interval of 95 % (Wilson).
    agreed_share: float | None = later_column(lambda own: own.agreed_share, older=None)
    agreed_share_ci_low: float | None = later_column(
        lambda own: own.agreed_share_interval.low, older=None
    )
    agreed_share_ci_high: float | None = later_column(
        lambda own: own.agreed_share_interval.high, older=None
    )
    # Flocks: how fast velocity variance falls over its first three e-foldings [1/window], over the
    # missions in which it does.
    decay_rate_mean: float | None = later_column(lambda own: own.decay_rate.mean, older=None)
    decay_rate_sem: float | None = later_column(lambda own: own.decay_rate.sem, older=None)
    # Flocks: robots of a mission that are out of everyone's range at its end.
    strayed_mean: float | None = later_column(lambda own: own.strayed.mean, older=None)
    strayed_worst: float | None = later_column(lambda own: own.strayed.worst, older=None)
    # Robots with bodies that crashed in a mission.
    crashed_mean: float | None = later_column(lambda own: own.crashed.mean, older=None)
    crashed_worst: float | None = later_column(lambda own: own.crashed.worst, older=None)
    # Energy of a robot with a body in a mission [J], and of the one that used most in any.
    energy_mean_j: float | None = later_column(lambda own: own.energy_j.mean, older=None)
    energy_worst_j: float | None = later_column(lambda own: own.most_energy_j.worst, older=None)

    # Differences are this policy's minus the baseline's, on the same missions.
    baseline: str = column(lambda own: own.baseline)
    aoi_difference_mean: float | None = column(lambda own: own.aoi_difference.mean)
    aoi_difference_ci_low: float | None = column(lambda own: own.aoi_difference.interval.low)
    aoi_difference_ci_high: float | None = column(lambda own: own.aoi_difference.interval.high)
    velocity_variance_difference_mean: float | None = column(
        lambda own: own.velocity_variance_difference.mean
    )
    velocity_variance_difference_ci_low: float | None = column(
        lambda own: own.velocity_variance_difference.interval.low
    )
    velocity_variance_difference_ci_high: float | None = column(
        lambda own: own.velocity_variance_difference.interval.high
    )

    task_cost_difference_mean: float | None = later_column(
        lambda own: own.task_cost_difference.mean, older=None
    )
    task_cost_difference_ci_low: float | None = later_column(
        lambda own: own.task_cost_difference.interval.low, older=None
    )
    task_cost_difference_ci_high: float | None = later_column(
        lambda own: own.task_cost_difference.interval.high, older=None
    )

    # The paper's value where the regime is one of its own.
    published_aoi_mean: float | None = column(lambda own: own.published_mean(AOI))
    published_aoi_sem: float | None = column(lambda own: own.published_sem(AOI))
    published_velocity_variance_mean: float | None = column(
        lambda own: own.published_mean(VELOCITY_VARIANCE)
    )
    published_velocity_variance_sem: float | None = column(
        lambda own: own.published_sem(VELOCITY_VARIANCE)
    )

    version: str = column(lambda own: own.version)
    commit: str | None = column(lambda own: own.commit)
    # JSON: every field of the mission, the policy and its parameters.
    config: str = column(lambda own: own.config)


def computation(spec: Field[object]) -> Callable[[Measurements], object]:
    """Return how a column is computed; raise TypeError for one that nothing computes."""
    if HOW not in spec.metadata:
        raise TypeError(
            f"nothing computes the column {spec.name} of Result; declare it by "
            "`column(lambda own: ...)`, or by `later_column` if older files lack it"
        )
    return spec.metadata[HOW]


# Made on import, so that a column which nothing computes is found at once.
COMPUTATIONS = {spec.name: computation(spec) for spec in fields(Result)}
COLUMNS = tuple(COMPUTATIONS)


def result_of(measured: Measurements) -> Result:
    """Return all columns of what was measured."""
    cells: dict[str, Any] = {name: compute(measured) for name, compute in COMPUTATIONS.items()}
    for name, value in cells.items():
        if isinstance(value, float) and not math.isfinite(value):
            cells[name] = None  # what does not exist, or never happened
    return Result(**cells)


CONVERGENCE = ("agreed_window", "decay_rate", "strayed")  # the fields of `Evaluated` of flocks


@dataclass(frozen=True, kw_only=True)
class Evaluated:
    """A result and its missions, in the order of their seeds."""

    result: Result
    aoi: list[float]  # age of information, mean over windows [windows]
    velocity_variance: list[float]  # mean over windows [m²/s²]
    task_cost: list[float] | None  # mean over windows; None if the controller has none
    # Of flocks; None where a mission has no such number.
    agreed_window: list[float | None] | None = None  # from then on they had agreed
    decay_rate: list[float | None] | None = None  # of the velocity variance [1/window]
    strayed: list[float | None] | None = None  # robots out of everyone's range at the end

    @property
    def costs(self) -> dict[str, list[float]]:
        """Each mission's costs, by their columns; those that the task has."""
        costs: dict[str, list[float]] = {}
        for cost in MISSION_COSTS:
            values = getattr(self, cost.column)
            if values is not None:
                costs[cost.column] = values
        return costs

    @property
    def numbers(self) -> dict[str, list[float | None]]:
        """Each mission's costs and, of flocks, how it came to agree, by their columns."""
        numbers: dict[str, list[float | None]] = {}
        for name, values in self.costs.items():
            numbers[name] = list(values)
        for name in CONVERGENCE:
            values = getattr(self, name)
            if values is not None:
                numbers[name] = values
        return numbers

    @property
    def row(self) -> dict[str, Any]:
        """The result's columns, and the missions' numbers as lists."""
        missions = {f"episode_{name}": each for name, each in self.numbers.items()}
        return asdict(self.result) | missions


class CostStatistics(NamedTuple):
    """A cost of one policy over all missions, in the cost's unit."""

    mean: float  # nan if the task has no such cost
    sem: float | None  # the mean's standard error
    ci_low: float | None  # the mean's interval of 95 %
    ci_high: float | None


def statistics_of(result: Result, cost: MissionCost) -> CostStatistics:
    """Return what a result says of a cost of `MISSION_COSTS`; None is what does not exist.

    Args:
        result: One row of results.
        cost: Which of its costs.

    Raises:
        ValueError: Results have no such cost.
    """
    if cost not in MISSION_COSTS:
        raise ValueError(f"results have no cost {cost.column}")
    mean = getattr(result, f"{cost.column}_mean")
    return CostStatistics(
        mean=math.nan if mean is None else mean,
        sem=getattr(result, f"{cost.column}_sem"),
        # Files hold no interval of a task's cost.
        ci_low=getattr(result, f"{cost.column}_ci_low", None),
        ci_high=getattr(result, f"{cost.column}_ci_high", None),
    )


def carries_more(result: Result) -> bool:
    """Return whether packets carry more than T, M and P (II-B); older files do not say."""
    return result.payload not in (None, NO_PAYLOAD)


def has_memory(result: Result) -> bool:
    """Return whether robots decide by more than their buffers now: a network that remembers."""
    return bool(config_of(result).get("memory"))


def is_flock(result: Result) -> bool:
    """Return whether the robots were to agree on one velocity."""
    return result.task == "flocking"


def has_own_cost(result: Result) -> bool:
    """Return whether the task has a cost of its own, and not a flock's velocity variance."""
    return result.task_cost_name not in (None, Flocking.cost_name)


def mission_field(result: Result, name: str) -> Any:  # noqa: ANN401 - of any field
    """Return a field of a result's mission; None where an older file lacks it.

    Args:
        result: One row of results, whose column `config` is read.
        name: Of a field of `Mission`.

    Raises:
        TypeError: A mission has no such field; the message names the one most like it.
        ValueError: The column is no JSON object.
    """
    check_names("Mission", [name], Mission.__dataclass_fields__)
    return config_of(result).get(name)


def config_of(result: Result) -> dict[str, Any]:
    """Return everything that a result depends on.

    Args:
        result: One row of results, whose column `config` is read.

    Returns:
        The fields of the mission, the policy and its parameters, by name.

    Raises:
        ValueError: The column is no JSON object.
    """
    try:
        return read_json(result.config, dict)
    except ValueError as error:
        raise ValueError(
            f"config of {result.policy} must be a JSON object, not {result.config!r:.60}"
        ) from error
