"""Results of a study from the costs of its batches: one per policy and regime."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.published import published
from swarm_mj.evaluation.results import COLUMNS, Result
from swarm_mj.evaluation.statistics import (
    bootstrap_interval,
    quantile_of_counts,
    spread,
    standard_error,
)
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission
from swarm_mj.policies.policy import Policy
from swarm_mj.policies.registry import flown_name
from swarm_mj.protocol.window import SLOT_WINDOWS
from swarm_mj.system.atomic import write_json

COSTS = ("aoi", "velocity_variance")  # of each mission


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
        costs = {"aoi": self.aoi, "velocity_variance": self.velocity_variance}
        costs |= {} if self.task_cost is None else {"task_cost": self.task_cost}
        return asdict(self.result) | {f"episode_{name}": each for name, each in costs.items()}


def write_evaluated(path: Path, evaluated: Sequence[Evaluated]) -> None:
    """Write `{"results": [...]}` as JSON, replaced if it exists; what does not exist is null."""
    write_json(path, {"results": [each.row for each in evaluated]})


def summarise(
    study: Study, costs: Mapping[int, BatchCosts], made_by: Mapping[str, Any]
) -> list[Evaluated]:
    """Return the results of a study, regime by regime, policy by policy.

    Args:
        study: The policies and regimes.
        costs: The costs of each batch, by its index in `study.batches`, in any order.
        made_by: The code's `version` and `commit` when the first of them began.

    Raises:
        ValueError: A batch is missing.
    """
    if missing := len(study.batches) - len(costs):
        raise ValueError(f"{missing} of {len(study.batches)} batches are missing")
    batches: dict[tuple[Mission, str], list[BatchCosts]] = {pair: [] for pair in study.pairs}
    for index, batch in enumerate(study.batches):
        batches[batch.mission, batch.policy].append(costs[index])
    merged = {pair: merge(each) for pair, each in batches.items()}
    return [
        Evaluated(
            result=Result(
                **_regime(study, policy, regime),
                **_costs(own, study.task_cost(regime)),
                **_packets(own, regime, study.make_policy(policy, regime)),
                **_differences(own, merged[regime, flown_name(study.compared_to, regime)]),
                **_published(policy, None if study.components.names else regime),
                version=made_by["version"],
                commit=made_by["commit"],
                baseline=flown_name(study.compared_to, regime),
                config=json.dumps(study.config(policy, regime)),
            ),
            aoi=own.aoi,
            velocity_variance=own.velocity_variance,
            task_cost=_known(own.task_cost),
        )
        for (regime, policy), own in merged.items()
    ]


def merge(batches: Sequence[BatchCosts]) -> BatchCosts:
    """Return batches of the same policy and regime as one, in the order given."""
    lists = {
        spec.name: [number for batch in batches for number in getattr(batch, spec.name)]
        for spec in fields(BatchCosts)
        if spec.name != "ages"
    }
    ages = np.sum([batch.ages for batch in batches], axis=0)
    return BatchCosts(**lists, ages=ages.tolist())


def _regime(study: Study, policy: str, regime: Mission) -> dict[str, Any]:
    """Return the numbers of the mission that a result repeats, and the policy."""
    repeated = {name: value for name, value in asdict(regime).items() if name in COLUMNS}
    return (
        repeated
        | study.components.names
        | {
            "policy": policy,
            "radio": regime.beyond_free_space or None,
            "episodes": study.episodes,
            "seed": study.seed,
            "probability": study.parameters[regime, policy].get("probability"),
            "payload": study.make_policy(policy, regime).payload,
        }
    )


def _costs(costs: BatchCosts, task_cost: tuple[str, str] | None) -> dict[str, Any]:
    """Return costs over missions, and ages over pairs; the task's cost by its name and unit."""
    columns: dict[str, Any] = {}
    for cost in COSTS:
        found = spread(np.array(getattr(costs, cost)))
        columns |= {f"{cost}_{name}": value for name, value in found.items()}
    names = ["aoi_steady", "aoi_floor"]
    if task_cost is not None:
        columns |= dict(zip(("task_cost_name", "task_cost_unit"), task_cost, strict=True))
        names += ["task_cost", "task_cost_last"]
    for name in names:
        columns |= _mean_and_sem(name, getattr(costs, name))
    for name, share in (("age_p95", 0.95), ("age_worst", 1.0)):
        columns[name] = SLOT_WINDOWS * quantile_of_counts(np.array(costs.ages), share)
    return {name: value for name, value in columns.items() if name in COLUMNS}


def _mean_and_sem(name: str, costs: Sequence[float | None]) -> dict[str, float | None]:
    """Return mean over missions and standard error; None unless all missions have the cost."""
    samples = _known(costs)
    if samples is None:
        return {f"{name}_mean": None, f"{name}_sem": None}
    mean, sem = float(np.mean(samples)), standard_error(np.array(samples))
    return {f"{name}_mean": mean, f"{name}_sem": sem}


def _known(costs: Sequence[float | None]) -> list[float] | None:
    """Return every mission's cost; None unless all have one."""
    known = [cost for cost in costs if cost is not None]
    return known if len(known) == len(costs) else None


def _packets(costs: BatchCosts, regime: Mission, policy: Policy) -> dict[str, Any]:
    """Return how many were sent and decoded, their bytes, and how far knowledge spread."""
    sent, num_windows = sum(costs.packets_sent), len(costs.aoi) * regime.num_windows
    packet_bytes = policy.packet(regime).num_bytes
    sent_bytes = packet_bytes * sum(costs.packets_transmitted)
    # A mission that never was complete counts as late as any, so that the median stays honest.
    complete = [np.inf if window is None else window for window in costs.complete_window]
    median = float(np.median(complete))
    return {
        "packets_per_window": sent / num_windows,
        "packet_bytes": packet_bytes,
        "bytes_per_second": sent_bytes / (num_windows * regime.window_s),
        "delivery_ratio": _per_packet(costs.packets_delivered, sent),
        "heard_ratio": _per_packet(costs.packets_heard, sent),
        "hearers_per_packet": _per_packet(costs.receptions, sent),
        "hops_mean": float(np.mean(costs.hops)),
        "complete_window_median": median if np.isfinite(median) else None,
        "complete_share": float(np.mean(np.isfinite(complete))),
    }


def _per_packet(counts: Sequence[int | None], sent: int) -> float | None:
    """Return a count over the packets sent; None if it does not apply to them, or none was sent."""
    applicable = [count for count in counts if count is not None]
    return sum(applicable) / sent if applicable and sent else None


def _differences(costs: BatchCosts, baseline: BatchCosts) -> dict[str, Any]:
    """Return paired differences, mission by mission; None of the baseline to itself."""
    differences: dict[str, Any] = {}
    for cost in (*COSTS, "task_cost"):
        mean, low, high = None, None, None
        own, its = _known(getattr(costs, cost)), _known(getattr(baseline, cost))
        if costs is not baseline and own is not None and its is not None:
            difference = np.array(own) - np.array(its)
            mean, (low, high) = float(np.mean(difference)), bootstrap_interval(difference)
        found = {"mean": mean, "ci_low": low, "ci_high": high}
        differences |= {f"{cost}_difference_{name}": value for name, value in found.items()}
    return differences


def _published(policy: str, regime: Mission | None) -> dict[str, Any]:
    """Return the paper's values; none for missions with custom parts."""
    points = {} if regime is None else published(policy, regime)
    return {
        f"published_{cost}_{figure}": getattr(points[cost], figure) if cost in points else None
        for cost in COSTS
        for figure in ("mean", "sem")
    }
