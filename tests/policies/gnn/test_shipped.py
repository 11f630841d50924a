"""What `gnn` says of itself is true of the file that comes with the package."""

import json

import numpy as np
import pytest
from safetensors import safe_open

from swarm_mj.mission import paper
from swarm_mj.policies.about import Information
from swarm_mj.policies.gnn.extended_features import ExtendedFeatures
from swarm_mj.policies.gnn.features_of_1_0 import FEATURES_OF_1_0
from swarm_mj.policies.gnn.shipped import SHIPPED_GNN
from swarm_mj.policies.policy_config import GnnConfig
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.policies.stored import load_policy, read_weights
from swarm_mj.system.packages import asset

FILE = asset(f"policies/{SHIPPED_GNN.name}.safetensors")
MISSION = paper("stationary", num_robots=5)


@pytest.fixture(scope="module")
def said():
    """The file's metadata, read by safetensors alone."""
    with safe_open(FILE, "numpy") as file:
        return json.loads(file.metadata()["swarm_mj policy"])


def test_the_file_is_of_the_format_that_it_names(said):
    assert (said["format"], said["format_version"], said["kind"]) == ("swarm_mj policy", 3, "gnn")


def test_the_file_names_the_features_that_it_was_trained_on(said):
    assert said["config"]["features"] == "extended"
    assert tuple(said["feature_names"]) == FEATURES_OF_1_0["extended"] == ExtendedFeatures.names


def test_its_weights_are_those_of_1_0_0():
    """Whoever flew `gnn` then gets the same flight now, by the digest that results hold."""
    policy = load_policy(FILE, MISSION)
    assert policy.parameters["digest"] == "44a1592c564a"


def test_its_weights_are_whole_and_the_network_they_belong_to_is_small():
    weights, config = read_weights(FILE)
    assert isinstance(config, GnnConfig)
    num_numbers = 0
    for weight in weights.values():
        assert weight.dtype == np.float32
        assert np.isfinite(weight).all()
        num_numbers += weight.size
    # Two layers of 32 in each of five perceptrons, of 18 features, 1 direction, 3, 2 and 1 times
    # 32 numbers; then both stages to one number per node.
    per_input = 32 * (18 + 1 + 3 * 32 + 2 * 32 + 32)
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
    beyond = set(SHIPPED_GNN.beyond)
    assert any("turn" in name for name in ExtendedFeatures.names)
    assert {Information.COMMON_ORDER, Information.CLOCK} <= beyond  # whose turn it is
    assert "size of the team" in ExtendedFeatures.names
    assert Information.TEAM_SIZE in beyond
    assert ExtendedFeatures.remembers_packets
    assert Information.DECODED_PACKETS in beyond
    assert SHIPPED_GNN.payload is None  # its packets carry T, M and P alone
