"""The Aggregation GNN (III-A, Eqs. 11-14): nodes and their parents in, numbers for each node out.

Multilayer perceptrons are its parameters; what they make of a graph is computed in fewer steps.
Linear maps commute with the choice of an edge's ends and with the mean over edges, so they are
applied to nodes first, and a layer on a concatenation is a sum of layers. Two linear layers with
nothing between them are one: the last of each perceptron is composed with the first of all those
behind it. Input edges are encoded once, as they are all alike. The numbers are the plain network's
up to rounding.
"""

import itertools
from dataclasses import dataclass
from typing import get_args

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn

from swarm_mj.gnn.block import Core, NodeParts
from swarm_mj.gnn.edges import Edges, EdgeSet, is_upward
from swarm_mj.gnn.layers import Layer, affine, compose, cut, layers_of
from swarm_mj.gnn.stages import Decoder, LinearStages, NonLinearStages

NODES_AT_ONCE = 6400  # on a CPU: with more the caches spill, with fewer every step starts in vain


@dataclass(frozen=True, kw_only=True)
class GnnShape:
    """What an Aggregation GNN is made of.

    Raises:
        ValueError: A number is out of its range, or the edges have no such name.
    """

    num_features: int  # F: numbers per node
    num_outputs: int = 1  # O: numbers per node that come out
    latent: int = 64  # width of every layer
    depth: int = 3  # layers of every perceptron, with a ReLU after all but the last
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
                raise ValueError(f"{name} must be from {low} to {high}, not {value}")
        if self.edges not in get_args(Edges):
            names = ", ".join(get_args(Edges))
            raise ValueError(f"edges must be one of {names}, not {self.edges!r}")

    @property
    def has_core(self) -> bool:
        """Whether there is a GN block with something to learn."""
        return self.receptive_field > 0 and not self.is_linear


class Perceptrons(nn.Module):
    """A multilayer perceptron for nodes and, where edges take part, one for edges."""

    def __init__(self, node: nn.ModuleList, edge: nn.ModuleList | None = None) -> None:
        super().__init__()
        self.node = node
        if edge is not None:
            self.edge = edge


