"""Innovation gossip: whoever has news talks (rumour mongering, Demers et al. 1987, on the air)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.policies.policy import BroadcastPolicy, RandomTransmission
from swarm_mj.protocol.local_views import LocalViews


class InnovationGossip(RandomTransmission, BroadcastPolicy):
    """Every robot broadcasts the more likely the more is new to tell, twice a window, unanswered.

    What is new is how much its knowledge has become fresher since its own last broadcast: the rise
    of T^{i,j}, its own included, averaged over the team [windows]. A robot broadcasts with p times
    that, and at most with certainty: p is for each window of news. So robots that hear much pass it
    on soon, and one that hears nothing still tells where it is now and then. Nobody answers: two
    unanswered broadcasts a window cost less age than one packet that a neighbour answers. Uses the
    robot's own buffer, and what it remembers of it.
    """

    uses = "how much it has learned since its last transmission"

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own numbers, and all to tell; arguments as in `Policy.start`."""
        super().start(num_robots, rngs)
        self._told = np.zeros((len(rngs), num_robots))  # mean T at the last broadcast [windows]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Each robot that draws a broadcast; it remembers what it told."""
        knows = np.mean(views.buffers.timestamp, axis=2)  # T never falls, so means tell its rise
        is_telling = self._stream.next() < self._probability * (knows - self._told)
        self._told = np.where(is_telling, knows, self._told)
        return is_telling
