"""Round robin (IV-C; time-division multiple access around a base station, Miao et al. 2016)."""

import numpy as np
from jaxtyping import Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.protocol.local_views import LocalViews


class RoundRobin(CentralisedPolicy):
    """One robot after the other exchanges buffers with the one nearest the centre (IV-C).

    Centralised: the base station is chosen anew in each window from all true positions.
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
