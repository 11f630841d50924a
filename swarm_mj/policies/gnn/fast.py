"""The Aggregation GNN of `gnn.network` in fewer steps; its numbers are the same up to rounding.

`FastAggregationGnn.form` says which networks are evaluated in which of three forms: as they are
defined, or in one of the two here, `AllBlocks` and, compiled, `OneBlock`. They round differently,
so who flies or trains must stay with the form that it has. The tests hold them equal.

Linear maps commute with the choice of an edge's ends and with the mean over edges, so they are
applied to nodes first, and a layer on a concatenation is a sum of layers. Two linear layers with
nothing between them are one: the last of each perceptron is composed with the first of all those
behind it. Input edges are encoded once for each direction, as they are all alike. Only nodes that
are asked for go through the last layers.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from swarm_mj.policies.gnn.edge_sums import EdgeMeans, as_array, edges_to
from swarm_mj.policies.gnn.network import AggregationGnn, edges_of, mean_aggregation

NODES_AT_ONCE = 6400  # on a CPU: with more the caches spill, with fewer every step starts in vain
IS_UPWARD = {"paper": (True,), "reference": (False,), "both": (True, False)}  # child to parent

Rows = Float[Tensor, "n C"]
Parents = Int[Tensor, "R N"]
Asked = Bool[Tensor, "R N"]


class FastAggregationGnn(AggregationGnn):
    """An `AggregationGnn` that composes layers and leaves out what nobody asks for."""

    def forward(
        self,
        node: Float[Tensor, "R N F"],
        parent: Parents,
        is_wanted: Asked | None = None,
        memory: Float[Tensor, "R H"] | None = None,
    ) -> Float[Tensor, "R N O"]:
        """As `AggregationGnn.forward`, to which the linear variant and a depth of 1 are left."""
        del memory
        self.check(node, parent)
        evaluate = self.form(node.device)
        num_chunks = 1
        if node.device.type == "cpu":
            num_chunks = max(1, -(-parent.numel() // NODES_AT_ONCE))
        asked = torch.ones_like(parent, dtype=torch.bool) if is_wanted is None else is_wanted
        parts = zip(
            node.chunk(num_chunks),
            parent.chunk(num_chunks),
            asked.chunk(num_chunks),
            strict=True,
        )
        return torch.cat([evaluate(*part) for part in parts])

    def form(self, device: torch.device) -> Callable[..., Float[Tensor, "R N O"]]:
        """Return what evaluates this network on a device: the only place that chooses.

        - `AggregationGnn.forward`, the definition: the linear variant, and perceptrons of one
          layer, which leave nothing to compose.
        - `OneBlock`, on a CPU: one GN block whose edges have one hidden layer. So are the usual
          network of credit per robot and the shipped `gnn`.
        - `AllBlocks`: all others, such as the paper's own.
        """
        shape = self.shape
        if not shape.has_core or shape.depth == 1:
            return super().forward
        if shape.receptive_field == 1 and shape.depth == 2 and device.type == "cpu":
            return OneBlock(self)
        return AllBlocks(self)


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


def hidden(x: Rows, layers: list[nn.Linear]) -> Rows:
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


class Composed(ABC):
    """A network's layers, cut at concatenations and composed across perceptrons."""

    def __init__(self, network: AggregationGnn) -> None:
        """Compose the weights as they are now; gradients flow back to them."""
        assert network.core is not None
        self._shape = network.shape
        self._is_upward = IS_UPWARD[network.shape.edges]
        self._encoder = network.encoder.node.layers
        self._decoder = network.decoder.node.layers
        self._edge = network.core.edge.layers
        self._node = network.core.node.layers
        of_edge, of_receiver, of_sender = self._edge[0].weight.chunk(3, dim=1)
        of_mean, of_node = self._node[0].weight.chunk(2, dim=1)
        none = torch.zeros_like(self._edge[0].bias)
        entries = Entries(
            decoder=Layer(self._decoder[0].weight, self._decoder[0].bias),
            node=Layer(of_node, self._node[0].bias),
            receiver=Layer(of_receiver, self._edge[0].bias),
            sender=Layer(of_sender, none),
        )
        later = [entries.after(self._node[-1])] * network.shape.receptive_field
        self._stages = [entries.after(self._encoder[-1]), *later]
        self._edge_again = Layer(of_edge, none).after(self._edge[-1])
        self._mean = Layer(of_mean, none).after(self._edge[-1])
        outputs = network.output.weight.chunk(len(self._stages), dim=1)
        no_output = torch.zeros_like(network.output.bias)
        self._outputs = [Layer(w, no_output).after(self._decoder[-1]) for w in outputs]
        self._output_bias = network.output.bias
        feature = none.new_tensor([[direction] for direction in range(len(self._is_upward))])
        self._encoded_edges = network.encoder.edge(feature) @ of_edge.T

    def __call__(
        self, node: Float[Tensor, "R N F"], parent: Parents, is_wanted: Asked
    ) -> Float[Tensor, "R N O"]:
        """Evaluate the network; arguments as in `AggregationGnn.forward`."""
        wanted = is_wanted.flatten().nonzero().squeeze(1)
        output = self._of_wanted(node.flatten(0, 1), parent, is_wanted, wanted)
        everyone = output.new_zeros(parent.numel(), output.shape[1])
        return everyone.index_copy(0, wanted, output).view(*parent.shape, output.shape[1])

    @abstractmethod
    def _of_wanted(
        self, node: Rows, parent: Parents, is_wanted: Asked, wanted: Int[Tensor, "w"]
    ) -> Float[Tensor, "w O"]:
        """Return the numbers of the wanted nodes, also given by their rows; others may be left."""

    def _decode(self, stage: int, node: Rows) -> Float[Tensor, "n O"]:
        decoded = hidden(self._stages[stage].decoder(node), self._decoder[1:-1])
        return self._outputs[stage](decoded)


