"""Self-organised TDMA: frames in which every robot owns a slot that it chose itself.

The idea is that of SOTDMA, the access scheme of ships' transponders (ITU-R M.1371): stations
announce the slots that they reserve, and choose slots that are free where they are. Here nobody
needs to announce anything, for T says when a teammate last transmitted, and so which slot is its
own. So robots agree on who transmits when, however wrong they are about positions.

The mission begins with spatial TDMA. After three rounds everyone works out first slots for all,
from positions that hardly differ by then. From then on one robot after the other chooses anew: it
simulates the whole frame, from the positions and slots that it believes in, with itself in each
slot, and takes the one that keeps the team's information freshest. Neighbours' packets say whether
they decoded its own; a slot that is missed too often for chance counts as one that they cannot
hear it in. One slot in sixteen is left to robots that have lost a neighbour.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.sotdma.team import SotdmaSettings, SotdmaTeam
from swarm_mj.policies.tdma import SpatialTdma, draw_order, slot_of
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.mission_radio import Belief


class SelfOrganisedTdma(BroadcastPolicy):
    """TDMA whose slots robots choose themselves, announced implicitly by transmitting.

    Uses the robot's own buffer, T and P in packets that it decoded, its identity, the team's
    size, the order, the clock and the radio's range and threshold. Of what the mission grants of
    the channel it uses the mean powers.
    """

    uses = (
        "its buffer, T and P in packets, a common random order, the clock and the radio: robots "
        "own slots, announced implicitly by transmitting, and choose the slot that keeps the "
        "information freshest"
    )

    def __init__(
        self,
        radio: FreeSpaceRadio,
        turns: SpatialTdma,
        *,
        reads_packets: bool = True,
    ) -> None:
        """Prepare the policy, whose robots follow turns at first.

        They read packets that hold all of T and P as before the slot, and so say who was heard.
        """
        self._turns, self._reads_packets = turns, reads_packets
        self._belief = Belief(radio=radio)

    def inform(self, belief: Belief) -> None:
        """Take the powers that robots believe in."""
        self._belief = belief
        self._turns.inform(belief)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every mission's order; arguments as in `Policy.start`."""
        self._turns.start(num_robots, rngs)
        orders = draw_order(num_robots, rngs)
        self._teams = [SotdmaTeam(order, self._belief, SotdmaSettings()) for order in orders]
        self._uniform = Stream(rngs, uniform, (num_robots,))

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who owns the slot, or is in need where nobody does; at first, whose turn it is."""
        slot, transmits = slot_of(views.now), np.zeros(views.silence.shape, dtype=bool)
        if any(team.takes_turns for team in self._teams):
            transmits = self._turns.transmits(views)
        heard = views.phases[-1].heard if views.phases else views.silence
        draw = self._uniform.next()
        for b, team in enumerate(self._teams):
            read = heard[b] if self._reads_packets else views.silence[b]
            transmits[b] = team.transmits(
                int(slot[b]), transmits[b], views.buffers, b, read, draw[b]
            )
        return transmits
