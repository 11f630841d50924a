"""The stages of an Aggregation GNN, one after each application of the GN block, and their decoder.

Every stage is handed on as what comes out of the decoder's first layer, for that layer composes
with the one before it.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from swarm_mj.gnn.block import Core, NodeParts, gn_block, linear_gn_block
from swarm_mj.gnn.edges import EdgeSet
from swarm_mj.gnn.layers import Layer, affine


@dataclass(frozen=True, kw_only=True)
class NonLinearStages:
    """Encoder and learnable GN block."""

    encoder: list[Layer]  # all but the last, each followed by a ReLU
    parts: list[NodeParts]  # what the nodes of every stage enter
    core: Core

    def __call__(self, node: Float[Tensor, "n F"], edges: EdgeSet) -> Iterator[Tensor]:
        """Yields the K + 1 stages.

        Args:
            node: Features.
            edges: Who hears whom.
        """
        for layer in self.encoder:
            node = affine(node, layer, has_relu=True)
        edge = None
        for entered, left in zip(self.parts, [*self.parts[1:], None], strict=True):
            yield affine(node, entered.decoder, has_relu=self.core.has_relu)
            if left is not None:
                node, edge = gn_block(self.core, entered, edges, node, edge)


@dataclass(frozen=True, kw_only=True)
class LinearStages:
    """Encoder and linear GN block."""

    encoder: list[Layer]  # all but the last, each followed by a ReLU
    encoded: Layer  # the last
    decoder: Layer  # the first
    decoder_of_encoded: Layer  # the two composed
    num_blocks: int  # K
    has_relu: bool  # after the decoder's first layer

    def __call__(self, node: Float[Tensor, "n F"], edges: EdgeSet) -> Iterator[Tensor]:
        """Yields the K + 1 stages; arguments as in `NonLinearStages`."""
        for layer in self.encoder:
            node = affine(node, layer, has_relu=True)
        yield affine(node, self.decoder_of_encoded, has_relu=self.has_relu)
        if self.num_blocks:
            node = affine(node, self.encoded)
        for _ in range(self.num_blocks):
            node = linear_gn_block(edges, node)
            yield affine(node, self.decoder, has_relu=self.has_relu)


@dataclass(frozen=True, kw_only=True)
class Decoder:
    """The decoder behind its first layer, its last composed with the output layer."""

    hidden: list[Layer]  # each followed by a ReLU
    weight: Float[Tensor, "S Out C"]  # of every stage
    bias: Float[Tensor, "Out"]

    def __call__(self, stages: Iterable[Tensor]) -> Float[Tensor, "n Out"]:
        """Decodes every stage and maps them all to the outputs."""
        output = self.bias
        for x, weight in zip(stages, self.weight, strict=True):
            for layer in self.hidden:
                x = affine(x, layer, has_relu=True)
            output = torch.addmm(output, x, weight.T)
        return output
