import csv

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm
from training import bounds
from training.bounds import (
    exact_age,
    floor_windows,
    hop_counts,
    most_informed,
    most_receptions,
    slots_of,
)

RADIO = radio_of(paper("stationary"))  # reaches 250 m in silence


def links_at(*position_m):
    return links_between(RADIO, np.array(position_m, dtype=float))


PAIR = links_at((0, 0), (100, 0))
TRIANGLE = links_at((0, 0), (100, 0), (0, 100))
LINE = links_at((0, 0), (200, 0), (400, 0))


def test_two_robots_reach_their_floor():
    """They take turns: one age of a slot and three of 0 at each window's end."""
    low, high = exact_age(PAIR, cap=6)
    assert low == pytest.approx(0.5 / 4, abs=1e-3)
    assert high == pytest.approx(0.5 / 4, abs=1e-3)
    assert floor_windows(PAIR, seconds=5.0) == pytest.approx(0.5 / 4)


@pytest.mark.parametrize("links", [TRIANGLE, LINE], ids=["triangle", "line"])
def test_the_floor_is_below_the_exact_optimum(links):
    low, high = exact_age(links, cap=6)
    assert high - low < 2e-3
    assert 0.4 * low < floor_windows(links, seconds=5.0) <= low + 1e-9


def test_three_robots_in_range_need_three_slots_of_turns():
    """By hand: one sends a slot, all hear it. Window ends see r1's turn at lags 0, 1, 2 slots."""
    low, _ = exact_age(TRIANGLE, cap=6)
    # A period of three slots has ages 0, 1, 2 slots at every end, each at two of three robots.
    assert low == pytest.approx(2 * (0 + 1 + 2) / 9 / 2, abs=1e-3)


def test_a_lone_sender_is_heard_by_all_in_range_and_two_jam_each_other():
    """In the middle of the line both ends are equally strong; each end hears the middle only."""
    heard = {tuple(row) for row in slots_of(LINE).tolist()}
    assert heard == {(0, 1, 2), (0, 0, 2), (0, 2, 2), (1, 1, 1), (0, 1, 1), (1, 1, 2)}


def test_receptions_of_a_slot_are_counted_exactly_in_small_teams():
    for links in (PAIR, TRIANGLE, LINE):
        heard = slots_of(links)
        most = np.max(np.sum(heard != np.arange(heard.shape[1]), axis=1))
        assert most_receptions(links, seconds=5.0) == most


def test_no_slot_of_a_large_team_has_more_receptions_than_proven():
    mission = paper("stationary", num_robots=16)
    swarm = Swarm(mission, [5])
    links = swarm.truth.links(swarm.states.position_m[0], 0)
    most, rng = most_receptions(links, seconds=2.0), np.random.default_rng(1)
    found = 0
    for _ in range(400):
        recipient = np.where(rng.random((1, 16)) < rng.uniform(0.02, 0.4), -1, np.arange(16))
        heard = RADIO(swarm.states.position_m, recipient)
        found = max(found, np.count_nonzero(heard != np.arange(16)))
    assert 8 <= found <= most < 16


def test_informed_pairs_double_until_receptions_or_hops_limit_them():
    """Eight in a row that one slot's 5 receptions serve: 8 + 5, then 2, then 4 for each."""
    hops = np.abs(np.arange(8)[:, None] - np.arange(8)).astype(float)
    by_hops = [np.count_nonzero(hops <= length) for length in range(1, 8)]
    expected = [min(13, by_hops[0]), min(23, by_hops[1]), min(43, by_hops[2])]
    assert most_informed(hops, 5)[:3].tolist() == expected
    assert most_informed(hops, 5)[-1] == 64


def test_hops_are_counted_over_links_in_silence():
    assert hop_counts(LINE).tolist() == [[0, 1, 2], [1, 0, 1], [2, 1, 0]]


def test_a_table_of_small_teams_stands_beside_the_floors(tmp_path, monkeypatch):
    monkeypatch.setattr(bounds, "SMALL_TEAMS", {"two": ((0, 0), (100, 0))})
    monkeypatch.setattr(bounds, "RANGE_RATIOS", (1.0,))
    assert bounds.run(bounds.Settings(teams=1, robots=3, out=tmp_path / "floor.csv")) == 0
    with (tmp_path / "exact.csv").open(newline="") as file:
        [row] = csv.DictReader(file)
    assert row["team"] == "two"
    # One of four ages is a slot, half a window.
    assert float(row["floor_windows"]) == pytest.approx(1 / 8)
    assert float(row["optimum_windows"]) == pytest.approx(1 / 8, abs=1e-3)
    assert float(row["ratio"]) == pytest.approx(1.0, abs=1e-2)
    assert (tmp_path / "floor.csv").exists()
