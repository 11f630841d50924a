"""Random flooding (IV-C; Tseng et al., The broadcast storm problem, 2002)."""

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from jaxtyping import Int

from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.policies.policy import DecentralisedPolicy, check_probability
from swarm_mj.protocol.local_views import LocalViews


class RandomFlooding(DecentralisedPolicy):
    """Every robot rebroadcasts with probability p, twice per window, unanswered (IV-C).

    The packet is addressed to a robot drawn from the whole team, as in the authors' code. Uses no
    information but the team's size.
    """

    transmits_twice: ClassVar[bool] = True
    moves_each_transmission: ClassVar[bool] = True  # the authors' other policies move once

    def __init__(self, probability: float) -> None:
        """Prepares the policy.

        Args:
            probability: Of a robot's transmission, in each half window.

        Raises:
            ValueError: The probability is not in [0, 1].
        """
        self._probability = check_probability(probability)

    @property
    def parameters(self) -> dict[str, float]:
        """The probability of a transmission."""
        return {"probability": self._probability}

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Gives every robot its own stream of numbers; arguments as in `Policy.start`."""
        self._stream = Stream(rngs, uniform, (2, num_robots))

    def recipients(self, views: LocalViews) -> Int[np.ndarray, "B N"]:
        """Whom each robot addresses in the next half window."""
        drawn = self._stream.next()
        anyone = (drawn[:, 1] * views.num_robots).astype(np.int64)
        return np.where(drawn[:, 0] < self._probability, anyone, views.silence)
