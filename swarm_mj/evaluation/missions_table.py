"""Missions as rows of a Parquet file; the missions of two files, compared one by one."""

import json
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from swarm_mj.evaluation.results import config_of
from swarm_mj.evaluation.summary import COSTS, Evaluated, bootstrap_interval
from swarm_mj.mission import Mission
from swarm_mj.simulation.components import CALLED_WITH
from swarm_mj.system.fields import kind_of
from swarm_mj.system.reading import open_file
from swarm_mj.system.writing import write_bytes

KINDS = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
REGIME = {spec.name: kind_of(spec) for spec in fields(Mission)} | dict.fromkeys(CALLED_WITH, str)
STUDY = ("version", "commit", "episodes", "seed", "baseline")  # with all policies and regimes
COLUMNS = {"policy": str, "seed": int} | dict.fromkeys(COSTS, float) | REGIME


def write_missions(path: Path, evaluated: Sequence[Evaluated]) -> None:
    """Write a row for each mission, and into the metadata the study, as JSON."""
    columns = [(name, KINDS[kind]) for name, kind in COLUMNS.items()]
    configs = [config_of(each.result) for each in evaluated]
    study: dict[str, Any] = {name: getattr(evaluated[0].result, name) for name in STUDY}
    study["policies and regimes"] = configs
    rows = [
        config
        | {"policy": each.result.policy, "seed": each.result.seed + index}
        | {cost: values[index] for cost in COSTS if (values := getattr(each, cost))}
        for config, each in zip(configs, evaluated, strict=True)
        for index in range(len(each.aoi))
    ]
    table = pa.Table.from_pylist(rows, pa.schema(columns, {"study": json.dumps(study)}))
    parquet.write_table(table, content := pa.BufferOutputStream())
    write_bytes(path, memoryview(content.getvalue()))


def read_missions(path: Path) -> pd.DataFrame:
    """Return the rows of such a file; raise ValueError if it is none."""
    with open_file(path, "missions") as file:
        try:
            found = pd.read_parquet(file)
        except pa.ArrowInvalid as error:
            raise ValueError(f"missions {path}: {error}; make them with --parquet") from error
    newer = {spec.name: spec.default for spec in fields(Mission) if spec.name not in found}
    return found.assign(**newer)  # in a file without a field, it had its default


def compared(before: pd.DataFrame, after: pd.DataFrame, cost: str) -> pd.DataFrame:
    """Return how a cost differs, mission by mission: a row for each policy in each regime.

    Means and the interval of 95 % are over the missions that both have, if there are any.
    """
    both = before.merge(after, "outer", ["policy", *REGIME, "seed"], indicator=True)
    both = both.dropna(subset=[f"{cost}_x", f"{cost}_y"], how="all")
    varied = ["policy"]
    for name in REGIME:  # those that tell regimes apart
        if len(both[[*varied, name]].drop_duplicates()) > len(both[varied].drop_duplicates()):
            varied.insert(-1, name)
    rows = []
    for _, missions in both.groupby(varied, dropna=False):
        found = np.array(missions["_merge"])
        shown = missions[found == "both"] if "both" in found else missions
        old, new = (np.array(shown[f"{cost}_{side}"], float) for side in "xy")
        difference = new - old
        ends = bootstrap_interval(difference[~np.isnan(difference)])
        means = {"before": old.mean(), "after": new.mean(), "difference": difference.mean()}
        means |= dict(zip(("low", "high"), np.array(ends, float), strict=True))
        sides = {"missions": "both", "only before": "left_only", "only after": "right_only"}
        counts = {said: (found == side).sum() for said, side in sides.items()}
        rows.append({name: missions[name].iloc[0] for name in varied} | means | counts)
    return pd.DataFrame(rows)
