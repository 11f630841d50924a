"""Small learned policies with random weights, on disk and off."""

import torch

from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.gnn.feature_sets import make_extractor
from swarm_mj.policies.policy_config import GnnConfig, GnnShape
from swarm_mj.policies.stored import save_gnn

torch.set_num_threads(1)  # tests share the machine's cores

FEATURES = ("paper", "reference", "turns", "local", "extended")


def tiny_network(features="extended", seed=1, **shape):
    """A network over these features; its weights depend on the seed only."""
    names = make_extractor(features, Mission()).names
    its = {"num_features": len(names), "latent": 6, "depth": 2, "receptive_field": 1} | shape
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        return FastAggregationGnn(GnnShape(**its))


def tiny_config(network, features="extended", **overrides):
    its = {
        "features": features,
        "silence_logit": 1.5,
        "training": {"task": "stationary", "seed": 3, "command": "swarm-mj train --out runs/x"},
        "evaluation": {"episodes": 4, "results": [{"robots": 10, "aoi": 4.25}]},
        "commit": "abc123",
        "version": "1.2.3",
    }
    return GnnConfig(network=network.shape, **its | overrides)


def save_tiny(path, features="extended", seed=1, **shape):
    """Saves a tiny policy; returns its network."""
    network = tiny_network(features, seed, **shape)
    save_gnn(path, network, tiny_config(network, features))
    return network
