"""Schedules of teams that stand still: they follow from positions and the clock alone."""

import numpy as np
from jaxtyping import Bool

from swarm_mj.policies.planner.broadcast_scheduler import schedule
from swarm_mj.policies.planner.plan import foresight_of
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.weights import heuristic_weights
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.radio.links import Links


class StandingPlan:
    """Who transmits in each slot from some slot on, in a team that then knows nothing.

    It is worked out as far as somebody asks for.
    """

    def __init__(self, links: Links, settings: PlannerSettings, first_slot: int = 0) -> None:
        """Prepare the plan.

        Args:
            links: Between the robots, where they stand.
            settings: Of the planner, for its schedules and weights.
            first_slot: Where the plan begins.
        """
        num_robots = len(links.received_mw)
        self.links = links
        self.first_slot = first_slot
        self._weights = heuristic_weights(links, settings.weights)
        self._foresight = foresight_of(
            num_robots, is_certain=not links.is_doubtful, settings=settings.schedule
        )
        self._chunk_slots = settings.schedule.chunk_slots
        self._timestamp = np.full((num_robots, num_robots), NEVER, dtype=np.float32)
        self._transmits = []  # by slots
        self.last = np.zeros(num_robots, dtype=bool)  # who transmits in the slot last asked for

    def transmits(self, slot: int) -> Bool[np.ndarray, "N"]:
        """Who transmits in a slot, which must not lie before the first."""
        self.last = self.ahead(slot, 1)[0]
        return self.last

    def ahead(self, slot: int, num_slots: int) -> Bool[np.ndarray, "S N"]:
        """Who transmits in each of so many slots from this one on."""
        since = slot - self.first_slot
        while len(self._transmits) < since + num_slots:
            transmits = np.empty((self._chunk_slots, len(self._timestamp)), dtype=bool)
            schedule(
                self._timestamp,
                float(len(self._transmits)),
                self.links,
                self._weights,
                self._foresight,
                np.ones(self._chunk_slots + self._foresight.slots, dtype=bool),
                transmits,
            )
            self._transmits.extend(transmits)
        return np.stack(self._transmits[since : since + num_slots])
