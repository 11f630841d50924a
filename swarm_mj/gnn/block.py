"""The GN block of the Aggregation GNN: learnable updates of edges and nodes, and a linear one."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from swarm_mj.gnn.edges import EdgeSet
from swarm_mj.gnn.layers import Layer, affine, compose, side_by_side, split


@dataclass(frozen=True, kw_only=True)
class NodeParts:
    """The first layers that a node enters, each composed with the last layer it left."""

    decoder: Layer
    node: Layer  # of NN_v
    receiver: Layer  # of NN_e, for the node where an edge ends
    sender: Layer  # of NN_e, for the node where it starts

    def after(self, before: Layer | None) -> "NodeParts":
        """These layers, each composed with one before; None leaves them as they are."""
        parts = (self.decoder, self.node, self.receiver, self.sender)
        width = len(self.decoder.bias)
        decoder, node, receiver, sender = split(compose(side_by_side(parts), before), width)
        return NodeParts(decoder=decoder, node=node, receiver=receiver, sender=sender)


@dataclass(frozen=True, kw_only=True)
class Core:
    """NN_e([edge, receiver, sender]) and NN_v([mean, node]), cut into parts (Eq. 13).

    A layer on a concatenation is a sum of layers; those of nodes are in `NodeParts`, so here are
    the edge's in NN_e and the mean's in NN_v. The mean commutes with them: it is taken last.
    """

    encoded_edge: Float[Tensor, "D C"]  # the first layer's part, one encoded edge per direction
    edge: Layer  # the same part for an edge that NN_e has made, composed with NN_e's last layer
    mean: Layer  # of NN_v, composed with NN_e's last layer
    edge_hidden: list[Layer]
    node_hidden: list[Layer]
    has_relu: bool  # after the first layer: not where it is the last as well


def gn_block(
    core: Core,
    parts: NodeParts,
    edges: EdgeSet,
    node: Float[Tensor, "n In"],
    edge: Float[Tensor, "e C"] | None,
) -> tuple[Float[Tensor, "n C"], Float[Tensor, "e C"]]:
    """Updates all edges by their ends, and all nodes by the mean of their edges (Eq. 11).

    Args:
        core: The updates.
        parts: What the nodes enter.
        edges: Who hears whom.
        node: The nodes, before the last layer of the perceptron that made them.
        edge: The edges likewise, or None where they are the encoded input.

    Returns:
        Nodes and edges, before the last layers of NN_v and NN_e.
    """
    ends = edges.from_ends(affine(node, parts.receiver), affine(node, parts.sender))
    if edge is None:
        directions = ends.unflatten(0, (len(core.encoded_edge), -1))
        entered = (directions + core.encoded_edge[:, None]).flatten(0, 1)
    else:
        entered = ends.add_(affine(edge, core.edge))
    edge = finish(entered, core.edge_hidden, has_relu=core.has_relu)
    entered = edges.add_mean_(affine(node, parts.node), affine(edge, core.mean))
    return finish(entered, core.node_hidden, has_relu=core.has_relu), edge


def finish(
    entered: Float[Tensor, "n C"], hidden: list[Layer], *, has_relu: bool
) -> Float[Tensor, "n C"]:
    """A perceptron behind its first layer and before its last; may change its argument.

    Args:
        entered: What comes out of the first layer.
        hidden: The layers between.
        has_relu: Whether a ReLU follows the first layer.

    Returns:
        What goes into the last layer.
    """
    x = entered.relu_() if has_relu else entered
    for layer in hidden:
        x = affine(x, layer, has_relu=True)
    return x


def linear_gn_block(edges: EdgeSet, node: Float[Tensor, "n C"]) -> Float[Tensor, "n C"]:
    """The linear variant: edges copy their senders, nodes keep the mean, so GN(v) = A v."""
    return edges.add_mean_(torch.zeros_like(node), edges.from_senders(node))
