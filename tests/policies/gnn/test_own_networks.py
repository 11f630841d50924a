"""Networks of users' own: they are stored, checked, loaded by name alone, and fly."""

import numpy as np
import pytest
import torch
from tiny_policies import tiny_config

from swarm_mj.mission import paper
from swarm_mj.policies.gnn.decisions import evaluated
from swarm_mj.policies.gnn.own_networks import (
    check_one_by_one,
    empty_network,
    load_network,
    make_network,
    network_of,
    tensors_of,
)
from swarm_mj.policies.policy_config import GnnShape
from swarm_mj.policies.registry import check_used
from swarm_mj.policies.stored import load_policy, read_policy, save_gnn
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("stationary", num_robots=4, num_windows=12, range_ratio=0.6)
SHAPE = GnnShape(num_features=8, latent=6, depth=2, receptive_field=1)  # of the paper's features


def saved(tmp_path, name):
    """A policy of one's own network on the paper's features."""
    load_network(name)
    torch.manual_seed(1)
    network = make_network(SHAPE, name)
    config = tiny_config(network, "paper", own_network=name, silence_logit=0.5)
    return save_gnn(tmp_path / "mine", network, config), network


def decisions(policy, seeds, mission=MISSION):
    swarm = Swarm(mission, seeds)
    swarm.start(policy)
    decided = []
    for _ in range(mission.num_windows):
        decided.append(swarm.decide())
        swarm.step_with_recipients(decided[-1])
    return np.array(decided)


def test_without_a_name_it_is_the_papers():
    assert type(make_network(SHAPE)).__name__ == "FastAggregationGnn"
    assert empty_network(SHAPE).output.weight.is_meta


def test_weights_come_back_as_they_were_stored(tmp_path):
    path, network = saved(tmp_path, "tiny_networks:Plain")
    again, config = read_policy(path)
    assert config.own_network == "tiny_networks:Plain"
    assert torch.equal(again.output.weight, network.output.weight)
    weights = {name: tensor.numpy() for name, tensor in network.state_dict().items()}
    made = network_of(SHAPE, weights, "tiny_networks:Plain")
    assert torch.equal(made.output.bias, network.output.bias)
    assert tensors_of(SHAPE, "tiny_networks:Plain") == {
        "output.weight": (1, 8),
        "output.bias": (1,),
    }


def test_a_file_runs_no_code_that_its_user_has_not_named(tmp_path):
    path, _ = saved(tmp_path, "tiny_networks:Counting")
    with pytest.raises(ValueError, match="someone's own, tiny_networks:Counting; if you trust"):
        load_policy(path, MISSION)
    policy = load_policy(path, MISSION, networks=["tiny_networks:Counting"])
    assert policy.parameters["network"] == "tiny_networks:Counting"
    assert policy.parameters["memory"] == 2
    assert "what it remembers, by a trained network" in policy.uses
    check_used([], ["tiny_networks:Counting"], [policy])
    with pytest.raises(ValueError, match="no policy here decides by the network others:Net"):
        check_used([], ["others:Net"], [policy])


def test_weights_of_another_network_are_refused(tmp_path):
    load_network("tiny_networks:Counting")
    torch.manual_seed(1)
    network = make_network(SHAPE, "tiny_networks:Counting")
    config = tiny_config(network, "paper", own_network="tiny_networks:Plain")
    path = save_gnn(tmp_path / "mine", network, config)
    with pytest.raises(ValueError, match=r"output.weight must be \[1, 8\] of float32, not \[1, 10"):
        load_policy(path, MISSION, networks=["tiny_networks:Plain"])


def test_robots_remember_their_own_windows_and_forget_at_the_start(tmp_path):
    """By the arithmetic of `Counting`, mission by mission and in a second flight."""
    path, network = saved(tmp_path, "tiny_networks:Counting")
    policy = load_policy(path, MISSION, networks=["tiny_networks:Counting"])
    for _ in range(2):
        for number, _ in enumerate(rollout(Swarm(MISSION, [3, 5]), policy), start=1):
            expected = [[number, robot] for robot in (0, 1, 2, 3)] * 2
            assert policy._memory.tolist() == expected
    alone = decisions(load_policy(path, MISSION, networks=["tiny_networks:Counting"]), [5])
    beside = decisions(policy, [3, 5])
    np.testing.assert_array_equal(beside[:, 1:], alone)
    with torch.no_grad():
        network.output.weight[0, -2:] = 0.0  # by its memory it decided otherwise
    config = tiny_config(network, "paper", own_network="tiny_networks:Counting", silence_logit=0.5)
    save_gnn(path, network, config)
    without = load_policy(path, MISSION, networks=["tiny_networks:Counting"])
    assert np.any(decisions(without, [5]) != alone)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("tiny_networks:NoNetwork", "must be a subclass of Network"),
        ("tiny_networks:Headles", "tiny_networks.py has no Headles"),
        ("no_networks:Mine", "there is no module no_networks"),
    ],
)
def test_what_is_no_network_is_refused(name, said):
    with pytest.raises(ValueError, match=said):
        load_network(name)


def test_networks_that_cannot_act_are_refused():
    for name in ("tiny_networks:Headless", "tiny_networks:Crooked"):
        load_network(name)
    with pytest.raises(ValueError, match=r"a torch.nn.Linear to shape.num_outputs = 1 numbers"):
        make_network(SHAPE, "tiny_networks:Headless")
    with pytest.raises(ValueError, match="someone's own, never:Loaded"):
        make_network(SHAPE, "never:Loaded")
    parent = torch.full((2, 4), -1)
    given = (torch.zeros(2, 4, 8), parent, parent < 0, torch.tensor([0, 1]), None)
    with pytest.raises(
        ValueError, match=r"Crooked.forward must return .* \(2, 4, 1\), not \(2, 1\)"
    ):
        evaluated(make_network(SHAPE, "tiny_networks:Crooked"), *given)


def test_a_network_that_mixes_robots_is_refused():
    """In training many graphs are side by side; a robot in flight has its own alone."""
    for name, why in (("Mixing", "mixes robots"), ("Endless", "not finite")):
        load_network(f"tiny_networks:{name}")
        network = make_network(SHAPE, f"tiny_networks:{name}")
        with pytest.raises(ValueError, match=f"tiny_networks:{name} .*{why}"):
            check_one_by_one(network, f"tiny_networks:{name}")
        assert network.training
    for name in ("Plain", "Counting"):
        load_network(f"tiny_networks:{name}")
        network = make_network(SHAPE, f"tiny_networks:{name}")
        drawn = torch.get_rng_state()
        check_one_by_one(network, f"tiny_networks:{name}")
        assert torch.equal(torch.get_rng_state(), drawn)
