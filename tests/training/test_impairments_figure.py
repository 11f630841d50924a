"""The table of impairments: names, and the arithmetic of ratios, from made-up results."""

import impairments_figure as program
import numpy as np
import pytest
from synthetic import result

from swarm_mj.evaluation.results_files import write_results

MISSIONS = {  # by the impairments' names
    "none": {},
    "30% of packets lost": {"erasure": 0.3},
    "bursts, 0.02 per slot": {"burst_begin": 0.02},
    "30% of robots fail": {"failure_fraction": 0.3},
    "clocks 20 ms apart": {"clock_offset_s": 0.02},
    "clocks drift 800 ppm": {"clock_drift_ppm": 800.0},
    "correct map": {"arena": "blocks"},
    "map 50 m off": {"arena": "blocks", "map_offset_m": 50.0},
}
FACTORS = {"none": 1.0, "correct map": 3.0, "map 50 m off": 12.0}


@pytest.fixture
def found():
    """Ages of 10 windows, 4 of the other policy; impairments double them, a wrong map times 4."""
    return [
        result(policy, task, "paper", aoi_mean=age * FACTORS.get(name, 2.0), **mission)
        for policy, age in (("tdma", 10.0), ("planner", 4.0))
        for task in program.TASKS
        for name, mission in MISSIONS.items()
    ]


def test_impairments_have_a_name_each(found):
    assert list(dict.fromkeys(map(program.impairment, found))) == list(MISSIONS)


def test_a_ratio_is_an_age_over_that_without_the_impairment(found):
    policies, names, ratio = program.ratios(found)
    assert policies == ["planner", "tdma"]  # the lowest ages first
    assert names == [name for name in MISSIONS if name not in program.USUAL]
    expected = [4.0 if name.startswith("map") else 2.0 for name in names]
    np.testing.assert_allclose(ratio, np.broadcast_to(expected, (3, 2, len(names))))


def test_factors_of_the_table_are_geometric_means_over_the_tasks(found, tmp_path):
    lost = [each for each in found if program.impairment(each) in ("none", "30% of packets lost")]
    rows = [
        result("tdma", "stationary", "paper", aoi_mean=160.0, erasure=0.3)
        if (each.policy, each.task, program.impairment(each))
        == ("tdma", "stationary", "30% of packets lost")
        else each
        for each in lost
    ]
    write_results(tmp_path / "impairments.csv", rows)
    assert program.docs_table(tmp_path).splitlines() == [
        "| policy | at rest | walking | flocking | 30% of packets lost |",
        "| --- | --- | --- | --- | --- |",
        "| `planner` | 4.0 | 4.0 | 4.0 | 2.00 |",
        "| `tdma` | 10.0 | 10.0 | 10.0 | 4.00 |",  # of 16, 2 and 2
    ]


def test_the_chart_has_a_map_for_each_task(found):
    figure = program.draw(found)
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == list(program.TASKS)
