"""The README's tables, from made-up results."""

from importlib import import_module

import pytest
from synthetic import result, sweep

from swarm_mj.evaluation.results import write_results


@pytest.fixture(scope="module")
def tool():
    return import_module("results_table")


@pytest.fixture
def printed(tool, tmp_path, capsys):
    """What the tool prints of some results."""

    def printed_of(rows):
        write_results(tmp_path / "some.csv", rows)
        assert tool.main([str(tmp_path / "some.csv")]) == 0
        return capsys.readouterr().out

    return printed_of


def test_policies_down_the_swept_number_across_the_least_cost_first(printed):
    rows = [
        *sweep("mst", "range_ratio", {0.25: (43.0, 1.0), 0.5: (16.54, 0.1)}),
        *sweep("greedy-oracle", "range_ratio", {0.5: (5.0, 0.25), 0.25: (12.04, 0.06)}),
    ]
    assert printed(rows) == (
        "stationary, preset reference\n\n"
        "| range ratio, age of information [windows] | 0.25 | 0.5 |\n"
        "| --- | --- | --- |\n"
        "| greedy-oracle | 12.0 ± 0.1 | 5.0 ± 0.2 |\n"
        "| mst | 43.0 ± 1.0 | 16.5 ± 0.1 |\n\n"
    )


def test_bit_rates_stand_across_and_team_sizes_apart(printed):
    rows = [
        result("tdma", aoi_mean=float(age), bit_rate=rate, num_robots=robots)
        for robots, rate, age in [(40, None, 1), (40, 250e3, 2), (80, None, 3), (80, 1e6, 4)]
    ]
    lines = printed(rows).splitlines()
    heads = [line for line in lines if line.startswith("| bit rate")]
    assert [head.split("|")[2:4] for head in heads] == [
        [" 250 kbit/s ", " no limit "],
        [" 1 Mbit/s ", " no limit "],
    ]
    assert [line.split(", ")[-1] for line in lines if "preset" in line] == [
        "40 robots",
        "80 robots",
    ]


def test_payloads_beyond_the_papers_are_named(tool):
    rows = [
        result("planner", aoi_mean=1.0, payload="snapshots"),
        result("tdma", aoi_mean=2.0, payload="none"),
    ]
    lines = tool.table(rows, "aoi").splitlines()
    assert lines[2].startswith("| planner (packets carry more than T, M, P) |")
    assert lines[3].startswith("| tdma |")


def test_robots_that_fail_have_a_table_of_their_own(printed):
    rows = [
        result("mst", aoi_mean=43.0, aoi_sem=1.0),
        result("mst", aoi_mean=50.0, aoi_sem=1.0, failure_fraction=0.2),
    ]
    said = printed(rows)
    assert "stationary, preset reference\n\n|" in said
    assert "stationary, preset reference, 20% of the robots off half-way\n\n|" in said


def test_published_values_stand_in_brackets_and_flocks_have_a_second_table(tool):
    flock = result(
        "mst",
        "flocking",
        aoi_mean=46.0,
        aoi_sem=1.25,
        published_aoi_mean=46.2565,
        published_aoi_sem=1.48173,
        velocity_variance_mean=0.1701,
        velocity_variance_sem=0.0123,
    )
    assert "| mst | 46.0 ± 1.2 (46.3 ± 1.5) |" in tool.table([flock], "aoi")
    assert "| mst | 0.170 ± 0.012 |" in tool.table([flock], "velocity_variance")


def test_a_policy_missing_somewhere_and_one_without_errors(tool):
    rows = [
        *sweep("mst", "num_robots", {10: (11.0, None), 20: (22.0, None)}, task="random-walk"),
        *sweep("tdma", "num_robots", {20: (9.0, 1.0)}, task="random-walk"),
    ]
    table = tool.table(rows, "aoi").splitlines()
    assert table[2:] == ["| tdma |  | 9.0 ± 1.0 |", "| mst | 11.0 | 22.0 |"]
