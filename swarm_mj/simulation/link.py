"""The radio alone, for robots that another simulator moves: neither physics nor buffers."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int
from numpy.typing import ArrayLike

from swarm_mj.mission import Mission
from swarm_mj.mission.batched_rng import Started, check_seeds, streams_of
from swarm_mj.mission.surroundings import OPEN
from swarm_mj.protocol.buffers import BROADCAST
from swarm_mj.protocol.checks import as_array, checked_robots
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import channel_at
from swarm_mj.radio.mission_radio import mission_radio
from swarm_mj.system.arguments import check_kind


class Link:
    """The channels of B missions, each from its own seed, as those of `Swarm`.

    Args:
        mission: Its radio, and how many robots there are.
        seeds: One integer of 0 or more for each mission.

    Raises:
        ValueError: Without seeds, or if the mission has obstacles.
        TypeError: For what is no mission.

    Example:
        Robot 0 tells the two others, 100 m and 1 km away, something:

        >>> link = Link(paper("stationary", num_robots=3))
        >>> link.deliver([[0.0, 0.0], [100.0, 0.0], [1000.0, 0.0]], [True, False, False])
        array([0, 0, 2])
    """

    def __init__(self, mission: Mission, seeds: Sequence[int] = (1,)) -> None:
        """Start all missions."""
        check_kind("mission", mission, Mission, 'paper("stationary")')
        check_seeds(seeds)
        if mission.arena != OPEN:
            raise ValueError(f"a Link has no obstacles: arena must be open, not {mission.arena}")
        self._shape = len(seeds), mission.num_robots
        self._num_axes = mission.num_axes
        self._now = np.zeros(len(seeds))
        self._channel = mission_radio(mission).channel
        if isinstance(self._channel, Started):
            self._channel.start(mission.num_robots, streams_of(seeds).channel)

    def deliver(self, position_m: ArrayLike, wants_to_send: ArrayLike) -> Int[np.ndarray, "*B N"]:
        """Return what the channel makes of the packets of the next slot.

        A single mission needs no axis B, neither here nor in what is returned.

        Args:
            position_m: Where the robots are, [B, N, D], [m]; D is 2, or of bodies 3.
            wants_to_send: Who sends to everyone, [B, N]; or, as integers, whom each robot
                addresses, itself for silence and -1 for everyone.

        Returns:
            The sender that each robot decodes, [B, N], or itself: nobody.

        Raises:
            ValueError: For arrays of another shape or kind, places that are not finite, or
                addressees that are no robots.
        """
        sends = as_array("wants_to_send", wants_to_send)
        rows = np.atleast_2d(sends)
        if rows.dtype == np.bool_ and rows.shape == self._shape:
            rows = np.where(rows, BROADCAST, np.arange(self._shape[1]))
        recipient = checked_robots("wants_to_send", rows, self._shape, may_broadcast=True)
        place_m = _checked_places(position_m, due=(*sends.shape, self._num_axes))
        self._now += SLOT_WINDOWS
        channel = channel_at(self._channel, self._now)
        heard = channel(place_m.reshape(*self._shape, self._num_axes), recipient)
        return heard.reshape(sends.shape)


def _checked_places(position_m: ArrayLike, due: tuple[int, ...]) -> Float[np.ndarray, "*B N D"]:
    """Return the places as floats of their own; raise ValueError unless they are finite [m]."""
    given = as_array("position_m", position_m)
    if given.dtype.kind not in "fiu":  # NumPy would make numbers of dates, truths and texts, too
        raise ValueError(f"position_m must be numbers [m], not {given.dtype}; convert them")
    if given.shape != due or not np.all(np.isfinite(given)):
        raise ValueError(f"position_m must be finite, of shape {due}, not {given.shape}")
    return np.array(given, dtype=np.float64)
