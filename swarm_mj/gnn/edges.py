"""The edges between the nodes of many graphs, given by their parents, and the mean over them."""

from typing import Literal

import torch
from jaxtyping import Float, Int
from torch import Tensor

Edges = Literal["paper", "reference", "both"]


def is_upward(edges: Edges) -> tuple[bool, ...]:
    """Of each of D directions: whether children send and parents receive, or the reverse."""
    return {"paper": (True,), "reference": (False,), "both": (True, False)}[edges]


class EdgeSet:
    """The edges of R graphs of N nodes; a child has one edge for each of D directions.

    All arrays are flat: node k of graph r is row r N + k of n. So is the edge of child k in the
    first direction; edges of the second lie behind them. A node without a parent has edges as well,
    which start and end at itself and count for nothing: with equal shapes in every call the
    libraries below need not set themselves up anew.
    """

    def __init__(
        self, parent: Int[Tensor, "R N"], edges: Edges, like: Float[Tensor, "..."]
    ) -> None:
        """Finds the ends of the edges.

        Args:
            parent: Index of each node's parent in the same graph, or -1: no edge.
            edges: Their directions.
            like: A tensor of the type and on the device that the means have.
        """
        self._is_upward = is_upward(edges)
        own = torch.arange(parent.numel(), device=parent.device).view(parent.shape)
        has_parent = parent >= 0
        self._parent = torch.where(has_parent, own[:, :1] + parent, own).flatten()
        self._share = self._shares(has_parent.flatten().to(like.dtype))

    def _shares(self, count: Float[Tensor, "n"]) -> Float[Tensor, "e 1"]:
        """What part of its receiver's mean each edge is: 1 / degree, or 0 if it is not there."""
        degree = torch.zeros_like(count)
        for is_up in self._is_upward:
            degree = degree.index_add_(0, self._parent, count) if is_up else degree.add_(count)
        share = degree.clamp_(min=1).reciprocal_()
        ends = [share[self._parent] if is_up else share for is_up in self._is_upward]
        return torch.cat([count * end for end in ends])[:, None]

    def from_ends(
        self, receiver: Float[Tensor, "n C"], sender: Float[Tensor, "n C"]
    ) -> Float[Tensor, "e C"]:
        """For every edge, the row of its receiver in one array plus that of its sender in another.

        Args:
            receiver: One row per node.
            sender: One row per node.

        Returns:
            One row per edge, e = D n of them.
        """
        sums = []
        for is_up in self._is_upward:
            of_parent, of_child = (receiver, sender) if is_up else (sender, receiver)
            sums.append(of_parent.index_select(0, self._parent).add_(of_child))
        return sums[0] if len(sums) == 1 else torch.cat(sums)

    def from_senders(self, node: Float[Tensor, "n C"]) -> Float[Tensor, "e C"]:
        """For every edge, the row of its sender in a new array."""
        rows = [node if is_up else node.index_select(0, self._parent) for is_up in self._is_upward]
        return torch.cat(rows)

    def add_mean_(
        self, node: Float[Tensor, "n C"], edge: Float[Tensor, "e C"]
    ) -> Float[Tensor, "n C"]:
        """Adds to each node the mean over the edges it receives, 0 without any (Eq. 12).

        Args:
            node: One row per node; changed.
            edge: One row per edge; changed as well.

        Returns:
            `node`.
        """
        blocks = edge.mul_(self._share).view(len(self._is_upward), *node.shape)
        for is_up, block in zip(self._is_upward, blocks.unbind(), strict=True):
            node = node.index_add_(0, self._parent, block) if is_up else node.add_(block)
        return node
