"""Costs of missions go by one name everywhere that they are stored, paid or told."""

from dataclasses import fields

from swarm_mj.evaluation.batch import BatchCosts
from swarm_mj.evaluation.results import Result
from swarm_mj.protocol.costs import WindowCosts
from swarm_mj.protocol.mission_costs import AOI, MISSION_COSTS, TASK_COST, VELOCITY_VARIANCE


def test_each_cost_is_a_column_of_results_and_a_number_of_each_mission():
    columns = {spec.name for spec in fields(Result)}
    of_missions = {spec.name for spec in fields(BatchCosts)}
    for cost in MISSION_COSTS:
        assert f"{cost.column}_mean" in columns
        assert cost.column in of_missions


def test_windows_tell_the_costs_by_their_names():
    assert {AOI.info, VELOCITY_VARIANCE.info, TASK_COST.info} <= set(WindowCosts._fields)


def test_names_are_different():
    assert len({cost.column for cost in MISSION_COSTS}) == len(MISSION_COSTS)
    assert len({cost.reward for cost in MISSION_COSTS}) == len(MISSION_COSTS)
    assert len({cost.info for cost in MISSION_COSTS}) == len(MISSION_COSTS)
    assert len({cost.title for cost in MISSION_COSTS}) == len(MISSION_COSTS)
