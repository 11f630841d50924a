"""Memory that is asked for before the work; faults/test_fit.py compares it with measured peaks."""

import pytest
from tiny_policies import save_tiny

from swarm_mj.mission import paper
from swarm_mj.policies.index.weights import START, as_tensors
from swarm_mj.policies.policy_config import IndexConfig
from swarm_mj.policies.stored import save_weights
from swarm_mj.simulation.memory import (
    BODY,
    HEARD_ENTRY,
    LEARNED_PAIR,
    LIBRARIES,
    PAIR,
    ROBOT,
    TORCH,
    learned_memory,
    memory_growth,
    policy_memory,
)

MISSION = paper("random-walk", num_robots=10, num_windows=16)


@pytest.mark.parametrize(
    ("policy", "own_pair"),
    [
        ("tdma", 0.0),
        ("age-gain-csma", 8.0),
        ("index-csma", 8.0 + 8.0 + 2 * 4.0 + 4.0 + 1.0 + 4.0 * 32),
        ("sotdma", 230.0),
        ("planner", 250.0 + 4.0 * 10),
        ("greedy-oracle", 60.0),
        ("lookahead-oracle", 80.0),
    ],
)
def test_tables_grow_with_pairs_and_missions_and_by_what_the_policy_says(policy, own_pair):
    expected = LIBRARIES + ROBOT * 10 + (PAIR + own_pair) * 3 * 10**2
    assert policy_memory(policy, MISSION, 3) == pytest.approx(expected)


@pytest.mark.parametrize("policy", ["tdma", "gnn"])
def test_robots_with_bodies_take_more_in_mujoco_s_model(policy):
    """Alike in all missions, as the model is one, and whether a network flies them or not."""
    tall = paper("random-walk", num_robots=10, num_windows=16, robot="quadrotor:4,rover:6")
    more = policy_memory(policy, tall, 3) - policy_memory(policy, MISSION, 3)
    assert more == pytest.approx((BODY - ROBOT) * 10)


def test_a_network_takes_its_input_and_the_packets_that_it_remembers(tmp_path):
    path = str(tmp_path / "mine.safetensors")
    save_tiny(tmp_path / "mine", "extended")
    expected = LIBRARIES + TORCH + (LEARNED_PAIR + HEARD_ENTRY * 10) * 3 * 10**2
    assert learned_memory(10, 3, remembers_packets=True) == pytest.approx(expected)
    assert policy_memory(path, MISSION, 3) == pytest.approx(expected + ROBOT * 10)
    expected = LIBRARIES + TORCH + LEARNED_PAIR * 3 * 10**2 + ROBOT * 10
    assert policy_memory("gnn", MISSION, 3) == pytest.approx(expected)


def test_a_stored_index_takes_the_memory_of_its_policy_and_no_networks(tmp_path):
    config = IndexConfig(training={}, evaluation={}, commit=None, version="1")
    path = str(save_weights(tmp_path / "mine", as_tensors(START), config))
    large = paper("stationary", num_robots=1000)
    assert policy_memory(path, large) == policy_memory("index-csma", large)
    assert policy_memory(path, large) < 0.1 * learned_memory(1000, 1, remembers_packets=True)
    assert memory_growth(path, large) == ""


def test_that_memory_grows_with_the_cube_of_the_team_is_said_where_it_is_most_of_it(tmp_path):
    """Of 200 robots 4 N bytes a pair are 800, of 450 for all else; of 40 they are 160."""
    large = paper("stationary", num_robots=1000)
    path = str(tmp_path / "mine.safetensors")
    save_tiny(tmp_path / "mine", "extended")
    says = f"{path} remembers 1,000 numbers for each of 1,000 x 1,000 pairs of robots"
    assert memory_growth(path, large) == says
    assert memory_growth(path, MISSION) == ""
    assert memory_growth("gnn", large) == ""
    assert memory_growth("planner", large) == ""


def test_a_policy_of_ones_own_that_cannot_be_imported_is_refused():
    with pytest.raises(ValueError, match="no module nowhere_to_be_found"):
        policy_memory("nowhere_to_be_found:Mine", MISSION)
