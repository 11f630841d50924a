"""The Aggregation GNN (III-A, Eqs. 11-14): nodes and their parents in, numbers per node out."""

import itertools
from dataclasses import dataclass
from typing import Literal, get_args

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

Edges = Literal["paper", "reference", "both"]


@dataclass(frozen=True, kw_only=True)
class GnnShape:
    """What an Aggregation GNN is made of.

    Raises:
        ValueError: A number is out of its range, or the edges have no such name.
    """

    num_features: int  # F: numbers per node
    num_outputs: int = 1  # O: numbers per node that come out
    latent: int = 64  # width of every layer
    depth: int = 3  # layers of every MLP, with a ReLU after all but the last
    receptive_field: int = 5  # K: how often the one shared GN block is applied
    is_linear: bool = False  # GN(v) = A v with the mean-normalised adjacency A
    edges: Edges = "paper"  # paper: parents hear children; reference: children hear parents

    def __post_init__(self) -> None:
        for name, low, high in (
            ("num_features", 1, 1024),
            ("num_outputs", 1, 1024),
            ("latent", 1, 1024),
            ("depth", 1, 8),
            ("receptive_field", 0, 16),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} is {value}: choose one from {low} to {high}")
        if self.edges not in get_args(Edges):
            raise ValueError(f"edges are {self.edges!r}: choose one of {get_args(Edges)}")


class _Block(nn.Module):
    """An MLP for nodes, and one for edges."""

    def __init__(self, node: nn.ModuleList, edge: nn.ModuleList | None) -> None:
        super().__init__()
        self.node = node
        if edge is not None:
            self.edge = edge


def _layers(num_inputs: int, shape: GnnShape) -> nn.ModuleList:
    widths = [num_inputs] + [shape.latent] * shape.depth
    return nn.ModuleList(nn.Linear(a, b) for a, b in itertools.pairwise(widths))


def _mlp(layers: nn.Module, x: Tensor) -> Tensor:
    for i, layer in enumerate(layers.children()):
        x = layer(torch.relu(x) if i else x)
    return x


class AggregationGnn(nn.Module):
    """Aggregation GNN: encode, K times the GN block, decode every stage, map linearly (Eq. 14)."""

    def __init__(self, shape: GnnShape) -> None:
        super().__init__()
        self.shape = shape
        has_core = shape.receptive_field > 0 and not shape.is_linear
        width = shape.latent
        self.encoder = _Block(
            _layers(shape.num_features, shape), _layers(1, shape) if has_core else None
        )
        if has_core:
            self.core = _Block(_layers(2 * width, shape), _layers(3 * width, shape))
        self.decoder = _Block(_layers(width, shape), None)
        self.output = nn.Linear((shape.receptive_field + 1) * width, shape.num_outputs)

    def forward(
        self, node: Float[Tensor, "R N F"], parent: Int[Tensor, "R N"]
    ) -> Float[Tensor, "R N O"]:
        """Numbers for every node of R graphs.

        Args:
            node: Features of the nodes.
            parent: Index of each node's parent in the same graph, or -1: no edge.
        """
        num_graphs, num_nodes, _ = node.shape
        has_parent = parent >= 0
        row, child = torch.nonzero(has_parent, as_tuple=True)
        child = row * num_nodes + child
        above = row * num_nodes + parent[has_parent].long()
        receiver, sender = above, child
        if self.shape.edges == "reference":
            receiver, sender = child, above
        feature = node.new_zeros(len(child), 1)
        if self.shape.edges == "both":
            receiver, sender = torch.cat([above, child]), torch.cat([child, above])
            feature = torch.cat([feature, feature + 1])
        degree = torch.bincount(receiver, minlength=num_graphs * num_nodes).clamp(min=1)

        def mean(values: Tensor) -> Tensor:
            total = values.new_zeros(num_graphs * num_nodes, values.shape[1])
            return total.index_add(0, receiver, values) / degree[:, None]

        node = _mlp(self.encoder.node, node.flatten(0, 1))
        decoded = [_mlp(self.decoder.node, node)]
        has_core = self.shape.receptive_field > 0 and not self.shape.is_linear
        edge = _mlp(self.encoder.edge, feature) if has_core else feature
        for _ in range(self.shape.receptive_field):
            if self.shape.is_linear:
                node = mean(node[sender])
            else:
                edge = _mlp(self.core.edge, torch.cat([edge, node[receiver], node[sender]], 1))
                node = _mlp(self.core.node, torch.cat([mean(edge), node], 1))
            decoded.append(_mlp(self.decoder.node, node))
        return self.output(torch.cat(decoded, 1)).unflatten(0, (num_graphs, num_nodes))
