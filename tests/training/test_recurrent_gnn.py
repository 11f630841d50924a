"""The example of a network that remembers: what it holds, and that gradients reach all of it."""

import recurrent_gnn
import torch
from recurrent_gnn import RecurrentGnn

from swarm_mj.policies.policy_config import GnnShape

SHAPE = GnnShape(num_features=3, latent=6, depth=2, receptive_field=1)


def test_it_holds_the_last_windows_of_the_robots_own_node_and_of_the_mean(monkeypatch):
    """Over the nodes that are robots: the last of three pads a smaller team."""
    monkeypatch.setattr(recurrent_gnn, "NUM_WINDOWS", 2)
    network = RecurrentGnn(SHAPE)
    memory = torch.zeros(1, network.memory_size)
    parent, owner = torch.full((1, 3), -1), torch.tensor([1])
    held = []
    for window in range(3):
        node = torch.tensor([[[1.0, 2.0, 3.0], [5.0, 6.0, window], [0.0, 0.0, 0.0]]])
        memory = network.remember(node, parent, owner, memory)
        held.append([5.0, 6.0, window, 3.0, 4.0, (3.0 + window) / 2])
    assert memory[0].tolist() == [*held[1], *held[2]]


def test_gradients_reach_every_window_that_it_remembers():
    torch.manual_seed(3)  # with other weights, rectified layers may pass nothing on
    network = RecurrentGnn(SHAPE)
    memory = torch.randn(2, network.memory_size, requires_grad=True)
    node, parent = torch.randn(2, 4, 3), torch.full((2, 4), -1)
    network(node, parent, None, memory).sum().backward()
    by_window = memory.grad.view(2, recurrent_gnn.NUM_WINDOWS, -1).abs().sum(dim=2)
    assert bool((by_window > 0.0).all())
