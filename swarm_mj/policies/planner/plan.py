"""Plans: what an epoch should be, by one picture of the team."""

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.greedy_oracle.link_scheduler import HALVES
from swarm_mj.policies.planner.broadcast_scheduler import Foresight, schedule
from swarm_mj.policies.planner.snapshots import Pictures
from swarm_mj.policies.planner.weights import Scorer
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.links import links_between

# Looking ahead takes time that grows with N³, so larger teams do not. Where nobody moves, plans
# come true as they are, and looking further ahead is worth it.
FARTHER = Foresight(branches=6, half_windows=6)
FAR = Foresight(branches=4, half_windows=4)
NO_FORESIGHT = Foresight(branches=1, half_windows=1)
LARGEST_FAR = 50  # robots
GONE = 3.0  # rounds of N windows without news, after which a plan does without a robot
SHORTEST_ROUND = 20  # windows
CHUNK = 10  # half windows that are planned at a time


def foresight_of(num_robots: int, *, is_certain: bool) -> Foresight:
    """How far a team of this size looks ahead, on positions that are certain or only believed."""
    if num_robots > LARGEST_FAR:
        return NO_FORESIGHT
    return FARTHER if is_certain else FAR


class Plan:
    """Who speaks in each half window of an epoch; it depends on one picture and on nothing else.

    It is worked out as far as somebody asks for.
    """

    def __init__(
        self,
        radio: FreeSpaceRadio,
        scorer: Scorer,
        pictures: Pictures,
        whose: int,
        timestamp: Float[np.ndarray, "N N"],
        now: float,
        is_free: Bool[np.ndarray, "P"],
    ) -> None:
        """Prepares the plan.

        Args:
            radio: The mission's channel.
            scorer: What news is worth.
            pictures: The pictures made for this epoch.
            whose: The robot whose picture counts.
            timestamp: T as the epoch begins, as far as is known with that picture [windows].
            now: t as the epoch begins [windows].
            is_free: Which half windows of the epoch the plan may fill.
        """
        is_known, is_fresh = pictures.is_known[whose], pictures.is_fresh[whose]
        is_gone = now - pictures.timestamp[whose] > GONE * max(len(timestamp), SHORTEST_ROUND)
        self._links = links_between(
            radio,
            pictures.position_m[whose],
            pictures.spread_m[whose],
            is_known & ~(is_gone & ~is_fresh),
        )
        self._worth = scorer(self._links)
        is_certain = not np.any(pictures.spread_m[whose])
        self._foresight = foresight_of(len(timestamp), is_certain=is_certain)
        self._now = HALVES * now
        self._timestamp = (HALVES * _corrected(timestamp, pictures, whose)).astype(np.float32)
        ahead = np.ones(self._foresight.half_windows, dtype=bool)
        self._is_free = np.concatenate([is_free, ahead])
        self._speaks = np.zeros((len(is_free), len(timestamp)), dtype=bool)
        self._num_planned = 0
        self.is_complete = bool(np.all(is_known))  # whether the picture had all robots
        self.is_fresh = is_fresh  # who was fresh in it

    def speaks(self, half_window: int) -> Bool[np.ndarray, "N"]:
        """Who speaks in a half window of the epoch.

        Raises:
            IndexError: The epoch is over.
        """
        if half_window >= len(self._speaks):
            raise IndexError(f"the plan has {len(self._speaks)} half windows, not {half_window}")
        while self._num_planned <= half_window:
            self._extend()
        return self._speaks[half_window]

    def outcome(self) -> Float[np.ndarray, "N N"]:
        """T after the epoch, as expected [windows]."""
        while self._num_planned < len(self._speaks):
            self._extend()
        return self._timestamp.astype(np.float64) / HALVES

    def _extend(self) -> None:
        begin = self._num_planned
        end = min(begin + CHUNK, len(self._speaks))
        schedule(
            self._timestamp,
            self._now + begin,
            self._links,
            self._worth,
            self._foresight,
            self._is_free[begin:],
            self._speaks[begin:end],
        )
        self._num_planned = end


def _corrected(
    timestamp: Float[np.ndarray, "N N"], pictures: Pictures, whose: int
) -> Float[np.ndarray, "N N"]:
    """T without what the last plan expected from robots that were not heard of since.

    Nobody can know of such a robot what is newer than that, nor can it know anything newer.
    """
    lost = ~pictures.is_fresh[whose]
    heard = np.where(lost, pictures.timestamp[whose], np.inf)
    return np.minimum(timestamp, np.minimum(heard[:, None], heard[None, :]))
