"""Small networks of one's own: one that remembers, and some that are out of order."""

import torch
from torch import nn

from swarm_mj.policies.gnn.network import Network


class Plain(Network):
    """Rates each node by itself."""

    def __init__(self, shape):
        super().__init__(shape)
        self.output = nn.Linear(shape.num_features, shape.num_outputs)

    def forward(self, node, parent, is_wanted=None, memory=None):  # noqa: ARG002
        return self.output(node)


class Counting(Network):
    """Remembers how many windows it saw, and who it is; decisions also follow from that."""

    memory_size = 2

    def __init__(self, shape):
        super().__init__(shape)
        self.output = nn.Linear(shape.num_features + 2, shape.num_outputs)

    def remember(self, node, parent, owner, memory):  # noqa: ARG002
        return torch.stack([memory[:, 0] + 1.0, owner.to(node.dtype)], dim=1)

    def forward(self, node, parent, is_wanted=None, memory=None):  # noqa: ARG002
        # What is the same for all nodes would leave decisions as they are.
        for_each_node = memory[:, None] * node.sum(dim=2, keepdim=True)
        return self.output(torch.cat([node, for_each_node], dim=2))


class Headless(Network):
    """It has no last layer that could act."""

    def __init__(self, shape):
        super().__init__(shape)
        self.output = nn.Linear(shape.num_features, 7)


class Crooked(Plain):
    """It returns one number a robot."""

    def forward(self, node, parent, is_wanted=None, memory=None):
        return super().forward(node, parent, is_wanted, memory)[:, 0]


class NoNetwork:
    """Anything."""


class Mixing(Plain):
    """It compares a robot with all others, as no robot that flies can."""

    def forward(self, node, parent, is_wanted=None, memory=None):
        return super().forward(node - node.mean(dim=0), parent, is_wanted, memory)


class Endless(Plain):
    """Its numbers are not finite."""

    def forward(self, node, parent, is_wanted=None, memory=None):
        return super().forward(node, parent, is_wanted, memory) / 0.0
