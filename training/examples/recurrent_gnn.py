"""The paper's GNN with a memory: each robot also decides by its last windows.

    swarm-mj train --network training.examples.recurrent_gnn:RecurrentGnn --out runs/recurrent

Kurniawan et al. (arXiv 2404.03227) call recurrence crucial to learn to communicate. It is more than
the paper's information, whose robots decide by their buffers of this moment alone.
"""

from dataclasses import replace

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from swarm_mj.policies.gnn.fast import FastAggregationGnn
from swarm_mj.policies.policy_config import GnnShape

NUM_WINDOWS = 8  # that a robot looks back on
WIDTH = 16  # of what it makes of them


class RecurrentGnn(FastAggregationGnn):
    """A robot remembers what it saw in its last windows; a GRU reads it for every node."""

    def __init__(self, shape: GnnShape) -> None:
        """Add the GRU's state to the features of each node."""
        super().__init__(replace(shape, num_features=shape.num_features + WIDTH))
        self.seen_size = 2 * shape.num_features
        self.memory_size = NUM_WINDOWS * self.seen_size
        self.reader = nn.GRU(self.seen_size, WIDTH, batch_first=True)

    def remember(
        self,
        node: Float[Tensor, "R N F"],
        parent: Int[Tensor, "R N"],
        owner: Int[Tensor, "R"],
        memory: Float[Tensor, "R H"],
    ) -> Float[Tensor, "R H"]:
        """Return the last windows, the oldest first: of each the robot's own node, and the mean."""
        del parent
        own = node[torch.arange(len(owner), device=owner.device), owner]
        # Nodes without any feature pad smaller teams.
        is_robot = (node != 0.0).any(dim=2, keepdim=True)
        mean = node.sum(dim=1) / is_robot.sum(dim=1).clamp(min=1)
        return torch.cat([memory[:, self.seen_size :], own, mean], dim=1)

    def forward(
        self,
        node: Float[Tensor, "R N F"],
        parent: Int[Tensor, "R N"],
        is_wanted: Bool[Tensor, "R N"] | None = None,
        memory: Float[Tensor, "R H"] | None = None,
    ) -> Float[Tensor, "R N O"]:
        """Read the memory anew, so that gradients reach all windows that it holds."""
        assert memory is not None
        _, state = self.reader(memory.view(len(memory), NUM_WINDOWS, self.seen_size))
        for_each_node = state[0][:, None, :].expand(-1, node.shape[1], -1)
        return super().forward(torch.cat([node, for_each_node], dim=2), parent, is_wanted)
