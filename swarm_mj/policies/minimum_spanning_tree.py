"""Minimum spanning tree (IV-C): every robot talks to its parent in the tree of least length."""

from collections.abc import Sequence
from typing import no_type_check

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit

from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import CentralisedPolicy, check_probability
from swarm_mj.protocol.local_views import LocalViews

ROOT = -1  # the parent of the root


class MinimumSpanningTree(CentralisedPolicy):
    """Every robot exchanges buffers with its parent in the tree with probability p (IV-C).

    Centralised: the tree is built from all true positions at the start of the mission.
    """

    def __init__(
        self, probability: float, *, is_recomputed: bool = False, root_transmits: bool = False
    ) -> None:
        """Prepares the policy.

        Args:
            probability: Of a robot's transmission, in each window.
            is_recomputed: Whether the tree is built anew in each window.
            root_transmits: Whether the root addresses robot N - 1, as in the authors' code (its
                missing parent, -1, counts from the end there), or stays silent.

        Raises:
            ValueError: The probability is not in [0, 1].
        """
        self._probability = check_probability(probability)
        self._is_recomputed = is_recomputed
        self._root_transmits = root_transmits
        self._parent: np.ndarray | None = None

    @property
    def parameters(self) -> dict[str, float]:
        """The probability of a transmission."""
        return {"probability": self._probability}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forgets the last mission's tree; arguments as in `Policy.start`."""
        self._stream = Stream(rngs, uniform, (num_robots,))
        self._parent = None

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """The parent, for each robot that draws a transmission."""
        if self._parent is None or self._is_recomputed:
            self._parent = spanning_tree(states.position_m)
        rootless = np.int64(views.num_robots - 1) if self._root_transmits else views.silence
        parent = np.where(self._parent == ROOT, rootless, self._parent)
        return np.where(self._stream.next() < self._probability, parent, views.silence)


def spanning_tree(position_m: Float[np.ndarray, "B N 2"]) -> Int[np.ndarray, "B N"]:
    """Each robot's parent in the Euclidean minimum spanning tree, or `ROOT`.

    Prim's algorithm gives the edges; peeling leaves off until one robot is left directs them, so
    the root is a centre of the tree, and no robot is deeper than it must be.

    Args:
        position_m: Positions [m].

    Returns:
        The parents.
    """
    parent = np.empty(position_m.shape[:2], dtype=np.int64)
    _grow_and_peel(position_m, parent)
    return parent


@njit(cache=True)
@no_type_check
def _grow_and_peel(
    position_m: Float[np.ndarray, "... N 2"],
    parent: Int[np.ndarray, "... N"],
) -> None:
    num_missions, num_robots = parent.shape
    is_edge = np.empty((num_robots, num_robots), dtype=np.bool_)
    for b in range(num_missions):
        is_edge[:] = False
        _grow(position_m[b], is_edge)
        _peel(is_edge, parent[b])


@njit(cache=True)
@no_type_check
def _grow(
    position_m: Float[np.ndarray, "... N 2"],
    is_edge: Bool[np.ndarray, "N N"],
) -> None:
    """Prim's algorithm from robot 0."""
    num_robots = position_m.shape[0]
    nearest = np.zeros(num_robots, dtype=np.int64)
    squared_m2 = np.full(num_robots, np.inf)
    in_tree = np.zeros(num_robots, dtype=np.bool_)
    added = 0
    for _ in range(num_robots - 1):
        in_tree[added] = True
        closest = -1
        for j in range(num_robots):
            if not in_tree[j]:
                dx = position_m[added, 0] - position_m[j, 0]
                dy = position_m[added, 1] - position_m[j, 1]
                if dx * dx + dy * dy < squared_m2[j]:
                    squared_m2[j] = dx * dx + dy * dy
                    nearest[j] = added
                if closest < 0 or squared_m2[j] < squared_m2[closest]:
                    closest = j
        is_edge[closest, nearest[closest]] = is_edge[nearest[closest], closest] = True
        added = closest


@njit(cache=True)
@no_type_check
def _peel(
    is_edge: Bool[np.ndarray, "N N"],
    parent: Int[np.ndarray, "... N"],
) -> None:
    """Leaves point at their neighbour and go, round by round, until the root is left."""
    num_robots = parent.shape[0]
    degree = np.empty(num_robots, dtype=np.int64)
    for i in range(num_robots):
        degree[i] = is_edge[i].sum()
    parent[:] = ROOT
    num_left = num_robots
    while num_left > 1:
        leaves = np.flatnonzero(degree == 1)
        for leaf in leaves:
            if num_left > 1:
                neighbour = np.flatnonzero(is_edge[leaf])[0]
                parent[leaf] = neighbour
                is_edge[leaf, neighbour] = is_edge[neighbour, leaf] = False
                degree[leaf] = 0
                degree[neighbour] -= 1
                num_left -= 1
