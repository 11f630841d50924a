"""The ego robot's parent tree (II-B) as a drawing: hops to the right, leaves below each other."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int


def dendrogram(
    parent: Int[np.ndarray, "T N"], is_known: Bool[np.ndarray, "T N"], root: int
) -> Float[np.ndarray, "T N 2"]:
    """Where each robot stands that the root, the ego robot, has heard of; nan for the others.

    x is its depth [hops], y its height, 0 to 1; `parent` is P of the root's buffer.
    """
    place = np.full((*parent.shape, 2), np.nan)
    is_child = is_known & (np.arange(parent.shape[1]) != root)
    for parents, known, its in zip(parent.tolist(), is_child, place, strict=True):
        _place(parents, np.flatnonzero(known).tolist(), root, its)
    return place


def _place(
    parent: Sequence[int], known: Sequence[int], root: int, place: Float[np.ndarray, "N 2"]
) -> None:
    """Depth first, so that subtrees stay together; a parent stands amid its children."""
    children: dict[int, list[int]] = {}
    for k in known:
        children.setdefault(parent[k], []).append(k)
    depth, order, stack = {root: 0.0}, [], [root]
    while stack:
        j = stack.pop()
        order.append(j)
        stack.extend(reversed(children.get(j, [])))
        depth.update((k, depth[j] + 1.0) for k in children.get(j, []))
    leaves = [j for j in order if j not in children]
    height = {j: float(rank) for rank, j in enumerate(leaves)}
    for j in reversed(order):  # children before parents
        if j in children:
            height[j] = sum(height[k] for k in children[j]) / len(children[j])
    for j in order:
        place[j] = (depth[j], height[j] / (len(leaves) - 1) if len(leaves) > 1 else 0.5)
