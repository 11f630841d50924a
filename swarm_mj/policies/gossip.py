"""Innovation gossip: robots with news talk (rumour mongering, Demers et al. 1987, by radio)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.policies.policy import BroadcastPolicy, RandomTransmission
from swarm_mj.protocol.local_views import LocalViews


class InnovationGossip(RandomTransmission, BroadcastPolicy):
    """Every robot broadcasts the more likely the more news it has, twice a window, unanswered.

    News is how much its knowledge has become fresher since its own last broadcast: the rise of
    T^{i,j}, its own included, averaged over the team [windows]. A robot broadcasts with p times
    that, at most with certainty: p is per window of news. So robots that hear much pass it on soon,
    and one that hears nothing still reports its position now and then. Two unanswered broadcasts a
    window lead to a lower age than one packet that a neighbour answers.
    """

    uses = "how much it has learned since its last transmission"

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own numbers, and everything to tell; as `Policy.start`."""
        super().start(num_robots, rngs)
        self._sent = np.zeros((len(rngs), num_robots))  # mean T at the last broadcast [windows]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot that draws a broadcast, and remember what it sends."""
        known = np.mean(views.buffers.timestamp, axis=2)  # T never falls, so means tell its rise
        is_sending = self._stream.next() < self._probability * (known - self._sent)
        self._sent = np.where(is_sending, known, self._sent)
        return is_sending