class AllBlocks(Composed):
    """The GN block, as often as it is applied; nodes count only as far as wanted ones hear them."""

    def _of_wanted(
        self, node: Rows, parent: Parents, is_wanted: Asked, wanted: Int[Tensor, "w"]
    ) -> Float[Tensor, "w O"]:
        edges = edges_of(parent, self._shape.edges, node.dtype)
        is_needed = is_wanted.flatten().clone()
        for _ in range(self._shape.receptive_field):
            is_needed[edges.sender[is_needed[edges.receiver]]] = True
        is_kept = is_needed[edges.receiver] & is_needed[edges.sender]
        place = is_needed.cumsum(0) - 1
        receivers, end = place[edges.receiver[is_kept]].unique(return_inverse=True)
        senders, start = place[edges.sender[is_kept]].unique(return_inverse=True)
        e = self._encoded_edges.index_select(0, edges.feature[is_kept].flatten().long())
        asked = place[wanted]
        v = hidden(self._encoder[0](node[is_needed]), self._encoder[1:-1])
        output = self._output_bias + self._decode(0, v.index_select(0, asked))
        for stage, entries in enumerate(self._stages[:-1], start=1):
            e = e if stage == 1 else self._edge_again(e)
            ends = entries.receiver(v.index_select(0, receivers)).index_select(0, end).add_(e)
            sent = entries.sender(v.index_select(0, senders))
            e = hidden(ends.add_(sent.index_select(0, start)), self._edge[1:-1])
            mean = mean_aggregation(e, end, len(receivers))
            entered = entries.node(v).index_add_(0, receivers, mean @ self._mean.weight.T)
            entered = entered.index_add_(0, receivers, self._mean.bias.expand_as(mean))
            v = hidden(entered, self._node[1:-1])
            output = output + self._decode(stage, v.index_select(0, asked))
        return output


class OneBlock(Composed):
    """The GN block once, with edges of one hidden layer, whose means `gnn.edge_sums` compiles."""

    def _of_wanted(
        self, node: Rows, parent: Parents, is_wanted: Asked, wanted: Int[Tensor, "w"]
    ) -> Float[Tensor, "w O"]:
        v = hidden(self._encoder[0](node), self._encoder[1:-1])
        entries = self._stages[0]
        own = v.index_select(0, wanted)
        output = self._output_bias + self._decode(0, own)
        edges = edges_to(as_array(parent), np.array(self._is_upward), as_array(is_wanted))
        mean = EdgeMeans.apply(
            entries.receiver(own),
            v @ entries.sender.weight.T,
            self._encoded_edges + entries.sender.bias,
            edges,
        )
        has_edge = torch.from_numpy(edges.degree > 0).to(node.dtype)
        entered = entries.node(own).addmm_(mean, self._mean.weight.T)
        entered = entered.addr_(has_edge, self._mean.bias)  # without edges the mean is 0
        return output + self._decode(1, hidden(entered, self._node[1:-1]))
