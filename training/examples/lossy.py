"""A channel of one's own: the mission's radio, but each robot misses 30 % of what it would decode.

swarm-mj fly --channel training.examples.lossy:Lossy --robots 20
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Stream, uniform
from swarm_mj.radio.mission_radio import radio_of

LOST = 0.3  # of the packets


class Lossy:
    """The mission's radio, with losses that no policy knows of."""

    def __init__(self, mission: Mission) -> None:
        """Take the mission, whose radio it is."""
        self._radio = radio_of(mission)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Begin missions, with a generator for each."""
        self._draws = Stream(rngs, uniform, (num_robots,))

    def __call__(
        self, position_m: Float[np.ndarray, "B N 2"], recipient: Int[np.ndarray, "B N"]
    ) -> Int[np.ndarray, "B N"]:
        """Return the sender that each robot decodes, or itself for none."""
        heard = self._radio(position_m, recipient)
        is_lost = self._draws.next() < LOST
        return np.where(is_lost, np.arange(heard.shape[1]), heard)
