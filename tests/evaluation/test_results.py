"""The columns of results, and the statistics of each cost among them."""

import math
from dataclasses import dataclass, fields, replace

import pytest
from synthetic import result

from swarm_mj.evaluation.measurements import column, later_column
from swarm_mj.evaluation.results import COLUMNS, Result, computation, statistics_of
from swarm_mj.protocol.mission_costs import AOI, TASK_COST, VELOCITY_VARIANCE


def test_a_column_that_nothing_computes_is_named_at_once():
    """`Result` is checked by the same function when it is imported."""

    @dataclass(kw_only=True)
    class Planted:
        median: float = column(lambda own: own.aoi.median)
        newest: float | None = later_column(lambda own: own.aoi.std, older=None)
        forgotten: float | None = None

    median, newest, forgotten = fields(Planted)
    assert callable(computation(median))
    assert callable(computation(newest))
    with pytest.raises(TypeError, match=r"nothing computes the column forgotten of Result; decl"):
        computation(forgotten)
    assert tuple(spec.name for spec in fields(Result)) == COLUMNS


def test_each_cost_has_the_statistics_of_its_own_columns():
    row = result(
        "mst",
        aoi_mean=40.0,
        aoi_sem=1.5,
        aoi_ci_low=37.0,
        aoi_ci_high=43.0,
        velocity_variance_mean=0.2,
        velocity_variance_sem=None,
        velocity_variance_ci_low=None,
        velocity_variance_ci_high=0.3,
        task_cost_mean=7.0,
        task_cost_sem=0.5,
    )
    assert statistics_of(row, AOI) == (40.0, 1.5, 37.0, 43.0)
    assert statistics_of(row, VELOCITY_VARIANCE) == (0.2, None, None, 0.3)
    assert statistics_of(row, TASK_COST) == (7.0, 0.5, None, None)
    assert math.isnan(statistics_of(result("mst"), TASK_COST).mean)
    with pytest.raises(ValueError, match="results have no cost fuel"):
        statistics_of(row, replace(AOI, column="fuel"))
