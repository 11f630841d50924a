"""Slotted ALOHA broadcast (Abramson 1970; Roberts 1975)."""

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.mission.geometry import squared_distance
from swarm_mj.policies.policy import BroadcastPolicy, RandomTransmission
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.system.compiled import compiled


class Aloha(RandomTransmission, BroadcastPolicy):
    """Every robot broadcasts now and then, as often as its neighbourhood bears, unanswered.

    In slotted ALOHA what counts is the load that all n stations offer together, so each of them
    sends less the more there are. Here a neighbourhood's robots are its stations, and `probability`
    is that anyone of them broadcasts in a slot: each does so with 1 - (1 - p)^(1/n). The difference
    to random flooding is this n: flooding has one probability for everyone and knows nothing. Uses
    the robot's own buffer, the team's size and the range.
    """

    uses = "how many neighbours its buffer shows"

    def __init__(self, probability: float, *, range_m: float) -> None:
        """Take the probability and the distance at which a lone transmission just decodes [m]."""
        super().__init__(probability)
        self._range_m = range_m

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return each robot that draws a broadcast."""
        everyone_silent = 1.0 - self._probability
        chance = 1.0 - everyone_silent ** (1.0 / num_contenders(views, self._range_m))
        return self._stream.next() < chance


def num_contenders(views: LocalViews, range_m: float) -> Float[np.ndarray, "B N"]:
    """Return how many robots contend for each robot's neighbourhood, as far as it can tell.

    The team's size times the share of the known robots, itself included, believed in range: the
    whole team, then, until it has heard of anyone.
    """
    return _count(views.buffers.is_known, views.buffers.position_m, range_m)


@compiled()
def _count(
    is_known: Bool[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N 2"],
    range_m: float,
) -> Float[np.ndarray, "B N"]:
    num_missions, num_robots = is_known.shape[:2]
    contenders = np.empty((num_missions, num_robots))
    for b in range(num_missions):
        for i in range(num_robots):
            place_m = believed_m[b, i]
            num_known = num_near = 1
            for j in range(num_robots):
                if is_known[b, i, j] and j != i:
                    num_known += 1
                    num_near += squared_distance(place_m, j, i) <= range_m * range_m
            contenders[b, i] = num_robots * num_near / num_known
    return contenders
