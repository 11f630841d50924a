"""The connectivity floor against networkx, hand arithmetic, and every radio policy."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.evaluation.lower_bound import ConnectivityFloor
from swarm_mj.mission import paper
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


def on_a_line(*x_m):
    return np.array([[(x, 0.0) for x in x_m]])


def test_a_connected_team_knows_everything():
    floor = ConnectivityFloor(1, 4, 1.0)
    for t in (1.0, 2.0, 3.0):
        assert floor.next(on_a_line(0.0, 1.0, 2.0, 3.0), np.array([t])) == [0.0]


def test_a_courier_brings_what_it_last_knew():
    """0 and 2 never meet; 1 goes from one to the other."""
    floor = ConnectivityFloor(1, 3, 1.0)
    near_0, near_2 = on_a_line(0.0, 1.0, 9.0), on_a_line(0.0, 8.0, 9.0)
    # t = 1: {0, 1}, {2}: four pairs are 1 old.
    assert floor.next(near_0, np.array([1.0])) == pytest.approx([4 / 9])
    # t = 2: {0}, {1, 2}: 0 knows 1 from t = 1 and never met 2 (2 old);
    # 1 and 2 know 0 from t = 1, which 1 brought.
    assert floor.next(near_2, np.array([2.0])) == pytest.approx([(1 + 2 + 1 + 1) / 9])
    # t = 3: back again: 0 and 1 know 2 from t = 2; 2 knows 0 from t = 1 and 1 from t = 2.
    assert floor.next(near_0, np.array([3.0])) == pytest.approx([(1 + 1 + 2 + 1) / 9])


def test_who_is_off_passes_nothing_on_and_does_not_count():
    """1 is between 0 and 2, and is switched off after the first window."""
    floor, place_m = ConnectivityFloor(1, 3, 1.0), on_a_line(0.0, 1.0, 2.0)
    assert floor.next(place_m, np.array([1.0])) == [0.0]
    is_on = np.array([[True, False, True]])
    # 0 and 2 know each other from t = 1, and themselves.
    assert floor.next(place_m, np.array([2.0]), is_on) == pytest.approx([2 * 1 / 4])
    assert floor.next(place_m, np.array([3.0]), is_on) == pytest.approx([2 * 2 / 4])
    assert floor.next(place_m, np.array([4.0]), np.ones((1, 3), dtype=bool)) == [0.0]


def test_neighbours_are_at_most_the_range_apart():
    assert ConnectivityFloor(1, 2, 1.0).next(on_a_line(0.0, 1.0), np.ones(1)) == [0.0]
    assert ConnectivityFloor(1, 2, 1.0).next(on_a_line(0.0, 1.01), np.ones(1)) == [0.5]


@given(seed=st.integers(0, 2**32 - 1), num_missions=st.integers(1, 3), num_robots=st.integers(2, 9))
def test_floor_as_by_components_of_a_graph(seed, num_missions, num_robots):
    rng = np.random.default_rng(seed)
    floor = ConnectivityFloor(num_missions, num_robots, 0.4)
    newest = np.zeros((num_missions, num_robots, num_robots))
    for t in (1.0, 2.0, 3.0, 4.0):
        position_m = rng.random((num_missions, num_robots, 2))
        found = floor.next(position_m, np.full(num_missions, t))
        for b in range(num_missions):
            places = dict(enumerate(position_m[b]))
            graph = nx.random_geometric_graph(num_robots, 0.4, pos=places)
            np.fill_diagonal(newest[b], t)
            for part in nx.connected_components(graph):
                members = sorted(part)
                newest[b, members] = newest[b, members].max(axis=0)
            assert found[b] == pytest.approx(np.mean(t - newest[b]))


@pytest.mark.parametrize(
    ("name", "task"),
    [*((name, "random-walk") for name in POLICIES), ("mst", "stationary"), ("mst", "flocking")],
)
def test_no_policy_goes_below_the_floor(name, task):
    """Teams so fast and sparse that they fall apart."""
    _assert_above_the_floor(
        name, paper(task, num_robots=8, num_windows=60, velocity_ratio=2.0, boundary="reflect")
    )


@pytest.mark.parametrize("name", ["random-flooding", "mst", "tdma"])
def test_nor_with_robots_that_fail(name):
    _assert_above_the_floor(
        name,
        paper(
            "random-walk", num_robots=8, num_windows=60, velocity_ratio=2.0, failure_fraction=0.4
        ),
    )


def _assert_above_the_floor(name, mission):
    swarm = Swarm(mission, [1, 2, 3])
    floor = ConnectivityFloor(3, 8, mission.range_m)
    floors = []
    for flown in rollout(swarm, make_policy(name, mission)):
        floors.append(floor.next(swarm.states.position_m, swarm.now, swarm.states.is_active))
        assert np.all(flown.costs.age_windows >= floors[-1] - 1e-9)
    assert (np.max(floors) > 0.0) == (mission.task != "stationary")
