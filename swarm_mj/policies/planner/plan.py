"""Plans: who should transmit in each slot, computed as far as they are asked for."""

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.planner.broadcast_scheduler import Lookahead, schedule
from swarm_mj.policies.planner.settings import PlannerSettings, ScheduleSettings
from swarm_mj.policies.planner.snapshots import Snapshots
from swarm_mj.policies.planner.weights import heuristic_weights
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.links import Links
from swarm_mj.radio.mission_radio import Belief


def lookahead_of(num_robots: int, *, is_certain: bool, settings: ScheduleSettings) -> Lookahead:
    """Return how far a team of this size looks ahead, on certain or on merely believed links."""
    if num_robots > settings.max_lookahead_robots:
        return Lookahead(1, 1)
    if is_certain:
        return Lookahead(settings.rest_width, settings.rest_depth)
    return Lookahead(settings.moving_width, settings.moving_depth)


class Plan:
    """The transmitters of each slot, numbered from 0, between robots that stand still.

    Without more arguments, the plan is endless and begins with a team that knows nothing.
    """

    def __init__(
        self,
        links: Links,
        settings: PlannerSettings,
        *,
        is_certain: bool | None = None,
        timestamp: Float[np.ndarray, "N N"] | None = None,
        now: float = 0.0,
        is_free: Bool[np.ndarray, "P"] | None = None,
    ) -> None:
        """Prepare a plan that begins with T and t as given [windows].

        It ends with the slots that may be free or not, and looks as far ahead as on certain links
        if that is said, or else if its links are certain.
        """
        num_robots = len(links.received_mw)
        self._links = links
        self._settings = settings.schedule
        self._weights = heuristic_weights(links, settings.weights)
        is_certain = not links.is_doubtful if is_certain is None else is_certain
        self._lookahead = lookahead_of(
            num_robots, is_certain=is_certain, settings=settings.schedule
        )
        if timestamp is None:
            timestamp = np.full((num_robots, num_robots), NEVER)
        self._timestamp = (SLOTS_PER_WINDOW * timestamp).astype(np.float32)  # [slots]
        self._now = SLOTS_PER_WINDOW * now
        self._is_endless = is_free is None
        self._is_free = np.ones(0, dtype=bool) if is_free is None else is_free
        self._transmits = []  # by slots

    def transmits(self, slot: int) -> Bool[np.ndarray, "N"]:
        """Return who transmits in a slot.

        Raises:
            IndexError: The plan ends before.
        """
        while slot >= len(self._transmits):
            self._extend()
        return self._transmits[slot]

    def outcome(self) -> Float[np.ndarray, "N N"]:
        """Return T after the last slot of a plan that ends, as expected [windows]."""
        while len(self._transmits) < len(self._is_free):
            self._extend()
        return self._timestamp.astype(np.float64) / SLOTS_PER_WINDOW

    def _extend(self) -> None:
        """Compute the next slots: as many whatever is asked for, which plans must not depend on."""
        begin, num_slots = len(self._transmits), self._settings.chunk_slots
        if not self._is_endless:
            num_slots = min(num_slots, len(self._is_free) - begin)
            if num_slots == 0:
                raise IndexError(f"the plan has {begin} slots")
        # Looking ahead reaches beyond these slots, and beyond the plan's end, where all are free.
        is_free = np.ones(num_slots + self._lookahead.depth, dtype=bool)
        known = self._is_free[begin : begin + len(is_free)]
        is_free[: len(known)] = known
        transmits = np.empty((num_slots, len(self._timestamp)), dtype=bool)
        schedule(
            self._timestamp,
            self._now + begin,
            self._links,
            self._weights,
            self._lookahead,
            is_free,
            transmits,
        )
        self._transmits.extend(transmits)


def epoch_plan(
    belief: Belief,
    settings: PlannerSettings,
    snapshots: Snapshots,
    owner: int,
    timestamp: Float[np.ndarray, "N N"],
    now: float,
    is_free: Bool[np.ndarray, "P"],
) -> Plan:
    """Return the plan of an epoch, which depends on one robot's snapshot and on nothing else.

    T and t are those as the epoch begins, as far as they are known with that snapshot [windows].
    """
    is_fresh, observed = snapshots.is_fresh[owner], snapshots.timestamp[owner]
    round_windows = max(len(observed), settings.schedule.min_round_windows)
    is_gone = now - observed > settings.schedule.gone_rounds * round_windows
    is_there = snapshots.is_known[owner] & (is_fresh | ~is_gone)
    std_m = snapshots.position_std_m[owner]
    # The last plan may have expected news of a robot that went missing. In truth nobody knows
    # anything newer of it than the snapshot does, nor does it know anything newer itself.
    newest = np.where(is_fresh, np.inf, observed)
    return Plan(
        belief.links(snapshots.position_m[owner], std_m, is_there),
        settings,
        is_certain=not np.any(std_m),
        timestamp=np.minimum(timestamp, np.minimum(newest[:, None], newest[None, :])),
        now=now,
        is_free=is_free,
    )
