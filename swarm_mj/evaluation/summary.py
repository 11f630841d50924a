"""Results of a study from its batches' costs: one per policy and regime, and files of them."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from swarm_mj.evaluation.batch import BatchCosts, merge
from swarm_mj.evaluation.measurements import Measurements
from swarm_mj.evaluation.results import CONVERGENCE, Evaluated, result_of
from swarm_mj.evaluation.results_files import write_results
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import Mission
from swarm_mj.policies.registry import flown_name
from swarm_mj.system.writing import write_json


def study_results(
    study: Study, costs: Mapping[int, BatchCosts], made_by: Mapping[str, Any]
) -> list[Evaluated]:
    """Return the results of a study, regime by regime, policy by policy.

    Args:
        study: What was flown.
        costs: Each batch's costs, by its index in `study.batches`.
        made_by: The code that flew: its `version` and `commit`, as `study.header()` has them.
    """
    batches: dict[tuple[Mission, str], list[BatchCosts]] = {pair: [] for pair in study.pairs}
    for index, batch in enumerate(study.batches):
        batches[batch.mission, batch.policy].append(costs[index])
    merged = {pair: merge(each) for pair, each in batches.items()}

    evaluated: list[Evaluated] = []
    for (regime, policy), own in merged.items():
        baseline = flown_name(study.compared_to, regime)
        measured = Measurements(
            study=study,
            mission=regime,
            policy=policy,
            costs=own,
            baseline=baseline,
            baseline_costs=merged[regime, baseline],
            version=made_by["version"],
            commit=made_by["commit"],
        )
        has_task_cost = not np.isnan(own.task_cost).any()
        of_flocks: dict[str, list[float | None]] = {}
        if regime.flocks:
            of_flocks = {name: _numbers(getattr(own, name)) for name in CONVERGENCE}
        evaluated.append(
            Evaluated(
                result=result_of(measured),
                aoi=own.aoi.tolist(),
                velocity_variance=own.velocity_variance.tolist(),
                task_cost=own.task_cost.tolist() if has_task_cost else None,
                **of_flocks,
            )
        )
    return evaluated


def _numbers(values: Float[np.ndarray, "B"]) -> list[float | None]:
    """Return a number of each mission; None in place of nan."""
    return [None if math.isnan(value) else value for value in values.tolist()]


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
