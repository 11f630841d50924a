"""Edges of one hidden layer and their mean at each node, in one compiled pass (Eqs. 11, 12).

torch would go through memory once for every step of it, and again backwards.
"""

from typing import Any

import numpy as np
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from swarm_mj.system.compiled import compiled

ZERO = np.float32(0.0)  # of the least type, so that float32 stays that


class EdgeMeans(torch.autograd.Function):
    """Of each wanted node, the mean over its edges of relu(receiver + sender + direction)."""

    @staticmethod
    def forward(
        ctx: Any,  # noqa: ANN401 - torch's own
        receiver: Float[Tensor, "w C"],
        sender: Float[Tensor, "R N C"],
        direction: Float[Tensor, "D C"],
        parent: Int[Tensor, "R N"],
        is_upward: Bool[Tensor, "D"],
        is_wanted: Bool[Tensor, "R N"],
    ) -> tuple[Float[Tensor, "w C"], Float[Tensor, "w"]]:
        """Return the means; all tensors are on a CPU.

        Args:
            ctx: What the way back needs.
            receiver: Each wanted node's part of the edges that lead to it, in their order.
            sender: Each node's part of the edges that start at it.
            direction: What edges of a direction have in common.
            parent: Each node's parent, or -1; every direction has an edge between the two.
            is_upward: Whether a direction is from children to parents.
            is_wanted: Nodes whose means are asked for.

        Returns:
            The means, and one over how many edges each node receives; both are 0 without any.
        """
        mean, share = torch.empty_like(receiver), torch.empty_like(receiver[:, 0])
        given = (receiver, sender, direction, parent, is_upward, is_wanted)
        _average(*map(_array, (*given, mean, share)))
        ctx.save_for_backward(*given, share)
        ctx.mark_non_differentiable(share)
        return mean, share

    @staticmethod
    def backward(
        ctx: Any,  # noqa: ANN401 - torch's own
        *gradients: Tensor,
    ) -> tuple[Tensor | None, ...]:
        """Gradients of the first three arguments, from that of the means."""
        given = ctx.saved_tensors
        back = [torch.empty_like(each) for each in given[:3]]
        _spread(*map(_array, (*given, gradients[0], *back)))
        return *back, None, None, None


def _array(tensor: Tensor) -> np.ndarray:
    return tensor.detach().contiguous().numpy()


@compiled()
def _average(
    receiver: Float[np.ndarray, "w C"],
    sender: Float[np.ndarray, "R N C"],
    direction: Float[np.ndarray, "D C"],
    parent: Int[np.ndarray, "R N"],
    is_upward: Bool[np.ndarray, "D"],
    is_wanted: Bool[np.ndarray, "R N"],
    mean: Float[np.ndarray, "w C"],
    share: Float[np.ndarray, "w"],
) -> None:
    """Fill `mean` and `share`."""
    first, place = 0, np.empty(parent.shape[1], dtype=np.int64)
    for r in range(parent.shape[0]):
        last = _place_wanted(is_wanted[r], first, place)
        mean[first:last], share[first:last] = 0, 0
        for child in range(len(place)):
            above = parent[r, child]
            for d in range(len(is_upward) if above >= 0 else 0):
                to, start = (place[above], child) if is_upward[d] else (place[child], above)
                if to >= 0:
                    share[to] += 1
                    for c in range(mean.shape[1]):
                        edge = receiver[to, c] + sender[r, start, c] + direction[d, c]
                        mean[to, c] += max(edge, ZERO)
        for k in range(first, last):
            share[k] = 1 / max(share[k], 1) * (share[k] > 0)
            mean[k] *= share[k]
        first = last


@compiled()
def _spread(
    receiver: Float[np.ndarray, "w C"],
    sender: Float[np.ndarray, "R N C"],
    direction: Float[np.ndarray, "D C"],
    parent: Int[np.ndarray, "R N"],
    is_upward: Bool[np.ndarray, "D"],
    is_wanted: Bool[np.ndarray, "R N"],
    share: Float[np.ndarray, "w"],
    gradient: Float[np.ndarray, "w C"],
    of_receiver: Float[np.ndarray, "w C"],
    of_sender: Float[np.ndarray, "R N C"],
    of_direction: Float[np.ndarray, "D C"],
) -> None:
    """Fill the last three with the gradients of what `_average` was given."""
    back, of_direction[...] = np.empty_like(direction[0]), 0
    first, place = 0, np.empty(parent.shape[1], dtype=np.int64)
    for r in range(parent.shape[0]):
        last = _place_wanted(is_wanted[r], first, place)
        of_receiver[first:last], of_sender[r] = 0, 0
        for child in range(len(place)):
            above = parent[r, child]
            for d in range(len(is_upward) if above >= 0 else 0):
                to, start = (place[above], child) if is_upward[d] else (place[child], above)
                if to >= 0:
                    for c in range(len(back)):
                        edge = receiver[to, c] + sender[r, start, c] + direction[d, c]
                        back[c] = gradient[to, c] * share[to] if edge > 0 else ZERO
                    _add_to_row(of_receiver, int(to), back)
                    _add_to_row(of_sender[r], int(start), back)
                    _add_to_row(of_direction, d, back)
        first = last


@compiled()
def _place_wanted(is_wanted: Bool[np.ndarray, "N"], first: int, place: Int[np.ndarray, "N"]) -> int:
    """Fill `place`: each wanted node's row, counted from `first`, else -1; returns the next."""
    for k in range(len(place)):
        place[k] = first if is_wanted[k] else -1
        first += is_wanted[k]
    return first


@compiled()
def _add_to_row(rows: Float[np.ndarray, "n C"], k: int, row: Float[np.ndarray, "C"]) -> None:
    """Add to one row; loops over few arrays are compiled to vectors."""
    for c in range(len(row)):
        rows[k, c] += row[c]
