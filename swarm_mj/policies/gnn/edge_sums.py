"""Means over the edges that end at each node, in one compiled pass, for `gnn.fast.OneBlock`."""

from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from swarm_mj.system.compiled import compiled

ZERO = np.float32(0.0)  # of the least type, so that float32 stays that

Rows = Float[np.ndarray, "_ C"]


class WantedEdges(NamedTuple):
    """Edges that end at nodes that are asked for, graph by graph."""

    end: Int[np.ndarray, "e"]  # counted among those nodes
    start: Int[np.ndarray, "e"]  # counted among all nodes
    direction: Int[np.ndarray, "e"]
    degree: Int[np.ndarray, "w"]  # how many end at each of those nodes


@compiled()
def edges_to(
    parent: Int[np.ndarray, "R N"],
    is_upward: Bool[np.ndarray, "D"],
    is_wanted: Bool[np.ndarray, "R N"],
) -> WantedEdges:
    """Return the edges between nodes and parents, in each direction; a parent of -1 is none."""
    num_graphs, num_nodes = parent.shape
    # Room for as many as there can be; the rest is cut off at the end.
    max_edges = parent.size * len(is_upward)
    end = np.empty(max_edges, np.int64)
    start = np.empty(max_edges, np.int64)
    direction = np.empty(max_edges, np.int64)
    degree = np.zeros(is_wanted.sum(), np.int64)
    place = np.empty(num_nodes, np.int64)  # of a graph's nodes, among all that are wanted
    num = 0  # edges
    num_wanted = 0
    for r in range(num_graphs):
        for k in range(num_nodes):
            place[k] = num_wanted if is_wanted[r, k] else -1
            num_wanted += is_wanted[r, k]
        for child in range(num_nodes):
            above = parent[r, child]
            if above < 0:
                continue
            for d in range(len(is_upward)):
                receiver = child
                sender = above
                if is_upward[d]:
                    receiver = above
                    sender = child
                if place[receiver] >= 0:
                    end[num] = place[receiver]
                    # All nodes send, wanted or not, so senders keep their places among all.
                    start[num] = r * num_nodes + sender
                    direction[num] = d
                    degree[place[receiver]] += 1
                    num += 1
    return WantedEdges(end[:num], start[:num], direction[:num], degree)


class EdgeMeans(torch.autograd.Function):
    """For each wanted node, the mean over its edges of relu(receiver + sender + direction).

    In one pass: torch would go through memory once for every step of it, and again backwards.
    """

    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401 - torch's own
        receiver: Float[Tensor, "w C"],
        sender: Float[Tensor, "n C"],
        direction: Float[Tensor, "D C"],
        edges: WantedEdges,
    ) -> Float[Tensor, "w C"]:
        """Return the means, 0 without edges; all tensors are on a CPU."""
        total = torch.zeros_like(receiver)
        _sum(as_array(receiver), as_array(sender), as_array(direction), edges, total.numpy())
        ctx.save_for_backward(receiver, sender, direction)
        ctx.edges = edges  # `save_for_backward` takes tensors only
        degree = torch.from_numpy(edges.degree).clamp(min=1)  # a node without edges divides 0 by 1
        ctx.share = degree.to(total.dtype).reciprocal()[:, None]  # of an edge in its end's mean
        return total.mul_(ctx.share)

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor | None, ...]:  # noqa: ANN401 - torch's own
        """Return the gradients of the first three arguments, from that of the means."""
        receiver, sender, direction = ctx.saved_tensors
        of_receiver = torch.zeros_like(receiver)
        of_sender = torch.zeros_like(sender)
        of_direction = torch.zeros_like(direction)
        _spread(
            receiver=as_array(receiver),
            sender=as_array(sender),
            direction=as_array(direction),
            edges=ctx.edges,
            gradient=as_array(gradients[0] * ctx.share),
            of_receiver=of_receiver.numpy(),
            of_sender=of_sender.numpy(),
            of_direction=of_direction.numpy(),
        )
        return of_receiver, of_sender, of_direction, None


def as_array(tensor: Tensor) -> np.ndarray:
    """Return a tensor's numbers, which may be the tensor's own memory."""
    return tensor.detach().contiguous().numpy()


@compiled()
def _sum(receiver: Rows, sender: Rows, direction: Rows, edges: WantedEdges, total: Rows) -> None:
    for to, start, d in zip(edges.end, edges.start, edges.direction):  # noqa: B905 - not compiled
        for c in range(total.shape[1]):
            total[to, c] += max(receiver[to, c] + sender[start, c] + direction[d, c], ZERO)


@compiled()
def _spread(
    receiver: Rows,
    sender: Rows,
    direction: Rows,
    edges: WantedEdges,
    gradient: Rows,
    of_receiver: Rows,
    of_sender: Rows,
    of_direction: Rows,
) -> None:
    """Add each edge's part of the gradient to those of its two ends and of its direction."""
    back = np.empty_like(direction[0])
    for to, start, d in zip(edges.end, edges.start, edges.direction):  # noqa: B905 - not compiled
        for c in range(len(back)):
            edge = receiver[to, c] + sender[start, c] + direction[d, c]
            back[c] = gradient[to, c] if edge > 0 else ZERO  # as of a ReLU
        # One array at a time: loops over few arrays are compiled to vectors.
        _add(of_receiver[to], back)
        _add(of_sender[start], back)
        _add(of_direction[d], back)


@compiled()
def _add(row: Float[np.ndarray, "C"], more: Float[np.ndarray, "C"]) -> None:
    for c in range(len(row)):
        row[c] += more[c]
