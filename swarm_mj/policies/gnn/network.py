"""The Aggregation GNN (III-A, Eqs. 11-14): nodes and their parents in, numbers for each node out.

This is the definition: `edges_of` makes the graph, `gn_block` calls `mean_aggregation` and the
perceptrons in `Core`, and `AggregationGnn` joins them. Nothing else needs to be read to know what a
network computes. `gnn.fast` computes the same numbers in fewer steps, and says
in one place, `FastAggregationGnn.form`, which networks it does so for.
"""

import itertools
from typing import NamedTuple

import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor, nn

from swarm_mj.policies.policy_config import Edges, GnnShape

NodeRows = Float[Tensor, "n C"]
EdgeRows = Float[Tensor, "e C"]


class EdgeSet(NamedTuple):
    """All edges of R graphs of N nodes each; node k of graph r is row r N + k."""

    receiver: Int[Tensor, "e"]
    sender: Int[Tensor, "e"]
    feature: Float[Tensor, "e 1"]  # their direction where there are two: 1 from parent to child


def edges_of(parent: Int[Tensor, "R N"], edges: Edges, dtype: torch.dtype) -> EdgeSet:
    """Return the edges between children and parents; a node whose parent is -1 has none."""
    graph, child = (parent >= 0).nonzero(as_tuple=True)
    first = graph * parent.shape[1]
    below = first + child
    above = first + parent[graph, child]
    zero = torch.zeros(len(child), 1, dtype=dtype, device=parent.device)
    if edges == "paper":
        return EdgeSet(receiver=above, sender=below, feature=zero)
    if edges == "reference":
        return EdgeSet(receiver=below, sender=above, feature=zero)
    return EdgeSet(
        receiver=torch.cat([above, below]),
        sender=torch.cat([below, above]),
        feature=torch.cat([zero, zero + 1]),
    )


class Perceptron(nn.ModuleList):
    """Linear layers of equal width, with a ReLU after all but the last."""

    def __init__(self, num_inputs: int, shape: GnnShape) -> None:
        widths = [num_inputs, *[shape.latent] * shape.depth]
        layers = [nn.Linear(*ends) for ends in itertools.pairwise(widths)]
        super().__init__(layers)
        self.layers = layers  # as a ModuleList has modules of any kind

    def forward(self, x: Float[Tensor, "n In"]) -> Float[Tensor, "n C"]:
        """Apply the layers."""
        *hidden, last = self.layers
        for layer in hidden:
            x = torch.relu(layer(x))
        return last(x)


class Perceptrons(nn.Module):
    """A perceptron for nodes and, where edges take part, one for edges."""

    def __init__(self, node: Perceptron, edge: Perceptron | None = None) -> None:
        super().__init__()
        self.node = node
        if edge is not None:
            self.edge = edge


class Core(Perceptrons):
    """The non-linear updates, NN_e and NN_v (Eq. 13).

    They are of [e, v_r, v_s], one row per edge, and of [mean of e', v], one row per node.
    """


def mean_aggregation(edge: EdgeRows, receiver: Int[Tensor, "e"], num_nodes: int) -> NodeRows:
    """For each node, the mean over the edges it receives, 0 without any (Eq. 12)."""
    count = edge.new_zeros(num_nodes).index_add(0, receiver, edge.new_ones(len(edge)))
    total = edge.new_zeros(num_nodes, edge.shape[1]).index_add(0, receiver, edge)
    return total / count.clamp(min=1)[:, None]


def gn_block(
    core: Core | None, node: NodeRows, edge: Float[Tensor, "e _"], edges: EdgeSet
) -> tuple[NodeRows, EdgeRows]:
    """Update all edges by their ends, and all nodes by the mean of their edges (Eq. 11).

    Without a core, in the linear variant, edges copy their senders, so that GN(v) = A v.
    """
    sender = node[edges.sender]
    if core is None:
        return mean_aggregation(sender, edges.receiver, len(node)), sender
    edge = core.edge(torch.cat([edge, node[edges.receiver], sender], dim=1))
    mean = mean_aggregation(edge, edges.receiver, len(node))
    node = core.node(torch.cat([mean, node], dim=1))
    return node, edge


