"""Random flooding (IV-C; Tseng et al., The broadcast storm problem, 2002)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.policy import BroadcastPolicy, RandomTransmission
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import DoubleBroadcast, WindowProtocol


class RandomFlooding(RandomTransmission, BroadcastPolicy):
    """Every robot rebroadcasts with probability p, twice per window, unanswered (IV-C).

    As in the authors' code a robot that transmits draws an addressee from the whole team, and is
    silent if it draws itself: so it transmits with p (N - 1) / N. The addressee matters only under
    their half-duplex rule, by which an addressed robot hears while it sends: only there packets
    name it, with `names_addressee`.
    """

    uses = "nothing: it transmits with probability p"

    def __init__(self, probability: float, *, names_addressee: bool = False) -> None:
        """Take the probability of a draw in each slot, and whether packets name an addressee."""
        super().__init__(probability)
        self._names_addressee = names_addressee

    def window(self, mission: Mission) -> WindowProtocol:
        """Return two broadcasts; in the authors' code robots also move twice."""
        return DoubleBroadcast(
            silence_is_attempt=mission.silence_is_attempt,
            moves_each_slot=mission.moves_each_transmission,
        )

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Give every robot its own stream of numbers; arguments as in `Policy.start`."""
        self._stream = Stream(rngs, uniform, (2, num_robots))

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot that draws a transmission, to a teammate."""
        return self._drawn(views) != views.silence

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return a broadcast's recipients, or the addressees, where packets name them."""
        return self._drawn(views) if self._names_addressee else super().recipients(views)

    def _drawn(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Return each robot's addressee; itself: it does not transmit."""
        drawn = self._stream.next()
        anyone = (drawn[:, 1] * views.num_robots).astype(np.int64)
        return np.where(drawn[:, 0] < self._probability, anyone, views.silence)
