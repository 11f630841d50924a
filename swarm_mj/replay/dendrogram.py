"""The ego robot's parent tree (II-B) as a drawing: hops to the right, leaves below each other."""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.compiled import compiled


def dendrogram(
    parent: Int[np.ndarray, "T N"], is_known: Bool[np.ndarray, "T N"], root: int
) -> Float[np.ndarray, "T N 2"]:
    """Places every known robot: x is its depth [hops], y its height, 0 to 1; nan when unknown.

    Args:
        parent: P of the root's buffer.
        is_known: Whether the root has heard of the robot.
        root: The ego robot.

    Returns:
        Places (x, y).
    """
    place = np.full((*parent.shape, 2), np.nan)
    is_child = is_known & (np.arange(parent.shape[1]) != root)
    _place_all(np.where(is_child, parent, -1), root, place)
    return place


@compiled()
def _place_all(
    parent: Int[np.ndarray, "T N"], root: int, place: Float[np.ndarray, "T N 2"]
) -> None:
    """Depth first, so that subtrees stay together; a parent stands amid its children."""
    num_robots = parent.shape[1]
    order = np.empty(num_robots, dtype=np.int64)
    for t in range(parent.shape[0]):
        num_visited, num_leaves = _descend(parent[t], root, order, place[t])
        _centre(parent[t], order[:num_visited], place[t])
        for j in order[:num_visited]:
            place[t, j, 1] = place[t, j, 1] / (num_leaves - 1) if num_leaves > 1 else 0.5


@compiled()
def _descend(
    parent: Int[np.ndarray, "N"],
    root: int,
    order: Int[np.ndarray, "N"],
    place: Float[np.ndarray, "N 2"],
) -> tuple[int, int]:
    """Sets depths and the heights of leaves; returns how many robots and leaves were visited."""
    stack = [root]
    num_visited = num_leaves = 0
    place[root, 0] = 0.0
    while len(stack):
        j = stack.pop()
        order[num_visited] = j
        num_visited += 1
        is_leaf = True
        for k in range(parent.shape[0] - 1, -1, -1):
            if parent[k] == j:
                place[k, 0] = place[j, 0] + 1.0
                stack.append(k)
                is_leaf = False
        if is_leaf:
            place[j, 1] = num_leaves
            num_leaves += 1
    return num_visited, num_leaves


@compiled()
def _centre(
    parent: Int[np.ndarray, "N"], order: Int[np.ndarray, "M"], place: Float[np.ndarray, "N 2"]
) -> None:
    """Sets the heights of all others, children before parents."""
    for j in order[::-1]:
        total = 0.0
        num_children = 0
        for k in range(parent.shape[0]):
            if parent[k] == j:
                total += place[k, 1]
                num_children += 1
        if num_children:
            place[j, 1] = total / num_children