class Network(nn.Module):
    """A network that decides: the features of the nodes of R graphs in, numbers for each node out.

    `AggregationGnn` is the paper's. A subclass of yours trains, is stored and flies as `--network
    module:Name`. It is made with a `GnnShape` alone, and its last layer, `self.output`, must be a
    `torch.nn.Linear` to `shape.num_outputs` numbers. What it computes for a robot may depend on
    that robot's graph only, and on its memory.

    A robot remembers `memory_size` numbers from one window to the next, at first zeros. Before each
    decision `remember` returns them anew, and `forward` gets them as its last argument. Gradients
    reach one update back: what is to be learned over several windows, a memory must hold.
    """

    memory_size: int = 0  # H: numbers that each robot remembers; 0, as in the paper, is none

    def __init__(self, shape: GnnShape) -> None:
        """Take what there is to know of its inputs, outputs and layers."""
        super().__init__()
        self.shape = shape

    def forward(
        self,
        node: Float[Tensor, "R N F"],
        parent: Int[Tensor, "R N"],
        is_wanted: Bool[Tensor, "R N"] | None = None,
        memory: Float[Tensor, "R H"] | None = None,
    ) -> Float[Tensor, "R N O"]:
        """Return numbers for each node.

        Args:
            node: The features of each node.
            parent: A node of the same graph, or -1 for none: the edges.
            is_wanted: Nodes whose numbers count; None is all.
            memory: What each robot remembers now; None of a network without a memory.
        """
        raise NotImplementedError

    def remember(
        self,
        node: Float[Tensor, "R N F"],
        parent: Int[Tensor, "R N"],
        owner: Int[Tensor, "R"],
        memory: Float[Tensor, "R H"],
    ) -> Float[Tensor, "R H"]:
        """Return what each robot remembers from now on.

        Args:
            node: The features of each node, as `forward` gets them next.
            parent: As above.
            owner: Each graph's robot itself, a node.
            memory: What it remembered before; zeros when a mission begins.
        """
        raise NotImplementedError


class AggregationGnn(Network):
    """Encodes, applies the GN block K times, decodes each stage, maps all linearly (Eq. 14)."""

    def __init__(self, shape: GnnShape) -> None:
        """Draw the parameters from PyTorch's own generator."""
        super().__init__(shape)
        width = shape.latent
        self.encoder = Perceptrons(Perceptron(shape.num_features, shape))
        self.core: Core | None = None
        if shape.has_core:
            self.encoder.edge = Perceptron(1, shape)
            self.core = Core(Perceptron(2 * width, shape), Perceptron(3 * width, shape))
        self.decoder = Perceptrons(Perceptron(width, shape))
        self.output = nn.Linear((shape.receptive_field + 1) * width, shape.num_outputs)

    def forward(
        self,
        node: Float[Tensor, "R N F"],
        parent: Int[Tensor, "R N"],
        is_wanted: Bool[Tensor, "R N"] | None = None,
        memory: Float[Tensor, "R H"] | None = None,
    ) -> Float[Tensor, "R N O"]:
        """Map the features of the nodes of R graphs to numbers for each node, without a memory.

        `parent` is a node of the same graph, or -1: no edge, as of the nodes that pad a smaller
        graph. Of nodes that are not wanted the numbers are 0; None is all. Raises as `check`.
        """
        del memory  # for subclasses
        self.check(node, parent)
        edges = edges_of(parent, self.shape.edges, node.dtype)
        v = self.encoder.node(node.flatten(0, 1))
        e = self.encoder.edge(edges.feature) if self.shape.has_core else edges.feature
        stages = [self.decoder.node(v)]
        for _ in range(self.shape.receptive_field):
            v, e = gn_block(self.core, v, e, edges)
            stages.append(self.decoder.node(v))
        output = self.output(torch.cat(stages, dim=1)).view(*parent.shape, self.shape.num_outputs)
        return output if is_wanted is None else output.masked_fill(~is_wanted[:, :, None], 0.0)

    def check(self, node: Tensor, parent: Tensor) -> None:
        """Raise ValueError on graphs that would give numbers without a meaning."""
        made_for = self.shape.num_features
        given = node.shape[-1]
        if given != made_for:
            raise ValueError(
                f"nodes must have the {made_for} features that the network was made for, "
                f"not {given}"
            )
        num_nodes = parent.shape[-1]
        if parent.numel() and (highest := int(parent.max())) >= num_nodes:
            raise ValueError(
                f"a parent must be one of its graph's nodes, 0 to {num_nodes - 1}, or -1 for "
                f"none, not {highest}"
            )
