"""Results of a study from its batches' costs: one per policy and regime, with their errors."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.published import published
from swarm_mj.evaluation.results import COLUMNS, Result, write_results
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission
from swarm_mj.policies.registry import flown_name
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.words import radio_in_words
from swarm_mj.system.writing import write_json

COSTS = ("aoi", "velocity_variance", "task_cost")  # of each mission; only some have the last
BATCH = 1000  # resamples at once: bounds the memory that many samples take
ROUNDING = 1e-12  # samples that differ by no more than this share of their size are constant


@dataclass(frozen=True, kw_only=True)
class Evaluated:
    """A result and its missions, in the order of their seeds."""

    result: Result
    aoi: list[float]  # Eq. 10, mean over windows [windows]
    velocity_variance: list[float]  # Eq. 17, mean over windows [m²/s²]
    task_cost: list[float] | None  # mean over windows; None if the controller has none

    @property
    def row(self) -> dict[str, Any]:
        """The result's columns, and the missions' costs as lists."""
        costs = {name: getattr(self, name) for name in COSTS}
        return asdict(self.result) | {f"episode_{n}": c for n, c in costs.items() if c is not None}


def write_evaluated(path: Path, evaluated: Sequence[Evaluated]) -> None:
    """Write results as .csv, results and each mission's costs as .json, or missions as .parquet."""
    ending = path.suffix.lower()
    if ending == ".csv":
        write_results(path, [each.result for each in evaluated])
    elif ending == ".json":
        write_json(path, {"results": [each.row for each in evaluated]})
    else:
        from swarm_mj.evaluation.missions_table import write_missions  # pandas is slow to import

        write_missions(path, evaluated)


def study_results(
    study: Study, costs: Mapping[int, BatchCosts], made_by: Mapping[str, Any]
) -> list[Evaluated]:
    """Return the results of a study, regime by regime, policy by policy.

    `costs` are by the index in `study.batches`; `made_by` has the code's `version` and `commit`.
    """
    batches: dict[tuple[Mission, str], list[BatchCosts]] = {pair: [] for pair in study.pairs}
    for index, batch in enumerate(study.batches):
        batches[batch.mission, batch.policy].append(costs[index])
    merged = {pair: merge(each) for pair, each in batches.items()}
    return [
        Evaluated(
            result=_result(study, regime, policy, merged, made_by),
            aoi=own.aoi.tolist(),
            velocity_variance=own.velocity_variance.tolist(),
            task_cost=None if np.isnan(own.task_cost).any() else own.task_cost.tolist(),
        )
        for (regime, policy), own in merged.items()
    ]


def merge(batches: Sequence[BatchCosts]) -> BatchCosts:
    """Return batches of the same policy and regime as one, in the order given; `ages` add up."""
    names = [spec.name for spec in fields(BatchCosts)]
    joined = {name: np.concatenate([getattr(each, name) for each in batches]) for name in names}
    return BatchCosts(**joined | {"ages": np.sum([each.ages for each in batches], axis=0)})


def _result(
    study: Study,
    regime: Mission,
    policy: str,
    merged: Mapping[tuple[Mission, str], BatchCosts],
    made_by: Mapping[str, Any],
) -> Result:
    own = merged[regime, policy]
    made = study.make_policy(policy, regime)
    baseline = flown_name(study.compared_to, regime)
    task_cost_name, task_cost_unit = study.task_cost(regime) or (None, None)
    columns: dict[str, Any] = {
        **dict.fromkeys(COLUMNS),
        **{name: value for name, value in asdict(regime).items() if name in COLUMNS},
        **study.components.names,
        "policy": policy,
        "radio": radio_in_words(regime) or None,
        "episodes": study.episodes,
        "seed": study.seed,
        "probability": study.parameters[regime, policy].get("probability"),
        "task_cost_name": task_cost_name,
        "task_cost_unit": task_cost_unit,
        **_costs(own),
        **_packets(own, regime, made.packet(regime).num_bytes),
        "payload": made.payload,
        "baseline": baseline,
        **_differences(own, merged[regime, baseline]),
        # The paper has no missions with parts of a user's own.
        **({} if study.components.names else _published(policy, regime)),
        "version": made_by["version"],
        "commit": made_by["commit"],
        "config": json.dumps(study.config(policy, regime)),
    }
    for name, value in columns.items():
        if isinstance(value, float) and not math.isfinite(value):
            columns[name] = None  # what does not exist, or never happened
    return Result(**columns)


