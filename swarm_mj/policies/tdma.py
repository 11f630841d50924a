"""Time-division multiple access: one robot broadcasts after the other."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.policies.policy import DecentralisedPolicy
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import PHASE


class Tdma(DecentralisedPolicy):
    """Each half window one robot broadcasts, in a fixed random order of identities, unanswered.

    Time-division multiple access (Miao, Zander, Sung, Slimane: Fundamentals of Mobile Data
    Networks, 2016). Nobody interferes, so whoever is in range decodes; the packet is addressed to
    the next in order, which changes nothing. Uses the robot's identity, the team's size, the order
    and the clock. The order is drawn for each mission and the same for all its robots: like the
    identities, it is granted before the mission (II-C).
    """

    transmits_twice: ClassVar[bool] = True

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draws every mission's order; arguments as in `Policy.start`."""
        self._order = draw_order(num_robots, rngs)

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """The next in order, for the one robot whose half window it is."""
        missions = np.arange(len(views.now))
        turn = half_windows(views.now)
        speaker = self._order[missions, turn % views.num_robots]
        recipient = views.silence.copy()
        recipient[missions, speaker] = self._order[missions, (turn + 1) % views.num_robots]
        return recipient


def draw_order(num_robots: int, rngs: Sequence[np.random.Generator]) -> Int[np.ndarray, "B N"]:
    """A random order of identities for each mission.

    Args:
        num_robots: N.
        rngs: One generator per mission.

    Returns:
        The robot at each place of the order.
    """
    return np.stack([rng.permutation(num_robots) for rng in rngs])


def half_windows(now: Float[np.ndarray, "B"]) -> Int[np.ndarray, "B"]:
    """How many half windows have passed, by the synchronised clock."""
    return np.rint(now / PHASE).astype(np.int64)
