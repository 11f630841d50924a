"""The Aggregation GNN of `gnn.network` in fewer steps; its numbers are the same up to rounding.

Linear maps commute with the choice of an edge's ends and with the mean over edges, so they are
applied to nodes first, and a layer on a concatenation is a sum of layers. Two linear layers with
nothing between them are one: the last of each perceptron is composed with the first of all those
behind it. Input edges are encoded once for each direction, as they are all alike. Only nodes that
are asked for go through the last layers, and edges of one hidden layer are compiled on a CPU.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from swarm_mj.policies.gnn.edge_sums import EdgeSums, as_array, edges_to
from swarm_mj.policies.gnn.network import AggregationGnn, Core
from swarm_mj.policies.policy_config import Edges, GnnShape

NODES_AT_ONCE = 6400  # on a CPU: with more the caches spill, with fewer every step starts in vain
IS_UPWARD = {"paper": (True,), "reference": (False,), "both": (True, False)}  # child to parent


class FastAggregationGnn(AggregationGnn):
    """An `AggregationGnn` that composes layers and leaves out what nobody asks for."""

    def forward(
        self,
        node: Float[Tensor, "R N F"],
        parent: Int[Tensor, "R N"],
        is_wanted: Bool[Tensor, "R N"] | None = None,
    ) -> Float[Tensor, "R N O"]:
        """As `AggregationGnn.forward`, to which the linear variant and a depth of 1 are left."""
        self.check(node, parent)
        is_composed = self.shape.has_core and self.shape.depth > 1
        evaluate = Composed(self) if is_composed else super().forward
        num_chunks = -(-parent.numel() // NODES_AT_ONCE) if node.device.type == "cpu" else 1
        rows = (node, parent) if is_wanted is None else (node, parent, is_wanted)
        chunks = zip(*(each.chunk(max(1, num_chunks)) for each in rows), strict=True)
        return torch.cat([evaluate(*chunk) for chunk in chunks])


def empty_network(shape: GnnShape) -> FastAggregationGnn:
    """Return a network without weights: it takes no memory, and draws no random numbers."""
    with torch.device("meta"):
        return FastAggregationGnn(shape)


def network_of(shape: GnnShape, weights: Mapping[str, np.ndarray]) -> FastAggregationGnn:
    """Return a network with these weights, which are its own."""
    network = empty_network(shape)
    tensors = {name: torch.from_numpy(array) for name, array in weights.items()}
    network.load_state_dict(tensors, assign=True)
    return network


class Layer(NamedTuple):
    """x -> x W' + b, as in `torch.nn.Linear`."""

    weight: Float[Tensor, "Out In"]
    bias: Float[Tensor, "Out"]

    def __call__(self, x: Float[Tensor, "n In"]) -> Float[Tensor, "n Out"]:
        """Apply it."""
        return nn.functional.linear(x, self.weight, self.bias)

    def after(self, before: nn.Linear) -> "Layer":
        """Return the one layer that does what `before` and then this one do."""
        bias = torch.addmv(self.bias, self.weight, before.bias)
        return Layer(self.weight @ before.weight, bias)


def hidden(x: Float[Tensor, "n C"], layers: list[nn.Linear]) -> Float[Tensor, "n C"]:
    """Return a perceptron behind its first layer and before its last; overwrites its argument."""
    x = x.relu_()
    for layer in layers:
        x = layer(x).relu_()
    return x


class Entries(NamedTuple):
    """The first layers that a stage's nodes enter, each composed with the last that they left."""

    decoder: Layer
    node: Layer  # NN_v's part for the node
    receiver: Layer  # NN_e's part for the node where an edge ends
    sender: Layer  # NN_e's part for the node where it starts

    def after(self, before: nn.Linear) -> "Entries":
        """Return these, composed with the layer before."""
        return Entries(*(layer.after(before) for layer in self))


