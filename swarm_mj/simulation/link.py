"""The radio alone, for robots that another simulator moves: neither physics nor buffers."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int
from numpy.typing import ArrayLike

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Started, check_seeds, streams_of
from swarm_mj.mission.specification import OPEN
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.checks import check_robots
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import channel_at
from swarm_mj.radio.mission_radio import mission_radio


class Link:
    """The channels of B missions, each from its own seed, as those of `Swarm`."""

    def __init__(self, mission: Mission, seeds: Sequence[int] = (1,)) -> None:
        """Start all missions; raise ValueError without seeds, or if there are obstacles."""
        check_seeds(seeds)
        if mission.arena != OPEN:
            raise ValueError(f"a Link has no obstacles: arena must be open, not {mission.arena}")
        self._shape, self._now = (len(seeds), mission.num_robots), np.zeros(len(seeds))
        self._channel = mission_radio(mission).channel
        if isinstance(self._channel, Started):
            self._channel.start(mission.num_robots, streams_of(seeds).channel)

    def deliver(self, position_m: ArrayLike, wants_to_send: ArrayLike) -> Int[np.ndarray, "*B N"]:
        """Return the sender that each robot decodes in the next slot, or itself: nobody.

        Positions are [B N 2], and who sends to everyone is [B N]; there may also stand whom each
        robot addresses, itself for silence. A single mission needs no axis B. Raises ValueError.
        """
        sends, place_m = np.asarray(wants_to_send), np.array(position_m, dtype=np.float64)
        if sends.dtype == np.bool_:
            sends = np.where(sends, BROADCAST, np.arange(sends.shape[-1]))
        check_robots("wants_to_send", np.atleast_2d(sends), self._shape, may_broadcast=True)
        if place_m.shape != (due := (*sends.shape, 2)) or not np.all(np.isfinite(place_m)):
            raise ValueError(f"position_m must be finite, of shape {due}, not {place_m.shape}")
        self._now += SLOT_WINDOWS
        channel, recipient = channel_at(self._channel, self._now), np.atleast_2d(sends)
        heard = channel(place_m.reshape(*self._shape, 2), recipient.astype(np.int64))
        return heard.reshape(sends.shape)
