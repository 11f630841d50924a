"""Time-division multiple access: one robot broadcasts after the other."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import SLOT_WINDOWS


class Tdma(BroadcastPolicy):
    """In each slot one robot broadcasts, in a fixed random order of identities, unanswered.

    Time-division multiple access (Miao, Zander, Sung, Slimane: Fundamentals of Mobile Data
    Networks, 2016). Nobody interferes, so every robot in range decodes. The order is drawn for each
    mission and the same for all its robots: like the identities, it is granted before the mission
    (II-C).
    """

    uses = "its identity, a common random order and the clock: one robot transmits per slot"

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw every mission's order; arguments as in `Policy.start`."""
        self._order = draw_order(num_robots, rngs)

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return the one robot whose slot it is."""
        place = slot_of(views.now) % views.num_robots
        owner = self._order[np.arange(len(place)), place]
        return views.silence == owner[:, None]


def draw_order(num_robots: int, rngs: Sequence[np.random.Generator]) -> Int[np.ndarray, "B N"]:
    """Return a random order for each mission: the robot at each place of it."""
    return np.stack([rng.permutation(num_robots) for rng in rngs])


def slot_of(now: Float[np.ndarray, "B"]) -> Int[np.ndarray, "B"]:
    """Return the slot that begins now, counted from 0 at the mission's start."""
    return np.rint(now / SLOT_WINDOWS).astype(np.int64)
