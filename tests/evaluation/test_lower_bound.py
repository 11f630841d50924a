"""The connectivity floor against networkx, hand arithmetic, and every radio policy."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.evaluation.lower_bound import share_connected
from swarm_mj.mission import paper
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


def empty(num_missions, num_robots):
    return np.full((num_missions, num_robots, num_robots), NEVER)


def aged(known, x_m, t, is_on=None):
    """The age at t of one mission's robots on a line with a range of 1 m, all on unless given."""
    position_m, on = np.array([[(x, 0.0) for x in x_m]]), [is_on or [True] * len(x_m)]
    return share_connected(known, position_m, 1.0, np.array([float(t)]), np.array(on))


def test_a_connected_team_knows_everything():
    known = empty(1, 4)
    for t in (1.0, 2.0, 3.0):
        assert aged(known, (0.0, 1.0, 2.0, 3.0), t) == [0.0]


def test_a_courier_brings_what_it_last_knew():
    """0 and 2 never meet; 1 goes from one to the other."""
    known = empty(1, 3)
    near_0, near_2 = (0.0, 1.0, 9.0), (0.0, 8.0, 9.0)
    # t = 1: {0, 1}, {2}: four pairs are 1 old.
    assert aged(known, near_0, 1) == pytest.approx([4 / 9])
    # t = 2: {0}, {1, 2}: 0 knows 1 from t = 1 and never met 2 (2 old);
    # 1 and 2 know 0 from t = 1, which 1 brought.
    assert aged(known, near_2, 2) == pytest.approx([(1 + 2 + 1 + 1) / 9])
    # t = 3: back again: 0 and 1 know 2 from t = 2; 2 knows 0 from t = 1 and 1 from t = 2.
    assert aged(known, near_0, 3) == pytest.approx([(1 + 1 + 2 + 1) / 9])


def test_who_is_off_passes_nothing_on_and_does_not_count():
    """1 is between 0 and 2, and is switched off after the first window."""
    known, x_m = empty(1, 3), (0.0, 1.0, 2.0)
    assert aged(known, x_m, 1) == [0.0]
    is_on = [True, False, True]
    # 0 and 2 know each other from t = 1, and themselves.
    assert aged(known, x_m, 2, is_on) == pytest.approx([2 * 1 / 4])
    assert aged(known, x_m, 3, is_on) == pytest.approx([2 * 2 / 4])
    assert aged(known, x_m, 4) == [0.0]


def test_neighbours_are_at_most_the_range_apart():
    assert aged(empty(1, 2), (0.0, 1.0), 1) == [0.0]
    assert aged(empty(1, 2), (0.0, 1.01), 1) == [0.5]


@given(seed=st.integers(0, 2**32 - 1), num_missions=st.integers(1, 3), num_robots=st.integers(2, 9))
def test_floor_as_by_components_of_a_graph(seed, num_missions, num_robots):
    rng = np.random.default_rng(seed)
    known = empty(num_missions, num_robots)
    newest = np.zeros((num_missions, num_robots, num_robots))
    for t in (1.0, 2.0, 3.0, 4.0):
        position_m = rng.random((num_missions, num_robots, 2))
        is_on = np.ones(position_m.shape[:2], dtype=bool)
        found = share_connected(known, position_m, 0.4, np.full(num_missions, t), is_on)
        for b in range(num_missions):
            places = dict(enumerate(position_m[b]))
            graph = nx.random_geometric_graph(num_robots, 0.4, pos=places)
            np.fill_diagonal(newest[b], t)
            for part in nx.connected_components(graph):
                members = sorted(part)
                newest[b, members] = newest[b, members].max(axis=0)
            assert found[b] == pytest.approx(np.mean(t - newest[b]))


@pytest.mark.parametrize(
    ("name", "task", "failing"),
    [
        *((name, "random-walk", 0.0) for name in POLICIES),
        *((name, "random-walk", 0.4) for name in ("random-flooding", "mst", "tdma")),
        *(("mst", "stationary", 0.0), ("mst", "flocking", 0.0)),
    ],
)
def test_no_policy_goes_below_the_floor(name, task, failing):
    """Teams so fast and sparse that they fall apart, some with robots that fail."""
    numbers = {"num_robots": 8, "num_windows": 60, "velocity_ratio": 2.0, "boundary": "reflect"}
    mission = paper(task, **numbers, failure_fraction=failing)
    swarm, known = Swarm(mission, [1, 2]), empty(2, 8)
    floors = []
    for flown in rollout(swarm, make_policy(name, mission)):
        on = swarm.states.is_active
        is_on = np.ones((2, 8), dtype=bool) if on is None else on
        place = swarm.states.position_m, mission.range_m
        floors.append(share_connected(known, *place, swarm.now, is_on))
        assert np.all(flown.costs.age_windows >= floors[-1] - 1e-9)
    assert (np.max(floors) > 0.0) == (task != "stationary")
