"""The table and the chart of large teams, from made-up results."""

import large_teams_figure as program
import numpy as np
import pytest
from synthetic import sweep

from swarm_mj.evaluation.results_files import read_results, write_results


def walks(policy, ages):
    return sweep(policy, "num_robots", ages, "random-walk", preset="paper")


@pytest.fixture
def folder(tmp_path):
    """Ages that grow with the root of the size, from 10 windows or 2 at 100 robots."""
    small = {10: (1.04, 0.06), 100: (10.0, 0.5)}
    rows = [*walks("csma", small), *walks("tdma", {10: (2.0, 0.25), 100: (2.0, 0.1)})]
    write_results(tmp_path / "large-teams-small.csv", rows)
    write_results(tmp_path / "large-teams.csv", walks("csma", {200: (20.0, 1.0), 800: (40.0, 2.0)}))
    return tmp_path


def test_the_table_has_ages_of_both_files_and_exponents_the_least_age_first(folder):
    assert program.table(folder).splitlines() == [
        "| policy | 10 robots | 100 | 200 | 800 | exponent |",
        "| --- | --- | --- | --- | --- | --- |",
        "| `tdma` | 2.0 ± 0.2 | 2.0 ± 0.1 |  |  |  |",
        "| `csma` | 1.0 ± 0.1 | 10.0 ± 0.5 | 20.0 ± 1.0 | 40.0 ± 2.0 | 0.50 |",
    ]


def test_the_exponent_is_that_of_large_teams():
    sizes = np.array([10.0, 20.0, 40.0, 80.0, 200.0, 400.0, 1000.0])
    ages = np.where(sizes < 200.0, 1.0, 3.0 * sizes**0.3)
    assert program.exponent(sizes, ages) == pytest.approx(0.3)


def test_the_chart_has_a_curve_for_each_policy_over_the_sizes_of_both_files(folder):
    found = program.read(folder)
    drawn = {curve.method: curve.x.tolist() for curve in program.own_curves(found)}
    assert drawn == {"csma": [10.0, 100.0, 200.0, 800.0], "tdma": [10.0, 100.0]}
    (axes,) = program.draw(found).axes
    assert axes.get_xscale() == "log"
    assert len(read_results(folder / "large-teams.csv")) == 2
