"""The paper's baselines that know all true positions (IV-C): round robin, minimum spanning tree."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled


class RoundRobin(CentralisedPolicy):
    """Robots exchange buffers with a base in turn (IV-C).

    TDMA around a base station (Miao et al. 2016): the robot nearest the centre, chosen anew in each
    window.
    """

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the base, for the one robot whose turn it is."""
        recipient = views.silence.copy()
        _call_base(states.position_m, views.now, recipient)
        return recipient


@compiled()
def _call_base(
    position_m: Float[np.ndarray, "B N 2"],
    now: Float[np.ndarray, "B"],
    recipient: Int[np.ndarray, "B N"],
) -> None:
    num_robots = recipient.shape[1]
    for b in range(recipient.shape[0]):
        base = 0
        nearest_m2 = np.inf
        for i in range(num_robots):
            x, y = position_m[b, i]
            if x * x + y * y < nearest_m2:
                base = i
                nearest_m2 = x * x + y * y
        # Turns are those of all robots but the base, so identities from the base on move up by one.
        turn = int(now[b]) % (num_robots - 1)
        caller = turn + 1 if turn >= base else turn
        recipient[b, caller] = base


class MinimumSpanningTree(RandomTransmission, CentralisedPolicy):
    """Robots call their parent in a spanning tree (IV-C).

    Each exchanges buffers with it with probability p.
    """

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
