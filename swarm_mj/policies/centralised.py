"""The paper's baselines that know all true positions (IV-C): round robin, minimum spanning tree."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.protocol.window import LocalViews


class RoundRobin(CentralisedPolicy):
    """Robots exchange buffers with a base in turn (IV-C).

    TDMA around a base station (Miao et al. 2016): the robot nearest the centre, chosen anew in each
    window.
    """

    uses = "the true positions: a base near the middle talks to each robot in turn"

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the base, for the one robot whose turn it is."""
        missions = np.arange(len(views.now))
        base = np.argmin(np.sum(states.position_m**2, axis=2), axis=1)
        turn = views.now.astype(np.int64) % (views.num_robots - 1)
        turn += turn >= base
        recipient = views.silence.copy()
        recipient[missions, turn] = base
        return recipient


class MinimumSpanningTree(RandomTransmission, CentralisedPolicy):
    """Robots call their parent in a spanning tree (IV-C).

    Each exchanges buffers with it with probability p.
    """

    uses = "the true positions at the start: a robot talks to its parent in their spanning tree"

    def __init__(
        self, probability: float, *, is_recomputed: bool = False, root_transmits: bool = False
    ) -> None:
        """Take the probability of a robot's transmission, in each window.

        The tree may be recomputed in each window. With `root_transmits` the root addresses robot
        N - 1, as in the authors' code, where its missing parent, -1, counts from the end.
        """
        super().__init__(probability)
        self._is_recomputed, self._root_transmits = is_recomputed, root_transmits

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
