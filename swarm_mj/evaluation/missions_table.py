"""Missions as rows of a Parquet file; the missions of two files, compared one by one."""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from types import NoneType
from typing import get_args

import numpy as np
import pandas as pd
import pyarrow as pa
from pyarrow import parquet

from swarm_mj.evaluation.results import CONVERGENCE, Evaluated, config_of
from swarm_mj.evaluation.samples import bootstrap_interval
from swarm_mj.evaluation.study import MAX_MISSIONS
from swarm_mj.mission import Mission
from swarm_mj.protocol.mission_costs import MISSION_COSTS, MissionCost
from swarm_mj.simulation.components import CALLED_WITH
from swarm_mj.system.fields import kind_of
from swarm_mj.system.reading import open_file
from swarm_mj.system.streams import check_printable
from swarm_mj.system.writing import write_bytes

KINDS = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
REGIME = {spec.name: kind_of(spec) for spec in fields(Mission)} | dict.fromkeys(CALLED_WITH, str)
COSTS = [cost.column for cost in MISSION_COSTS]
# The types in a file that may stand for a kind: other programs store texts in several ways.
IS_KIND: dict[object, Callable[[pa.DataType], bool]] = {
    str: lambda found: pa.types.is_string(found) or pa.types.is_large_string(found),
    int: pa.types.is_integer,
    float: lambda found: pa.types.is_floating(found) or pa.types.is_integer(found),
    bool: pa.types.is_boolean,
}
DEFAULTS = {spec.name: spec.default for spec in fields(Mission)}
OPTIONAL = [spec.name for spec in fields(Mission) if NoneType in get_args(spec.type)]
NUMBERS = [*COSTS, *CONVERGENCE]  # of a mission
MAY_LACK = {*NUMBERS, *CALLED_WITH, *OPTIONAL}  # the columns that a mission may have no value of
LATER = (*CONVERGENCE, "pilot")  # files of before 1.1 lack these
KEYS = ["policy", *REGIME, "seed"]  # which tell missions apart
MAX_ROWS = MAX_MISSIONS  # of a file
COLUMNS = {"policy": str, "seed": int} | dict.fromkeys(NUMBERS, float) | REGIME


def write_missions(path: Path, evaluated: Sequence[Evaluated]) -> None:
    """Write a row for each mission, and into the metadata the study, as JSON.

    Args:
        path: The Parquet file, which is replaced if it exists.
        evaluated: The results of one study, at least one.

    Raises:
        OSError: The file cannot be written.
    """
    columns = [(name, KINDS[kind]) for name, kind in COLUMNS.items()]
    first = evaluated[0].result
    study = {  # what all results of a study share, and what tells them apart
        "version": first.version,
        "commit": first.commit,
        "episodes": first.episodes,
        "seed": first.seed,
        "baseline": first.baseline,
        "policies and regimes": [config_of(each.result) for each in evaluated],
    }
    rows: list[Mapping[str, object]] = []
    for each in evaluated:
        regime = config_of(each.result) | {"policy": each.result.policy}
        for index in range(len(each.aoi)):
            row = regime | {"seed": each.result.seed + index}
            for name, values in each.numbers.items():
                row[name] = values[index]
            rows.append(row)
    table = pa.Table.from_pylist(rows, pa.schema(columns, {"study": json.dumps(study)}))
    content = pa.BufferOutputStream()
    parquet.write_table(table, content)
    write_bytes(path, memoryview(content.getvalue()))


def read_missions(path: Path) -> pd.DataFrame:
    """Return the missions of a file that `write_missions` wrote, one a row.

    Raises:
        ValueError: The file is none of these, is damaged or cannot be read, or has a mission twice.
    """
    with open_file(path, "missions") as file:
        try:
            found = _in_columns(parquet.ParquetFile(file))
        except (pa.ArrowException, OSError, ValueError) as error:  # each of some kind of damage
            said = " ".join(str(error).split())
            raise ValueError(f"missions {path}: {said}; make them with --parquet") from error
    # What pandas may have written beside the columns, such as an index, is not ours.
    missions = found.to_pandas(ignore_metadata=True)
    for name, kind in COLUMNS.items():
        for text in missions[name].dropna().unique() if kind is str else ():
            try:
                check_printable(text, "write it without them")
            except ValueError as error:
                raise ValueError(f"missions {path}: in {name}, {error}") from error
    is_twice = missions.duplicated(KEYS)
    if is_twice.any():
        twice = missions[is_twice].iloc[0]
        raise ValueError(
            f"missions {path}: the one of policy {twice['policy']} and seed {twice['seed']} is "
            f"there more than once, as are {is_twice.sum() - 1} others, and one cannot "
            "say which is right; write the file anew with --parquet"
        )
    return missions


