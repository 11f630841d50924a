"""Ages counted by hand; the floor by hand, and against networkx."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.evaluation.ages import connectivity_floor, count_ages
from swarm_mj.protocol.buffers import NEVER


def test_ages_by_hand():
    """Of three robots at t = 2; one's age about oneself does not count."""
    timestamp = np.array([[[2.0, 1.5, 0.0], [1.0, 2.0, 2.0], [0.0, 1.0, 2.0]]])
    counts = np.array([10, 0, 0, 0, 0])
    count_ages(timestamp, np.array([2.0]), counts, np.ones((1, 3), dtype=bool))
    assert counts.tolist() == [10 + 1, 1, 2, 0, 2]  # 0; 0.5; 1, 1; none; 2, 2
    counts[:] = 0
    count_ages(timestamp, np.array([2.0]), counts, np.array([[True, True, False]]))
    assert counts.tolist() == [0, 1, 1, 0, 0]  # the third robot is off: 0.5 and 1 are left


def empty(num_missions, num_robots):
    return np.full((num_missions, num_robots, num_robots), NEVER)


def aged(known, x_m, t, is_on=None):
    """The age at t of one mission's robots on a line with a range of 1 m, all on unless given."""
    position_m, on = np.array([[(x, 0.0) for x in x_m]]), [is_on or [True] * len(x_m)]
    return connectivity_floor(known, position_m, 1.0, np.array([float(t)]), np.array(on))


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


@given(seed=st.integers(0, 2**32 - 1), num_missions=st.integers(1, 3), num_robots=st.integers(2, 9))
def test_floor_as_by_components_of_a_graph(seed, num_missions, num_robots):
    rng = np.random.default_rng(seed)
    known = empty(num_missions, num_robots)
    newest = np.zeros((num_missions, num_robots, num_robots))
    for t in (1.0, 2.0, 3.0, 4.0):
        position_m = rng.random((num_missions, num_robots, 2))
        is_on = np.ones(position_m.shape[:2], dtype=bool)
        found = connectivity_floor(known, position_m, 0.4, np.full(num_missions, t), is_on)
        for b in range(num_missions):
            places = dict(enumerate(position_m[b]))
            graph = nx.random_geometric_graph(num_robots, 0.4, pos=places)
            np.fill_diagonal(newest[b], t)
            for part in nx.connected_components(graph):
                members = sorted(part)
                newest[b, members] = newest[b, members].max(axis=0)
            assert found[b] == pytest.approx(np.mean(t - newest[b]))
