"""The paper's baselines that know all true positions (IV-C): round robin, minimum spanning tree."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.geometry import ROOT, spanning_tree
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.about import FEW_BYTES, FromPaper, Listed, Look
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.policies.random_access import RandomTransmission
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled


class RoundRobin(CentralisedPolicy):
    """Robots exchange buffers with a base in turn (IV-C).

    TDMA around a base station (Miao et al. 2016). The base is the robot nearest the middle of the
    area, chosen anew in each window, in which one other robot calls it.
    """

    about = Listed(
        name="round-robin",
        origin=FromPaper(section="IV-C"),
        rank=20,
        uses=(
            "the true positions, identities and the clock: each robot in turn talks to a base, the "
            "robot nearest the middle"
        ),
        beyond=(),
        payload=None,
        look=Look(label="round-robin", colour="#56b4e9", marker="s"),
        memory=FEW_BYTES,
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "RoundRobin":  # noqa: ARG003
        """Return the policy, which is the same for every mission."""
        return cls()

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the base, for the one robot whose turn it is."""
        recipient = views.silence.copy()
        _call_base(states.position_m, views.now, recipient)
        return recipient


@compiled()
def _call_base(
    position_m: Float[np.ndarray, "B N D"],
    now: Float[np.ndarray, "B"],
    recipient: Int[np.ndarray, "B N"],
) -> None:
    """Write the base as the recipient of the one robot whose turn it is, in each mission."""
    num_robots = recipient.shape[1]
    for b in range(recipient.shape[0]):
        base = 0
        nearest_m2 = np.inf
        for i in range(num_robots):
            x = position_m[b, i, 0]
            y = position_m[b, i, 1]
            if x * x + y * y < nearest_m2:
                base = i
                nearest_m2 = x * x + y * y
        # Turns are those of all robots but the base, so identities from the base on move up by one.
        turn = int(now[b]) % (num_robots - 1)
        caller = turn + 1 if turn >= base else turn
        recipient[b, caller] = base


class MinimumSpanningTree(RandomTransmission, CentralisedPolicy):
    """Robots call their parent in a spanning tree (IV-C).

    In each window, each exchanges buffers with it with probability p. The tree is the shortest one
    between true positions when the mission begins; in moving teams of the authors' code, between
    those of each window.
    """

    about = Listed(
        name="mst",
        origin=FromPaper(section="IV-C"),
        rank=30,
        uses=(
            "the true positions at the start (moving teams of --preset reference: in each window): "
            "a robot talks to its parent in their spanning tree, with probability p"
        ),
        beyond=(),
        payload=None,
        look=Look(label="mst", colour="#009e73", marker="^"),
        memory=FEW_BYTES,
    )

    @classmethod
    def with_probability(cls, mission: Mission, probability: float) -> "MinimumSpanningTree":
        """Return the policy for a mission, whose preset says what becomes of the tree."""
        return cls(
            probability,
            is_recomputed=mission.tree_recomputed,
            root_transmits=mission.tree_root_transmits,
        )

    def __init__(
        self, probability: float, *, is_recomputed: bool = False, root_transmits: bool = False
    ) -> None:
        """Take the probability of a robot's transmission, in each window.

        The tree may be recomputed in each window. With `root_transmits` the root addresses robot
        N - 1, as in the authors' code, where its missing parent, -1, counts from the end.

        Raises:
            ValueError: If the probability is no number from 0 to 1.
        """
        super().__init__(probability)
        self._is_recomputed = is_recomputed
        self._root_transmits = root_transmits

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Forget the last mission's tree; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        self._parent: np.ndarray | None = None  # [B N], of i or `ROOT`; none before a window

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the parent, for each robot that draws a transmission."""
        if self._parent is None or self._is_recomputed:
            self._parent = spanning_tree(states.position_m)
        in_place_of_none = views.silence
        if self._root_transmits:
            in_place_of_none = np.int64(views.num_robots - 1)
        parent = np.where(self._parent == ROOT, in_place_of_none, self._parent)
        transmits = self._stream.next() < self._probability
        return np.where(transmits, parent, views.silence)