def _costs(costs: BatchCosts) -> dict[str, Any]:
    columns: dict[str, Any] = {}
    for name in ("aoi", "velocity_variance"):
        figures = spread(getattr(costs, name))
        columns |= {f"{name}_{figure}": value for figure, value in figures.items()}
    for name in ("aoi_steady", "aoi_floor", "task_cost", "task_cost_last"):
        samples = getattr(costs, name)
        columns[f"{name}_mean"] = float(np.mean(samples))
        columns[f"{name}_sem"] = standard_error(samples)
    for name, share in (("age_p95", 0.95), ("age_worst", 1.0)):
        columns[name] = SLOT_WINDOWS * quantile_of_counts(costs.ages, share)
    return {name: value for name, value in columns.items() if name in COLUMNS}


def _packets(costs: BatchCosts, regime: Mission, num_bytes: int) -> dict[str, Any]:
    num_sent, num_windows = float(costs.packets_sent.sum()), costs.aoi.size * regime.num_windows
    sent_bytes = num_bytes * float(costs.packets_transmitted.sum())

    def per_packet(counts: Float[np.ndarray, "B"]) -> float:
        """Return the share of all packets sent, or nan where there is none."""
        applies = num_sent > 0.0 and not np.isnan(counts).all()
        return float(np.nansum(counts)) / num_sent if applies else math.nan

    # A mission that never was complete counts as late as any, so that the median stays honest.
    complete = np.nan_to_num(costs.complete_window, nan=np.inf)
    return {
        "packets_per_window": num_sent / num_windows,
        "packet_bytes": num_bytes,
        "bytes_per_second": sent_bytes / (num_windows * regime.window_s),
        "delivery_ratio": per_packet(costs.packets_delivered),
        "heard_ratio": per_packet(costs.packets_heard),
        "hearers_per_packet": per_packet(costs.packets_receptions),
        "hops_mean": float(np.mean(costs.hops)),
        "complete_window_median": float(np.median(complete)),
        "complete_share": float(np.mean(np.isfinite(complete))),
    }


def _differences(costs: BatchCosts, baseline: BatchCosts) -> dict[str, float | None]:
    """Return paired differences, mission by mission; nothing of the baseline to itself."""
    columns: dict[str, float | None] = {}
    for cost in COSTS:
        difference = getattr(costs, cost) - getattr(baseline, cost)
        if costs is not baseline and not np.isnan(difference).any():
            low, high = bootstrap_interval(difference)
            columns[f"{cost}_difference_mean"] = float(np.mean(difference))
            columns[f"{cost}_difference_ci_low"] = low
            columns[f"{cost}_difference_ci_high"] = high
    return columns


def _published(policy: str, regime: Mission) -> dict[str, float]:
    columns: dict[str, float] = {}
    for cost, point in published(policy, regime).items():
        columns |= {f"published_{cost}_mean": point.mean, f"published_{cost}_sem": point.sem}
    return columns


def spread(samples: Float[np.ndarray, "n"]) -> dict[str, float | None]:
    """Return mean, errors and quantiles of independent samples, one or more, in their own unit.

    `std` is the sample's standard deviation (n - 1 below), `sem` the mean's standard error,
    `ci_low` and `ci_high` the ends of `bootstrap_interval`; p95 is linear between samples.
    """
    ci_low, ci_high = bootstrap_interval(samples)
    return {
        "mean": float(np.mean(samples)),
        "std": float(np.std(samples, ddof=1)) if samples.size > 1 else None,
        "sem": standard_error(samples),
        "ci_low": ci_low,
        "ci_high": ci_high,
        "median": float(np.median(samples)),
        "p95": float(np.percentile(samples, 95.0)),
        "worst": float(np.max(samples)),
    }


def standard_error(samples: Float[np.ndarray, "n"]) -> float | None:
    """Return the mean's standard error, std / sqrt(n); None of fewer than two samples."""
    return float(np.std(samples, ddof=1)) / math.sqrt(samples.size) if samples.size > 1 else None


def bootstrap_interval(samples: Float[np.ndarray, "n"]) -> tuple[float | None, float | None]:
    """Return the mean's bias-corrected and accelerated bootstrap interval, 95 % (Efron 1987).

    The samples are independent; paired differences are one sample a pair. Both ends are None where
    the samples do not vary, or there is only one.
    """
    largest = float(np.max(np.abs(samples), initial=0.0))
    if samples.size < 2 or float(np.ptp(samples)) <= ROUNDING * largest:
        return None, None
    from scipy.stats import bootstrap  # slow to import

    rng = np.random.default_rng(0)  # the same samples always have the same interval
    found = bootstrap((samples,), np.mean, batch=BATCH, rng=rng).confidence_interval
    return float(found.low), float(found.high)


def quantile_of_counts(counts: Int[np.ndarray, "bins"], share: float) -> int:
    """Return the first bin at or below which at least this share of all counts lies."""
    return int(np.searchsorted(np.cumsum(counts), share * int(np.sum(counts))))
