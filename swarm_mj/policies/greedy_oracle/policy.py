"""The greedy oracle: a scheduler that knows all buffers and positions at every moment.

A team could not fly it; it shows how low the age of information can go.
"""

import numpy as np
from jaxtyping import Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.greedy_oracle.link_scheduler import greedy_window
from swarm_mj.policies.policy import CentralisedPolicy
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import TrueLinks


class GreedyOracle(CentralisedPolicy):
    """Adds pairs while the age that the window removes grows: myopic, and not optimal.

    Centralised: it sees all buffers and all true positions. It addresses no robot that sends, even
    where the authors' code would let that robot hear.
    """

    uses = "all buffers, all true positions and the true channel except its fades, at every moment"

    def __init__(self, radio: FreeSpaceRadio) -> None:
        """Prepare the policy for a radio, which is true unless the policy is informed otherwise."""
        self._truth = TrueLinks(radio=radio)

    def inform(self, truth: TrueLinks) -> None:
        """Plan with the true channel from now on."""
        self._truth = truth

    def recipients(self, views: LocalViews, states: RobotStates) -> Int[np.ndarray, "B N"]:
        """Return the window's schedule; robots move before they talk, which it does not foresee."""
        timestamp = (SLOTS_PER_WINDOW * views.buffers.timestamp).astype(np.float32)
        windows = [
            greedy_window(
                timestamp[b],
                SLOTS_PER_WINDOW * float(views.now[b]),
                self._truth.links(states.position_m[b], b),
            )
            for b in range(len(timestamp))
        ]
        return np.stack(windows)
