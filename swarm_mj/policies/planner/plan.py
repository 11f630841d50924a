"""Plans: who should transmit in an epoch, by one snapshot of the team."""

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.planner.broadcast_scheduler import Foresight, schedule
from swarm_mj.policies.planner.settings import PlannerSettings, ScheduleSettings
from swarm_mj.policies.planner.snapshots import Snapshots
from swarm_mj.policies.planner.weights import heuristic_weights
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.link_models import Belief


def foresight_of(num_robots: int, *, is_certain: bool, settings: ScheduleSettings) -> Foresight:
    """How far a team of this size looks ahead, on positions that are certain or only believed."""
    if num_robots > settings.max_foresight_robots:
        return Foresight(1, 1)
    if is_certain:
        return Foresight(settings.rest_branches, settings.rest_slots)
    return Foresight(settings.moving_branches, settings.moving_slots)


class Plan:
    """Who transmits in each slot of an epoch; it depends on one snapshot and on nothing else.

    It is computed as far as somebody asks for.
    """

    def __init__(
        self,
        belief: Belief,
        settings: PlannerSettings,
        snapshots: Snapshots,
        owner: int,
        timestamp: Float[np.ndarray, "N N"],
        now: float,
        is_free: Bool[np.ndarray, "P"],
    ) -> None:
        """Prepare the plan.

        Args:
            belief: What the robots take the channel for.
            settings: Of the planner, for its schedules and weights.
            snapshots: Those taken for this epoch.
            owner: The robot whose snapshot counts.
            timestamp: T as the epoch begins, as far as is known with that snapshot [windows].
            now: t as the epoch begins [windows].
            is_free: Which slots of the epoch the plan may fill.
        """
        is_known, is_fresh = snapshots.is_known[owner], snapshots.is_fresh[owner]
        position_std_m = snapshots.position_std_m[owner]
        num_robots = len(timestamp)
        round_windows = max(num_robots, settings.schedule.min_round_windows)
        age = now - snapshots.timestamp[owner]
        is_gone = age > settings.schedule.gone_rounds * round_windows
        self._links = belief.links(
            snapshots.position_m[owner], position_std_m, is_known & ~(is_gone & ~is_fresh)
        )
        self._weights = heuristic_weights(self._links, settings.weights)
        self._foresight = foresight_of(
            num_robots, is_certain=not np.any(position_std_m), settings=settings.schedule
        )
        self._chunk_slots = settings.schedule.chunk_slots
        self._now = SLOTS_PER_WINDOW * now
        expected = _corrected(timestamp, snapshots, owner)
        self._timestamp = (SLOTS_PER_WINDOW * expected).astype(np.float32)  # [slots]
        ahead = np.ones(self._foresight.slots, dtype=bool)
        self._is_free = np.concatenate([is_free, ahead])
        self._transmits = np.zeros((len(is_free), num_robots), dtype=bool)
        self._num_planned = 0
        self.is_complete = bool(np.all(is_known))  # whether the snapshot had all robots
        self.is_fresh = is_fresh  # who was fresh in it

    def transmits(self, slot: int) -> Bool[np.ndarray, "N"]:
        """Who transmits in a slot of the epoch.

        Raises:
            IndexError: The epoch is over.
        """
        if slot >= len(self._transmits):
            raise IndexError(f"the plan has {len(self._transmits)} slots, not {slot}")
        while self._num_planned <= slot:
            self._extend()
        return self._transmits[slot]

    def outcome(self) -> Float[np.ndarray, "N N"]:
        """T after the epoch, as expected [windows]."""
        while self._num_planned < len(self._transmits):
            self._extend()
        return self._timestamp.astype(np.float64) / SLOTS_PER_WINDOW

    def _extend(self) -> None:
        begin = self._num_planned
        end = min(begin + self._chunk_slots, len(self._transmits))
        schedule(
            self._timestamp,
            self._now + begin,
            self._links,
            self._weights,
            self._foresight,
            self._is_free[begin:],
            self._transmits[begin:end],
        )
        self._num_planned = end


def _corrected(
    timestamp: Float[np.ndarray, "N N"], snapshots: Snapshots, owner: int
) -> Float[np.ndarray, "N N"]:
    """T without what the last plan expected of robots that were not heard of since.

    Nobody can know anything newer of such a robot than the snapshot does, nor can it know anything
    newer itself.
    """
    missing = ~snapshots.is_fresh[owner]
    heard = np.where(missing, snapshots.timestamp[owner], np.inf)
    return np.minimum(timestamp, np.minimum(heard[:, None], heard[None, :]))
