"""Networks of users' own, `module:Name`, beside the paper's: how one is loaded, made and checked.

A name in a file must not make us import code. So a user's own is found here alone, where
`load_network` puts those that the user of this process named.
"""

from collections.abc import Collection, Mapping

import numpy as np
import torch
from torch import nn

from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.gnn.network import Network
from swarm_mj.policies.policy_config import GnnShape
from swarm_mj.system.user_code import load

_own: dict[str, type[Network]] = {}


def load_network(name: str) -> None:
    """Import a user's own network, which from then on has that name.

    That runs its code, so the name must be one that the user gave, and none from a file.

    Args:
        name: `module:Name` of a subclass of `Network`; the current folder is searched first.

    Raises:
        ValueError: It cannot be loaded, or is no such class.

    Example:
        >>> load_network("my_network:Mine")
        >>> make_network(GnnShape(num_features=8), "my_network:Mine").memory_size
        0
    """
    own = load("network", name)
    if not isinstance(own, type) or not issubclass(own, Network):
        raise ValueError(f"network {name} must be a subclass of Network, not {own!r:.80}")
    _own[name] = own


def check_named(name: str, named: Collection[str], where: str) -> None:
    """Raise ValueError if a file names a user's own network that its user has not named too."""
    if name and name not in named:
        raise ValueError(
            f"{where} decides by a network of someone's own, {name:.200}; if you trust that code, "
            f"add --network {name:.200}"
        )


def make_network(shape: GnnShape, name: str = "") -> Network:
    """Return a network with weights drawn from PyTorch's own generator.

    Args:
        shape: Its numbers a node, in and out, and its layers, of which an own one takes what it
            likes.
        name: A user's own, `module:Name`, after `load_network`; "" is the paper's.

    Returns:
        The network.

    Raises:
        ValueError: It was not loaded, or does not end in a layer that can act.
    """
    if not name:
        return FastAggregationGnn(shape)
    check_named(name, _own, "it")
    network = _own[name](shape)
    last = getattr(network, "output", None)
    if not isinstance(last, nn.Linear) or last.out_features != shape.num_outputs:
        raise ValueError(
            f"network {name} must have a last layer `self.output`, a torch.nn.Linear to "
            f"shape.num_outputs = {shape.num_outputs} numbers a node, not {last!r:.80}"
        )
    return network


def check_one_by_one(network: Network, name: str) -> None:
    """Raise ValueError unless a network's numbers for a robot follow from its own graph.

    A robot that flies has no others' graphs to compute with, while training has many at a time.
    """
    draws = torch.Generator().manual_seed(0)  # PyTorch's own generator draws the training
    num_graphs = 3
    shape = (num_graphs, 4, network.shape.num_features)
    node = torch.rand(shape, generator=draws)
    parent = torch.tensor([-1, 0, 0, 1]).expand(num_graphs, -1)
    memory = torch.zeros(num_graphs, network.memory_size) if network.memory_size else None
    was_training = network.training
    network.eval()
    with torch.no_grad():
        together = network(node, parent, None, memory)
        first = None if memory is None else memory[:1]
        alone = network(node[:1], parent[:1], None, first)
    network.train(was_training)
    if not together.isfinite().all():
        raise ValueError(f"network {name} returned numbers that are not finite, before training")
    if not torch.allclose(together[:1], alone, rtol=1e-3, atol=1e-5):
        raise ValueError(
            f"network {name} mixes robots: its numbers for one change with the other rows of node; "
            "leave axis 0 alone, since a robot in flight knows only its own graph"
        )


def empty_network(shape: GnnShape, name: str = "") -> Network:
    """Return a network without weights: it takes no memory, and draws no random numbers."""
    with torch.device("meta"):
        return make_network(shape, name)


def network_of(shape: GnnShape, weights: Mapping[str, np.ndarray], name: str = "") -> Network:
    """Return a network with these weights, which are its own."""
    network = empty_network(shape, name)
    tensors = {key: torch.from_numpy(array) for key, array in weights.items()}
    network.load_state_dict(tensors, assign=True)
    return network


def tensors_of(shape: GnnShape, name: str) -> dict[str, tuple[int, ...]]:
    """Return the shapes of an own network's weights by name, after `load_network`."""
    shapes: dict[str, tuple[int, ...]] = {}
    for key, tensor in empty_network(shape, name).state_dict().items():
        shapes[key] = tuple(tensor.shape)
    return shapes
