"""Minimum spanning tree (IV-C): every robot talks to its parent in the tree of least length."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import CentralisedPolicy, RandomTransmission
from swarm_mj.protocol.local_views import LocalViews


class MinimumSpanningTree(RandomTransmission, CentralisedPolicy):
    """Every robot exchanges buffers with its parent in the tree with probability p (IV-C).

    Centralised: the tree is built from all true positions at the start of the mission.
    """

    uses = "the true positions at the start: a robot talks to its parent in their spanning tree"

    def __init__(
        self, probability: float, *, is_recomputed: bool = False, root_transmits: bool = False
    ) -> None:
        """Prepare the policy.

        Args:
            probability: Of a robot's transmission, in each window.
            is_recomputed: Whether the tree is built anew in each window.
            root_transmits: Whether the root addresses robot N - 1, as in the authors' code (its
                missing parent, -1, counts from the end there), or stays silent.
        """
        super().__init__(probability)
        self._is_recomputed = is_recomputed
        self._root_transmits = root_transmits

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forget the last mission's tree; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        self._parent: np.ndarray | None = None

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the parent, for each robot that draws a transmission."""
        if self._parent is None or self._is_recomputed:
            self._parent = spanning_tree(states.position_m)
        rootless = np.int64(views.num_robots - 1) if self._root_transmits else views.silence
        parent = np.where(self._parent == ROOT, rootless, self._parent)
        return np.where(self._stream.next() < self._probability, parent, views.silence)