class AggregationGnn(nn.Module):
    """Encodes, applies the GN block K times, decodes each stage, maps all linearly (Eq. 14).

    Its parameters are the plain network's: perceptrons `encoder.node`, `encoder.edge`, `core.node`,
    `core.edge` and `decoder.node`, their layers numbered, and the layer `output`. NN_e takes
    [edge, receiver, sender] in this order, NN_v takes [mean, node].
    """

    def __init__(self, shape: GnnShape) -> None:
        """Draws the parameters from PyTorch's own generator.

        Args:
            shape: What the network is made of.
        """
        super().__init__()
        self.shape = shape
        width = shape.latent
        self.encoder = Perceptrons(
            _perceptron(shape.num_features, shape),
            _perceptron(1, shape) if shape.has_core else None,
        )
        if shape.has_core:
            self.core = Perceptrons(_perceptron(2 * width, shape), _perceptron(3 * width, shape))
        self.decoder = Perceptrons(_perceptron(width, shape))
        self.output = nn.Linear((shape.receptive_field + 1) * width, shape.num_outputs)

    def forward(
        self, node: Float[Tensor, "R N F"], parent: Int[Tensor, "R N"]
    ) -> Float[Tensor, "R N O"]:
        """Maps the features of the nodes of R graphs to numbers for each node.

        Graphs do not hear of each other, nor nodes of those that no edges lead to: a smaller graph
        may be padded with nodes that have no parent.

        Args:
            node: Features.
            parent: Index of each node's parent in the same graph, or -1: no edge.

        Returns:
            The numbers.

        Raises:
            ValueError: Features of another number than the network's, or a parent that is no node.
        """
        self._check(node, parent)
        if not parent.numel():
            return node.new_zeros(*parent.shape, self.shape.num_outputs)
        stages = self._stages() if self.shape.has_core else self._linear_stages()
        decode = self._decoder()
        num_chunks = -(-parent.numel() // NODES_AT_ONCE) if node.device.type == "cpu" else 1
        chunks = zip(node.chunk(num_chunks), parent.chunk(num_chunks), strict=True)
        numbers = [
            decode(stages(features.flatten(0, 1), EdgeSet(theirs, self.shape.edges, features)))
            for features, theirs in chunks
        ]
        return torch.cat(numbers).view(*parent.shape, -1)

    def _check(self, node: Tensor, parent: Tensor) -> None:
        """Raises ValueError on what would give numbers without a meaning."""
        num_features, num_nodes = node.shape[-1], parent.shape[-1]
        if num_features != self.shape.num_features:
            raise ValueError(
                f"nodes must have the {self.shape.num_features} features that the network was "
                f"made for, not {num_features}"
            )
        if parent.numel() and (highest := int(parent.max())) >= num_nodes:
            raise ValueError(
                f"a parent must be one of its graph's nodes, 0 to {num_nodes - 1}, or -1 for "
                f"none, not {highest}"
            )

    def _stages(self) -> NonLinearStages:
        *encoder, encoded = layers_of(self.encoder.node)
        first_edge, edge_hidden, last_edge = cut(layers_of(self.core.edge))
        first_node, node_hidden, last_node = cut(layers_of(self.core.node))
        of_edge, of_receiver, of_sender = first_edge.weight.chunk(3, dim=1)
        of_mean, of_node = first_node.weight.chunk(2, dim=1)
        no_bias = torch.zeros_like(first_edge.bias)
        parts = NodeParts(
            decoder=layers_of(self.decoder.node)[0],
            node=Layer(of_node, first_node.bias),
            receiver=Layer(of_receiver, first_edge.bias),
            sender=Layer(of_sender, no_bias),
        )
        core = Core(
            encoded_edge=self._encoded_edges() @ of_edge.T,
            edge=compose(Layer(of_edge, no_bias), last_edge),
            mean=compose(Layer(of_mean, no_bias), last_edge),
            edge_hidden=edge_hidden,
            node_hidden=node_hidden,
            has_relu=self.shape.depth > 1,
        )
        later = [parts.after(last_node)] * self.shape.receptive_field
        return NonLinearStages(encoder=encoder, parts=[parts.after(encoded), *later], core=core)

    def _linear_stages(self) -> LinearStages:
        *encoder, encoded = layers_of(self.encoder.node)
        decoder, *_ = layers_of(self.decoder.node)
        return LinearStages(
            encoder=encoder,
            encoded=encoded,
            decoder=decoder,
            decoder_of_encoded=compose(decoder, encoded),
            num_blocks=self.shape.receptive_field,
            has_relu=self.shape.depth > 1,
        )

    def _decoder(self) -> Decoder:
        _, hidden, last = cut(layers_of(self.decoder.node))
        of_stages = self.output.weight.unflatten(1, (-1, self.shape.latent))
        weight, bias = of_stages.transpose(0, 1), self.output.bias
        if last is not None:
            bias = bias + of_stages.sum(1) @ last.bias
            weight = weight @ last.weight
        return Decoder(hidden=hidden, weight=weight, bias=bias)

    def _encoded_edges(self) -> Float[Tensor, "D C"]:
        """The encoded input edges, one of each direction; its number is their one feature."""
        directions = range(len(is_upward(self.shape.edges)))
        x = self.output.bias.new_tensor([[direction] for direction in directions])
        *hidden, last = layers_of(self.encoder.edge)
        for layer in hidden:
            x = affine(x, layer, has_relu=True)
        return affine(x, last)


def _perceptron(num_inputs: int, shape: GnnShape) -> nn.ModuleList:
    """Linear layers of equal width; a ReLU is to follow all but the last."""
    widths = [num_inputs, *[shape.latent] * shape.depth]
    return nn.ModuleList(nn.Linear(low, high) for low, high in itertools.pairwise(widths))
