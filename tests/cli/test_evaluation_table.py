"""Tables of results: whole at 100 columns, the freshest first, one per regime."""

from dataclasses import fields
from typing import get_args

import pytest

from swarm_mj.cli.evaluation_table import print_results
from swarm_mj.evaluation.results import Result


def some_result(policy, aoi_mean, **overrides):
    """A result whose other numbers are 1."""
    values = {
        spec.name: {str: "paper", int: 1, float: 1.0}[(get_args(spec.type) or (spec.type,))[0]]
        for spec in fields(Result)
    }
    return Result(**values | {"policy": policy, "aoi_mean": aoi_mean} | overrides)


NOTHING = {spec.name: None for spec in fields(Result) if type(None) in get_args(spec.type)}
LARGEST = {
    "aoi_sem": 12.345,
    "aoi_ci_low": 100.001,
    "aoi_ci_high": 222.222,
    "aoi_median": 123.456,
    "aoi_p95": 234.567,
    "aoi_difference_mean": -123.456,
    "aoi_difference_ci_low": -222.222,
    "aoi_difference_ci_high": -111.111,
    "velocity_variance_mean": 12.3456,
    "packets_per_window": 79.987,
    "published_aoi_mean": 115.7268,
    "published_aoi_sem": 12.964,
}


@pytest.fixture
def printed(capsys, monkeypatch):
    """What is printed on a console of so many columns."""

    def lines(results, columns):
        monkeypatch.setenv("COLUMNS", str(columns))
        print_results(results)
        return capsys.readouterr().out.splitlines()

    return lines


@pytest.mark.parametrize("columns", [60, 100])
def test_the_largest_numbers_are_whole_at_100_columns(printed, columns):
    results = [some_result("random-flooding", 123.456, **LARGEST), some_result("mst", 1.0)]
    lines = printed(results, columns)
    assert max(map(len, lines)) <= 100
    text = "\n".join(lines)
    assert "…" not in text
    for number in ("123.46 ± 12.35", "100.00, 222.22", "-222.22, -111.11", "115.73 ± 12.96"):
        assert number in text


def test_the_freshest_comes_first_in_each_regime(printed):
    results = [
        some_result("a", 3.0),
        some_result("b", 1.0),
        some_result("c", 2.0),
        some_result("d", 9.0, task="flocking"),
        some_result("e", 8.0, task="flocking"),
    ]
    lines = printed(results, 100)
    order = [line[0] for line in lines if line[:2] in {f"{name} " for name in "abcde"}]
    assert order == ["b", "c", "a", "e", "d"]
    assert sum("preset paper: 1 robots" in line for line in lines) == 2


def test_regimes_in_which_robots_fail_are_apart_and_say_so(printed):
    results = [some_result("a", 3.0, switched_off=0.0), some_result("a", 4.0, switched_off=0.2)]
    lines = printed(results, 100)
    assert sum("preset paper: 1 robots" in line for line in lines) == 2
    assert [line for line in lines if "windows of" in line] == [
        "1 windows of paper physics",
        "1 windows of paper physics, 20% of the robots off half-way",
    ]


def test_what_does_not_exist_is_a_dash(printed):
    lines = printed([some_result("mst", 2.0, **NOTHING)], 100)
    first = next(index for index, line in enumerate(lines) if line.startswith("mst"))
    assert lines[first].split() == ["mst", "2.00", "1.00", "1.00", "-", "1.0000", "1.00", "-"]
    assert lines[first + 1].split() == ["-"]  # of no packets, no share arrived


def test_the_floor_stands_below(printed):
    lines = printed([some_result("a", 1.0), some_result("b", 2.0, aoi_floor_mean=1.75)], 100)
    assert "connectivity floor: 1.00 to 1.75, by policy" in lines
    assert "connectivity floor: 1.00" in printed([some_result("a", 1.0)], 100)
