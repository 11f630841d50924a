"""Tables of the page on the paper's claims, from made-up rows."""

import csv
import json
import math

import claims
import pytest
from synthetic import result

from swarm_mj.evaluation.results_files import write_results


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "reproduce" / "quick").mkdir(parents=True)
    return tmp_path


@pytest.fixture
def trained(tmp_path):
    """Write tables of a figure's trainings."""

    def write(figure, name, rows):
        (tmp_path / figure).mkdir(exist_ok=True)
        with (tmp_path / figure / f"{name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows(rows)

    return write


def cells(markdown):
    """Return the rows of the table, below its head and its line."""
    lines = [line for line in markdown.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def cost(mean, sem, policy="mst"):
    return {"policy": policy, "aoi_mean": mean, "aoi_sem": sem}


def test_a_margin_is_the_mean_of_the_seeds_below_the_best_baseline():
    """Ages 20, 30 and 40 are 30 in the mean; 60 is the least of the baselines."""
    gnns = [cost(20.0, 2.0), cost(30.0, 3.0), cost(40.0, 4.0)]
    found = claims.margin(gnns, [cost(70.0, 1.0), cost(60.0, 4.0)])
    assert found.windows == pytest.approx(30.0)
    assert found.windows_sem == pytest.approx(5.0)  # of 3 and 4
    assert found.share == pytest.approx(0.5)
    # Half of the age's relative error, 3 / 30, and the baseline's, 4 / 60.
    assert found.share_sem == pytest.approx(0.5 * math.sqrt(0.1**2 + (4 / 60) ** 2))


def test_a_margin_over_nothing_is_refused():
    with pytest.raises(ValueError, match="needs a GNN and a baseline"):
        claims.margin([cost(20.0, 1.0)], [])


def test_margins_are_of_each_range_ratio_and_beside_the_published_ones(folder):
    ratios = (0.2, 0.25, 0.5, 0.75, 1.0)
    gnns = [
        result(policy, range_ratio=ratio, aoi_mean=30.0, aoi_sem=3.0)
        for ratio in ratios
        for policy in ("one GNN", "one GNN, seed 2", "one GNN, another")
    ]
    baselines = [
        result(policy, range_ratio=ratio, aoi_mean=age, aoi_sem=4.0)
        for ratio in ratios
        for policy, age in (("mst", 40.0), ("round-robin", 60.0), ("tdma", 10.0))
    ]
    write_results(folder / "reproduce" / "quick" / "one.csv", gnns)
    write_results(folder / "paper-stationary.csv", baselines)
    windows, share, published, published_share = cells(claims.margins(folder))
    assert windows == ["ours [windows]", *["10.0 ± 5.0"] * 5]
    assert share == ["ours [%]", *["25 ± 11"] * 5]  # 0.75 times the root of 0.1² and 0.1²
    # At 0.25 the GNN has 34.79 ± 0.741, MST 43.3069 ± 0.97449: 8.5 ± 1.2, of 43.3.
    assert published[:3] == ["published [windows]", "0.9 ± 2.1", "8.5 ± 1.2"]
    assert published_share[2] == "20 ± 2"


def test_the_rank_correlation_of_three_by_hand():
    """1 - 6 Σd² / (n (n² - 1)): ranks 1, 2, 3 and 1, 3, 2 differ by 0, 1 and 1."""
    rows = [
        {"aoi_mean": age, "velocity_variance_mean": variance}
        for age, variance in ((1.0, 0.1), (2.0, 9.0), (50.0, 0.2))
    ]
    assert claims.rank_correlation(rows) == pytest.approx(1 - 6 * 2 / (3 * 8))


def test_correlations_with_and_without_those_who_know_more(folder):
    costs = {"planner": (1.0, 4.0), "mst": (2.0, 1.0), "tdma": (3.0, 2.0), "gossip": (4.0, 3.0)}
    flown = [
        result(
            policy, "flocking", velocity_ratio=ratio, aoi_mean=age, velocity_variance_mean=variance
        )
        for ratio in (0.15, 0.25, 0.325, 0.5)
        for policy, (age, variance) in costs.items()
    ]
    write_results(folder / "paper-flocking.csv", flown)
    every, others = cells(claims.correlation(folder))
    # Ranks 1, 2, 3, 4 and 4, 1, 2, 3 differ by 3, 1, 1 and 1: 1 - 6 * 12 / (4 * 15).
    assert every == ["all policies (4)", *["-0.20"] * 4]
    assert others == ["without `planner` and the oracles (3)", *["1.00"] * 4]


def test_trainings_are_counted_by_figure(trained, tmp_path):
    for figure, decisions in (("fig4", (40448, 60416)), ("fig6", (40448,))):
        rows = [
            {
                "decisions": each,
                "minutes": 2.4,
                "commit": "abc123",
                "settings": json.dumps({"seed": seed}),
            }
            for seed, each in enumerate(decisions, start=1)
        ]
        trained(figure, "trainings", rows)
    assert cells(claims.trainings(tmp_path, tmp_path)) == [
        ["fig4", "2", "1, 2", "40,448 to 60,416", "5", "abc123"],
        ["fig6", "1", "1", "40,448", "2", "abc123"],
    ]


def test_no_trainings_are_no_table(tmp_path):
    with pytest.raises(ValueError, match="no table of trainings"):
        claims.trainings(tmp_path, tmp_path)
