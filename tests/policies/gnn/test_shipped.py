"""What `gnn` says of itself is true of the file that comes with the package."""

import json
from pathlib import Path

import numpy as np
import pytest
from safetensors import safe_open

from swarm_mj.mission import paper
from swarm_mj.policies.about import Information
from swarm_mj.policies.gnn.shipped import SHIPPED_GNN
from swarm_mj.policies.gnn.turn_features import TurnFeatures
from swarm_mj.policies.policy_config import GnnConfig
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.policies.stored import load_policy, read_weights
from swarm_mj.system.packages import asset

FILE = asset(f"policies/{SHIPPED_GNN.name}.safetensors")
TRAINED = (
    Path(__file__).parents[3] / "training" / "reproduce" / "quick" / "one" / "one-1.safetensors"
)
MISSION = paper("stationary", num_robots=5)


@pytest.fixture(scope="module")
def said():
    """The file's metadata, read by safetensors alone."""
    with safe_open(FILE, "numpy") as file:
        return json.loads(file.metadata()["swarm_mj policy"])


def test_the_file_is_of_the_format_that_it_names(said):
    assert (said["format"], said["format_version"], said["kind"]) == ("swarm_mj policy", 3, "gnn")


def test_the_file_names_the_features_that_it_was_trained_on(said):
    assert said["config"]["features"] == "turns"
    assert tuple(said["feature_names"]) == TurnFeatures.names


def test_it_is_the_first_training_of_the_one_network_for_the_paper_s_figures():
    """So the claims' numbers of that are its own."""
    its, config = read_weights(FILE)
    weights, trained = read_weights(TRAINED)
    assert config == trained
    assert its.keys() == weights.keys()
    for name, weight in weights.items():
        np.testing.assert_array_equal(its[name], weight)
    policy = load_policy(FILE, MISSION)
    assert policy.parameters["digest"] == load_policy(TRAINED, MISSION).parameters["digest"]


def test_its_weights_are_whole_and_the_network_they_belong_to_is_small():
    weights, config = read_weights(FILE)
    assert isinstance(config, GnnConfig)
    num_numbers = 0
    for weight in weights.values():
        assert weight.dtype == np.float32
        assert np.isfinite(weight).all()
        num_numbers += weight.size
    # Two layers of 32 in each of five perceptrons, of 50 features, 1 direction, 3, 2 and 1 times
    # 32 numbers; then both stages to one number per node.
    per_input = 32 * (50 + 1 + 3 * 32 + 2 * 32 + 32)
    behind = 5 * (32 + 32 * 32 + 32)
    assert num_numbers == per_input + behind + (2 * 32 + 1)
    assert (config.network.depth, config.network.receptive_field) == (2, 1)


def test_the_card_beside_the_file_is_the_one_within(said):
    assert FILE.with_suffix(".md").read_text(encoding="utf-8") == said["card"]


def test_it_is_listed_and_flies_under_its_name():
    assert SHIPPED_GNN.name in POLICIES
    policy = make_policy(SHIPPED_GNN.name, MISSION)
    assert policy.about is SHIPPED_GNN
    assert policy.uses == SHIPPED_GNN.uses


def test_it_owns_up_to_what_its_features_take_beyond_the_paper():
    assert any("in ranges" in name for name in TurnFeatures.names)
    assert set(SHIPPED_GNN.beyond) == {Information.OBSERVED_POSITIONS, Information.RADIO_CONSTANTS}
    assert "size of the team" not in TurnFeatures.names
    assert not TurnFeatures.remembers_packets
    assert SHIPPED_GNN.payload is None  # its packets carry T, M and P alone