class Composed:
    """A network's layers, cut at concatenations and composed across perceptrons."""

    def __init__(self, network: AggregationGnn) -> None:
        """Compose the weights as they are now; gradients flow back to them."""
        assert isinstance(network.core, Core)
        self._edges: Edges = network.shape.edges
        self._depth, self._num_blocks = network.shape.depth, network.shape.receptive_field
        self._encoder, self._decoder = network.encoder.node.layers, network.decoder.node.layers
        self._edge, self._node = network.core.edge.layers, network.core.node.layers
        of_edge, of_receiver, of_sender = self._edge[0].weight.chunk(3, dim=1)
        of_mean, of_node = self._node[0].weight.chunk(2, dim=1)
        none = torch.zeros_like(self._edge[0].bias)
        entries = Entries(
            decoder=Layer(self._decoder[0].weight, self._decoder[0].bias),
            node=Layer(of_node, self._node[0].bias),
            receiver=Layer(of_receiver, self._edge[0].bias),
            sender=Layer(of_sender, none),
        )
        later = [entries.after(self._node[-1])] * self._num_blocks
        self._stages = [entries.after(self._encoder[-1]), *later]
        self._edge_again = Layer(of_edge, none).after(self._edge[-1])
        self._mean = Layer(of_mean, none).after(self._edge[-1])
        outputs = network.output.weight.chunk(len(self._stages), dim=1)
        no_output = torch.zeros_like(network.output.bias)
        self._outputs = [Layer(w, no_output).after(self._decoder[-1]) for w in outputs]
        self._output_bias = network.output.bias
        directions = range(len(IS_UPWARD[self._edges]))
        feature = none.new_tensor([[direction] for direction in directions])
        self._encoded_edges = network.encoder.edge(feature) @ of_edge.T

    def __call__(
        self,
        node: Float[Tensor, "R N F"],
        parent: Int[Tensor, "R N"],
        is_wanted: Bool[Tensor, "R N"] | None = None,
    ) -> Float[Tensor, "R N O"]:
        """Evaluate the network; arguments as in `AggregationGnn.forward`."""
        wanted = None if is_wanted is None else is_wanted.flatten().nonzero().squeeze(1)
        v = hidden(self._encoder[0](node.flatten(0, 1)), self._encoder[1:-1])
        own = picked(v, wanted)
        output = self._output_bias + self._decode(0, own)
        if self._depth == 2 and self._num_blocks == 1 and node.device.type == "cpu":
            output = output + self._decode(1, self._only_block(v, own, parent, is_wanted))
        else:
            links, e = ParentLinks(parent, self._edges, node), None
            for stage in range(1, self._num_blocks + 1):
                v, e = self._gn_block(self._stages[stage - 1], links, v, e)
                output = output + self._decode(stage, picked(v, wanted))
        if wanted is not None:
            output = output.new_zeros(parent.numel(), output.shape[1]).index_copy(0, wanted, output)
        return output.view(*parent.shape, output.shape[1])

    def _decode(self, stage: int, node: Float[Tensor, "n C"]) -> Float[Tensor, "n O"]:
        decoded = hidden(self._stages[stage].decoder(node), self._decoder[1:-1])
        return self._outputs[stage](decoded)

    def _only_block(
        self,
        node: Float[Tensor, "n C"],
        wanted: Float[Tensor, "w C"],
        parent: Int[Tensor, "R N"],
        is_wanted: Bool[Tensor, "R N"] | None,
    ) -> Float[Tensor, "w C"]:
        """As `_gn_block`, if no other follows and edges have one hidden layer."""
        entries = self._stages[0]
        asked = np.ones(parent.shape, np.bool_) if is_wanted is None else as_array(is_wanted)
        edges = edges_to(as_array(parent), np.array(IS_UPWARD[self._edges]), asked)
        total = EdgeSums.apply(
            entries.receiver(wanted),
            node @ entries.sender.weight.T,
            self._encoded_edges + entries.sender.bias,
            edges,
        )
        degree = torch.from_numpy(np.bincount(edges.end, minlength=len(wanted))).to(node.dtype)
        mean = total * degree.clamp(min=1).reciprocal()[:, None]
        return self._update_nodes(entries.node(wanted), mean, degree.sign())

    def _gn_block(
        self,
        entries: Entries,
        links: "ParentLinks",
        node: Float[Tensor, "n C"],
        edge: list[Tensor] | None,
    ) -> tuple[Float[Tensor, "n C"], list[Tensor]]:
        """Nodes and edges, by direction, before the last layers of NN_v and NN_e; None: encoded."""
        ends = links.from_ends(entries.receiver(node), entries.sender(node))
        edge = list(self._encoded_edges) if edge is None else [self._edge_again(e) for e in edge]
        edge = [hidden(x.add_(e), self._edge[1:-1]) for x, e in zip(ends, edge, strict=True)]
        return self._update_nodes(entries.node(node), links.mean(edge), links.has_edge), edge

    def _update_nodes(
        self,
        entered: Float[Tensor, "n C"],
        mean: Float[Tensor, "n C"],
        has_edge: Float[Tensor, "n"],
    ) -> Float[Tensor, "n C"]:
        """NN_v, from its first layer's part for the node and the edges' mean before their last."""
        entered = entered.addmm_(mean, self._mean.weight.T)
        entered = entered.addr_(has_edge, self._mean.bias)  # without edges the mean is 0
        return hidden(entered, self._node[1:-1])


def picked(x: Float[Tensor, "n *C"], rows: Int[Tensor, "w"] | None) -> Float[Tensor, "w *C"]:
    """Return these rows; None is all of them."""
    return x if rows is None else x.index_select(0, rows)


class ParentLinks:
    """One edge per node and direction, between it and its parent.

    A node without a parent has an edge with itself that counts for nothing: so the edges of one
    direction are as many as the nodes, and only the parents' rows have to be looked up.
    """

    def __init__(self, parent: Int[Tensor, "R N"], edges: Edges, like: Tensor) -> None:
        """Find the ends; means have the type of `like` and are on its device."""
        self._is_upward = IS_UPWARD[edges]
        own = torch.arange(parent.numel(), device=parent.device).view(parent.shape)
        has_parent = parent >= 0
        self._parent = torch.where(has_parent, own[:, :1] + parent, own).flatten()
        count = has_parent.flatten().to(like.dtype)
        degree = torch.zeros_like(count)
        for is_up in self._is_upward:
            degree = degree.index_add(0, self._parent, count) if is_up else degree + count
        self.has_edge = degree.clamp(max=1)
        share = degree.clamp(min=1).reciprocal()
        self._share = [count * (share[self._parent] if up else share) for up in self._is_upward]

    def from_ends(
        self, receiver: Float[Tensor, "n C"], sender: Float[Tensor, "n C"]
    ) -> list[Float[Tensor, "n C"]]:
        """For every edge, its receiver's row of one array plus its sender's of another."""
        return [
            receiver.index_select(0, self._parent).add_(sender)
            if is_up
            else sender.index_select(0, self._parent).add_(receiver)
            for is_up in self._is_upward
        ]

    def mean(self, edge: list[Float[Tensor, "n C"]]) -> Float[Tensor, "n C"]:
        """For each node, the mean over the edges that it receives; 0 without any."""
        total = torch.zeros_like(edge[0])
        for is_up, share, rows in zip(self._is_upward, self._share, edge, strict=True):
            part = rows * share[:, None]
            total = total.index_add_(0, self._parent, part) if is_up else total.add_(part)
        return total
