"""The planner whose packets carry T, M and P alone: robots agree from their buffers, or take turns.

Where nobody moves, whoever has heard of everyone holds the same positions as every other robot that
has. A schedule that follows from these positions and the clock is the same on all of them, whatever
else their buffers say. So every robot takes its turns as in spatial TDMA until it has heard of
everyone, and from then on transmits when the schedule says so. The schedule begins with a team that
knows nothing when the mission begins, so that it does not matter when a robot joins it.

Where robots move, no two buffers hold the same positions for long, and schedules made from them
would jam each other. Such a team goes on with spatial TDMA, whose rule bears small differences.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.planner.broadcast_scheduler import schedule
from swarm_mj.policies.planner.plan import foresight_of
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.weights import heuristic_weights
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.spatial_tdma import SpatialTdma
from swarm_mj.policies.tdma import slot_of
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.radio.link_models import Belief


class PlannerWithoutPayload(BroadcastPolicy):
    """Every robot that knows where everyone rests plans for the whole team; others take turns.

    Uses the robot's own buffer, its identity, the team's size, the clock, the radio's numbers, what
    the mission grants of the channel and a common order of turns.
    """

    uses = (
        "as planner, without snapshots: robots at rest agree from their buffers alone, "
        "others take the turns of spatial-tdma"
    )

    def __init__(
        self, radio: FreeSpaceRadio, settings: PlannerSettings, turns: SpatialTdma
    ) -> None:
        """Prepares the policy.

        Args:
            radio: What robots believe in unless the policy is informed otherwise.
            settings: Of the planner, for its schedules and weights.
            turns: What robots follow that cannot plan.
        """
        self._belief = Belief(radio=radio)
        self._settings = settings
        self._turns = turns

    def inform(self, belief: Belief) -> None:
        """Plans by this belief from now on, and so do the turns."""
        self._belief = belief
        self._turns.inform(belief)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draws each mission's order of turns and forgets; arguments as in `Policy.start`."""
        self._turns.start(num_robots, rngs)
        self._plans: list[dict[bytes, _StandingPlan]] = [{} for _ in rngs]
        self._first = None  # each mission's slot in which the first decision was asked for

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Whoever does by the schedule it knows, or in its turn."""
        buffers, slot = views.buffers, slot_of(views.now)
        if self._first is None:
            self._first = slot
        transmits = self._turns.transmits(views)
        can_plan = np.all(buffers.is_known, axis=2) & ~np.any(buffers.velocity_mps, axis=(2, 3))
        for b, i in np.argwhere(can_plan).tolist():
            plan = self._plan(b, buffers.position_m[b, i])
            transmits[b, i] = plan.transmits(int(slot[b] - self._first[b]))[i]
        return transmits

    def _plan(self, b: int, position_m: Float[np.ndarray, "N 2"]) -> "_StandingPlan":
        """The plan that follows from these positions; robots that hold the same share it."""
        key = position_m.tobytes()
        if key not in self._plans[b]:
            self._plans[b][key] = _StandingPlan(self._belief, self._settings, position_m)
        return self._plans[b][key]


class _StandingPlan:
    """Who transmits in each slot of a mission in which everyone stands still.

    It is worked out as far as somebody asks for.
    """

    def __init__(
        self,
        belief: Belief,
        settings: PlannerSettings,
        position_m: Float[np.ndarray, "N 2"],
    ) -> None:
        num_robots = len(position_m)
        self._links = belief.links(position_m)
        self._weights = heuristic_weights(self._links, settings.weights)
        self._foresight = foresight_of(num_robots, is_certain=True, settings=settings.schedule)
        self._chunk_slots = settings.schedule.chunk_slots
        self._timestamp = np.full((num_robots, num_robots), NEVER, dtype=np.float32)
        self._transmits = []  # by slots

    def transmits(self, slot: int) -> Bool[np.ndarray, "N"]:
        """Who transmits in a slot, counted from the beginning of the mission."""
        while len(self._transmits) <= slot:
            transmits = np.empty((self._chunk_slots, len(self._timestamp)), dtype=bool)
            schedule(
                self._timestamp,
                float(len(self._transmits)),
                self._links,
                self._weights,
                self._foresight,
                np.ones(self._chunk_slots + self._foresight.slots, dtype=bool),
                transmits,
            )
            self._transmits.extend(transmits)
        return self._transmits[slot]
