"""Memory that is asked for before the work; faults/test_fit.py compares it with measured peaks."""

import pytest

from swarm_mj.mission import paper
from swarm_mj.simulation.memory import (
    HEARD_ENTRY,
    LEARNED_PAIR,
    LIBRARIES,
    PAIR,
    ROBOT,
    TORCH,
    learned_memory,
    policy_memory,
)

MISSION = paper("random-walk", num_robots=10, num_windows=16)


@pytest.mark.parametrize(
    ("policy", "own_pair"),
    [
        ("tdma", 0.0),
        ("age-gain-csma", 8.0),
        ("sotdma", 230.0),
        ("planner", 250.0 + 4.0 * 10),
        ("greedy-oracle", 60.0),
    ],
)
def test_tables_grow_with_pairs_and_missions_and_by_what_the_policy_says(policy, own_pair):
    expected = LIBRARIES + ROBOT * 10 + (PAIR + own_pair) * 3 * 10**2
    assert policy_memory(policy, MISSION, 3) == pytest.approx(expected)


def test_a_network_takes_its_input_and_the_packets_that_it_remembers():
    expected = LIBRARIES + TORCH + (LEARNED_PAIR + HEARD_ENTRY * 10) * 3 * 10**2
    assert policy_memory("gnn", MISSION, 3) == learned_memory(10, 3) == pytest.approx(expected)


def test_a_policy_of_ones_own_that_cannot_be_imported_is_refused():
    with pytest.raises(ValueError, match="no module nowhere_to_be_found"):
        policy_memory("nowhere_to_be_found:Mine", MISSION)
