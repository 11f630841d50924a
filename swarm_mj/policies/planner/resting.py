"""The planner of teams at rest: robots agree from their buffers, and may learn their links.

Where nobody moves, robots that have heard of all hold the same positions. A schedule that follows
from these positions and the clock is the same on all of them, whatever else their buffers say
(`resting_team.py`). So every robot takes its turns as in spatial TDMA until it has heard of
everyone, and from then on transmits when the schedule says so. The schedule begins with a team that
knows nothing when the mission begins, so that it does not matter when a robot joins it. Without a
payload they keep this schedule. With one they learn which links are not as they believed, and plan
anew.

Where robots move, no two buffers hold the same positions for long, and schedules made from them
would jam each other. A robot that hears of motion does as the planner of moving teams, or, without
a payload, goes on with spatial TDMA, whose rule tolerates small differences.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.mission import Mission
from swarm_mj.policies.planner.payloads import carries, link_fields, snapshot_fields
from swarm_mj.policies.planner.policy import Planner
from swarm_mj.policies.planner.resting_team import RestingTeam
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.tdma import SpatialTdma, slot_of
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.packets import PacketField
from swarm_mj.radio.mission_radio import Belief, radio_of


class RestingPlanner(BroadcastPolicy):
    """Every robot that knows where everyone rests plans for the whole team; others take turns.

    Uses the robot's own buffer, its identity, the team's size, the clock, the radio's numbers, what
    the mission grants of the channel and a common order of turns; and what packets say of links, if
    it learns.
    """

    def __init__(
        self, mission: Mission, settings: PlannerSettings, turns: SpatialTdma, *, learns: bool
    ) -> None:
        """Prepare the policy, whose packets carry what robots observed of links, if it learns.

        Robots that cannot plan follow the turns. If it learns, those that hear of motion follow the
        planner of moving teams, unless only links fit into packets, as in some large teams.
        """
        self._belief = Belief(radio=radio_of(mission))
        self._settings = settings
        self._turns = turns
        self._learns = learns
        is_ready = learns and carries(snapshot_fields(mission), mission)
        self._moving = Planner(mission) if is_ready else None
        self.uses = (
            "its buffer, the clock, a common order, its prior knowledge of the radio; and all "
            "robots' observations of their links, in packets"
            if learns
            else "as planner, without a payload: stationary robots agree from their buffers alone; "
            "moving teams fly spatial-tdma"
        )

    @property
    def payload(self) -> str:
        """Packets carry what robots observed of links, or nothing beyond T, M and P."""
        return "links" if self._learns else "none"

    def payload_fields(self, mission: Mission) -> tuple[PacketField, ...]:
        """Return those of observed links; arguments as in `Policy.payload_fields`."""
        return link_fields(mission) if self._learns else ()

    def inform(self, belief: Belief) -> None:
        """Plan by this belief from now on, also in the turns."""
        self._belief = belief
        self._turns.inform(belief)
        if self._moving is not None:
            self._moving.inform(belief)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw each mission's order of turns and forget; arguments as in `Policy.start`."""
        # The turns draw first: without a payload, missions begin as those of spatial TDMA do.
        self._turns.start(num_robots, rngs)
        if self._moving is not None:
            self._moving.start(num_robots, rngs)
        self._has_moved = np.zeros(len(rngs), dtype=bool)
        self._teams = [
            RestingTeam(num_robots, self._belief, self._settings, learns=self._learns) for _ in rngs
        ]
        self._first = None  # each mission's slot in which the first decision was asked for

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who transmits, by the schedule it knows or in its turn."""
        slot = slot_of(views.now)
        first = self._first = slot if self._first is None else self._first
        heard = views.phases[-1].heard if views.phases else views.silence
        transmits = self._turns.transmits(views)
        for b, team in enumerate(self._teams):
            since, begin = int(slot[b] - first[b]), int(first[b])
            transmits[b] = team.transmits(since, begin, transmits[b], heard[b], views.buffers, b)
        if self._moving is not None:
            knows_motion = np.any(views.buffers.velocity_mps, axis=(2, 3))
            self._has_moved |= np.any(knows_motion, axis=1)
            for b in np.flatnonzero(self._has_moved).tolist():
                by_snapshot = self._moving.transmits_in(views, b)
                transmits[b, knows_motion[b]] = by_snapshot[knows_motion[b]]
        return transmits
