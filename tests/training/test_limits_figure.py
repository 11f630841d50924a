from dataclasses import replace

import numpy as np
import pytest
from synthetic import result

import swarm_mj
from swarm_mj.evaluation.missions_table import write_missions
from swarm_mj.evaluation.results_files import write_results
from swarm_mj.mission import paper
from training import limits_figure
from training.limits_figure import (
    Compared,
    draw_limits,
    exact_table,
    oracles_table,
    read_floor,
    table,
)

HEADER = "range_ratio,floor_windows,commit\n"


@pytest.fixture
def floor(tmp_path):
    path = tmp_path / "floor.csv"
    path.write_text(HEADER + "0.5,1.0,abcdef012345\n0.25,2.0,abcdef012345\n0.25,3.0,abcdef012345\n")
    return path


def test_the_floor_is_the_mean_over_the_teams_of_a_range_ratio(floor):
    with np.errstate(invalid="ignore", divide="ignore"), pytest.warns(RuntimeWarning):
        curve, made_by = read_floor(floor)  # one team alone has no standard error
    assert curve.x.tolist() == [0.25, 0.5]
    assert curve.mean.tolist() == [2.5, 1.0]
    assert curve.sem[0] == pytest.approx(0.5)  # std of 2 and 3 is 1 / sqrt(2), of 2 teams
    assert made_by == "abcdef012345"


def test_floors_of_two_commits_are_refused(floor):
    floor.write_text(floor.read_text() + "0.5,1.0,beef\n")
    with pytest.raises(ValueError, match="must be of one commit"):
        read_floor(floor)


def test_the_floor_is_named_under_the_policies_and_its_commit_stands_below(floor):
    floor.write_text(floor.read_text() + "0.5,1.2,abcdef012345\n")
    base = replace(result("tdma"), task="stationary", num_robots=40)
    rows = [replace(base, range_ratio=x, aoi_mean=9.0) for x in (0.25, 0.5)]
    searched = replace(rows[0], policy="training.ceiling:Annealed", episodes=3)  # fewer
    figure = draw_limits(rows, [searched], *read_floor(floor))
    texts = {text.get_text() for text in figure.findobj(lambda a: hasattr(a, "get_text"))}
    assert {"tdma", "proven floor", "searched schedule"} <= texts
    assert any("abcdef0" in text for text in texts)


def steady(policy, ages, **overrides):
    """Results whose age in the second half of the missions is given by range ratio."""
    return [
        result(policy, range_ratio=ratio, aoi_steady_mean=age, aoi_steady_sem=0.25, **overrides)
        for ratio, age in ages.items()
    ]


@pytest.fixture
def folder(tmp_path, floor):
    floor.write_text(floor.read_text() + "0.5,1.0,abcdef012345\n")
    write_results(
        tmp_path / "ceiling.csv", steady("training.ceiling:Annealed", {0.25: 5.0, 0.5: 4.0})
    )
    flown = steady("planner --payload none", {0.5: 8.0, 0.25: 6.25}) + steady("tdma", {0.25: 20.0})
    write_results(tmp_path / "paper-stationary.csv", flown)
    return tmp_path


def test_the_table_divides_the_floor_by_the_schedule_and_that_by_the_planner(folder):
    assert table(folder).splitlines() == [
        "| range ratio | 0.25 | 0.5 |",
        "| --- | --- | --- |",
        "| proven floor | 2.50 | 1.00 |",
        "| searched schedule, steady state | 5.00 ± 0.25 | 4.00 ± 0.25 |",
        "| `planner --payload none`, steady state | 6.25 ± 0.25 | 8.00 ± 0.25 |",
        "| floor / searched schedule | 0.50 | 0.25 |",
        "| searched schedule / planner | 0.80 | 0.50 |",
    ]


def test_a_table_without_a_range_ratio_of_the_floor_is_refused(folder):
    write_results(folder / "ceiling.csv", steady("training.ceiling:Annealed", {0.25: 5.0}))
    with pytest.raises(ValueError, match=r"has no training.ceiling:Annealed at range ratio 0.5"):
        table(folder)


def test_small_teams_stand_in_a_table_of_their_own(tmp_path):
    (tmp_path / "exact.csv").write_text(
        "team,floor_windows,optimum_windows,ratio,commit\ntwo,0.125,0.25,0.5,abcdef012345\n"
    )
    _, _, team, _, origin = exact_table(tmp_path).splitlines()
    assert team == "| two | 0.125 | 0.250 | 0.50 |"
    assert "commit abcdef012345." in origin


@pytest.fixture
def oracles(tmp_path, monkeypatch):
    """Both oracles' costs of three flights."""
    mission = paper("flocking", num_robots=5, num_windows=8)
    where = {"task": "flocking", "num_robots": 5}
    compared = Compared(head="five", results="both", where=where)
    at_rest = Compared(head="rest", results="both", where=where | {"task": "stationary"})
    monkeypatch.setattr(limits_figure, "COMPARED", (compared, at_rest))
    rest = paper("stationary", num_robots=5, num_windows=8)
    costs = {}
    flown = []
    for name in ("lookahead-oracle", "greedy-oracle"):
        [flocks] = swarm_mj.evaluate((name,), mission, num_missions=3, seed=4).results
        [resting] = swarm_mj.evaluate((name,), rest, num_missions=3, seed=4).results
        flown += [flocks, resting]
        costs[name] = [flocks.aoi, flocks.velocity_variance, resting.aoi]
    write_missions(tmp_path / "both.parquet", flown)
    return tmp_path, costs


def cells(ahead, greedy, digits):
    """Two means and that of the differences, with their standard errors."""
    a = np.array(ahead)
    b = np.array(greedy)
    return [
        f"{each.mean():.{digits}f} ± {each.std(ddof=1) / np.sqrt(3):.{digits}f}"
        for each in (a, b, a - b)
    ]


def test_oracles_are_compared_mission_by_mission(oracles):
    folder, costs = oracles
    heads, _, flocks, rest = (
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in oracles_table(folder).splitlines()
    )
    assert heads[:4] == ["missions", "age, `lookahead-oracle`", "`greedy-oracle`", "difference"]
    age, variance, age_at_rest = zip(*costs.values(), strict=True)
    assert flocks == ["five", *cells(*age, 2), *cells(*variance, 4)]
    assert rest == ["rest", *cells(*age_at_rest, 2), "", "", ""]


def test_oracles_that_flew_other_missions_are_not_compared(oracles):
    folder, _ = oracles
    mission = paper("flocking", num_robots=5, num_windows=8)
    flown = [
        *swarm_mj.evaluate(("lookahead-oracle",), mission, num_missions=3, seed=4).results,
        *swarm_mj.evaluate(("greedy-oracle",), mission, num_missions=3, seed=5).results,
    ]
    write_missions(folder / "both.parquet", flown)
    with pytest.raises(ValueError, match="both oracles must have flown the same missions of five"):
        oracles_table(folder)
