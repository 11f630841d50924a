"""The order of robots in a replay's tree and age matrix: along a tree, so that near ones meet."""

from collections.abc import Iterable, Sequence

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.replay.log import Log
from swarm_mj.replay.replay_size import in_matrix


def walk(
    parent: Sequence[int], robots: Iterable[int], root: int
) -> tuple[list[int], dict[int, list[int]]]:
    """Return the root and robots in depth-first order, last children first, and the children."""
    children: dict[int, list[int]] = {}
    for k in robots:
        children.setdefault(parent[k], []).append(k)
    order: list[int] = []
    stack = [root]
    while stack:
        order.append(stack.pop())
        stack.extend(children.get(order[-1], []))
    return order, children


def neighbours_together(log: Log) -> list[int]:
    """Return the places of the recorded matrix's rows in the order in which they are drawn."""
    parent = spanning_tree(log.position_m[:1])[0].tolist()
    num_robots = len(parent)
    recorded = {robot: place for place, robot in enumerate(in_matrix(num_robots))}
    walked, _ = walk(parent, range(num_robots), ROOT)
    # The tree's root is no robot. Of a large team only every k-th robot was recorded.
    return [recorded[robot] for robot in walked[1:] if robot in recorded]
