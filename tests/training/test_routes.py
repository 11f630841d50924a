"""Whom robots address, by hand: a line of four, and a short flight."""

import csv

import numpy as np
import pytest
import routes

from swarm_mj.system.exit_codes import DONE


def test_a_route_is_a_teammate_heard_directly_that_brought_others_news():
    """Robot 0 heard 1 and 3 directly; 2's news came over 1, and nothing else came over 3."""
    parent = np.full((1, 4, 4), -1)
    parent[0, 0] = [-1, 0, 1, 0]
    found = routes.on_route(parent)
    assert found[0, 0].tolist() == [False, True, False, False]
    assert not found[0, 1:].any()


def test_news_over_two_hops_makes_a_route_of_the_nearer_hop_alone():
    parent = np.full((1, 4, 4), -1)
    parent[0, 0] = [-1, 0, 1, 2]
    assert routes.on_route(parent)[0, 0].tolist() == [False, True, False, False]


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    path = tmp_path_factory.mktemp("routes") / "routes.csv"
    few = ["--missions", "2", "--robots", "12", "--windows", "60", "--ratios", "0.25", "1"]
    assert routes.main([*few, "--out", str(path)]) == DONE
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_the_tree_addresses_nearer_teammates_than_a_draw_would(flown):
    rows = [row for row in flown if row["policy"] == "mst"]
    assert [float(row["range_ratio"]) for row in rows] == [0.25, 1.0]
    for row in rows:
        assert float(row["apart_ranges_mean"]) < float(row["drawn_apart_ranges_mean"])
        assert float(row["near_mean"]) > float(row["drawn_near_mean"])


def test_shares_are_shares_and_say_their_missions(flown):
    assert [row["policy"] for row in flown] == ["gnn", "gnn", "mst", "mst"]
    for row in flown:
        assert (row["episodes"], row["seed"]) == ("2", "4500")
        for name in ("near_mean", "drawn_near_mean", "on_route_mean", "drawn_on_route_mean"):
            assert 0.0 <= float(row[name]) <= 1.0


def test_missions_in_which_nobody_speaks_are_an_error(tmp_path, capsys):
    assert routes.main(["--windows", "1", "--missions", "2", "--out", str(tmp_path / "r.csv")]) == 2
    assert "a mean needs 2" in capsys.readouterr().err