def _in_columns(file: parquet.ParquetFile) -> pa.Table:
    """Return a file's missions in the columns that `write_missions` writes, and no others.

    In a file without a newer field of `Mission`, that had its default. Raises ValueError for
    columns that lack or hold something else.
    """
    num_missions = file.metadata.num_rows
    if not 1 <= num_missions <= MAX_ROWS:
        raise ValueError(f"a file has from 1 to {MAX_ROWS} missions, not {num_missions}")
    there = file.schema_arrow.names
    for name in COLUMNS:
        if there.count(name) > 1:
            raise ValueError(f"it has several columns {name}")
    found = file.read(columns=[name for name in COLUMNS if name in there])
    columns: list[pa.ChunkedArray] = []
    for name, kind in COLUMNS.items():
        if name in there:
            columns.append(_column(name, kind, found.column(name)))
        elif name in DEFAULTS:
            default = pa.array([DEFAULTS[name]] * num_missions, KINDS[kind])
            columns.append(pa.chunked_array([default]))
        elif name in LATER:
            columns.append(pa.chunked_array([pa.nulls(num_missions, KINDS[kind])]))
        else:
            raise ValueError(f"it has no column {name}")
    return pa.table(columns, names=list(COLUMNS))


def _column(name: str, kind: object, found: pa.ChunkedArray) -> pa.ChunkedArray:
    """Return a column as its declared kind; raise ValueError for one that holds something else."""
    if found.null_count and name not in MAY_LACK:
        raise ValueError(f"column {name} lacks {found.null_count} values")
    is_kind = IS_KIND[kind](found.type) or pa.types.is_null(found.type)
    if not is_kind:
        raise ValueError(f"column {name} must hold {KINDS[kind]}, not {found.type!s:.80}")
    column = found.cast(KINDS[kind])
    if name in NUMBERS and np.isinf(column.to_numpy()).any():
        raise ValueError(f"column {name} holds an infinite number, which has no mean")
    return column


def compared(before: pd.DataFrame, after: pd.DataFrame, cost: MissionCost) -> pd.DataFrame:
    """Return how a cost differs, mission by mission: a row for each policy in each regime.

    Args:
        before: Missions, as `read_missions` returns them.
        after: The same, or others.
        cost: Which of their costs.

    Returns:
        Means before and after, their difference with its interval of 95 %, in the cost's unit, over
        the missions that both have, if there are any, and how many only one has. Without rows if
        no task has such a cost.
    """
    # As pandas names columns that both tables have.
    of_before = f"{cost.column}_x"
    of_after = f"{cost.column}_y"
    both = before.merge(after, "outer", KEYS, indicator=True)
    both = both.dropna(subset=[of_before, of_after], how="all")
    varied = ["policy"]
    for name in REGIME:  # those that tell regimes apart
        if len(both[[*varied, name]].drop_duplicates()) > len(both[varied].drop_duplicates()):
            varied.insert(-1, name)
    rows: list[Mapping[str, object]] = []
    for _, missions in both.groupby(varied, dropna=False):
        found = np.array(missions["_merge"])
        is_in_both = found == "both"
        shown = missions[is_in_both] if is_in_both.any() else missions
        old = np.array(shown[of_before], float)
        new = np.array(shown[of_after], float)
        difference = new - old
        ends = bootstrap_interval(difference[~np.isnan(difference)])
        row = {name: missions[name].iloc[0] for name in varied}
        row["before"] = old.mean()
        row["after"] = new.mean()
        row["difference"] = difference.mean()
        row["low"] = math.nan if ends.low is None else ends.low
        row["high"] = math.nan if ends.high is None else ends.high
        row["missions"] = is_in_both.sum()
        row["only before"] = (found == "left_only").sum()
        row["only after"] = (found == "right_only").sum()
        rows.append(row)
    return pd.DataFrame(rows)
