"""The common-knowledge planner: robots agree on a plan, rather than on each transmission.

Identities, the team's size, its area, orders and the clock are common before the mission. Robots
that also hold the same snapshot of the team therefore agree on a schedule without negotiating: each
computes the whole team's, and flies its part. Any robot may transmit in every slot, and nobody
answers. How teams that move come to the same snapshot stands in `epochs.py`. Teams at rest need
none, for their buffers soon agree: they have `resting.py`.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.mission import Mission
from swarm_mj.policies.about import Information, Leading, Listed, Payload
from swarm_mj.policies.planner.epochs import SnapshotTeam
from swarm_mj.policies.planner.link_tables import link_fields
from swarm_mj.policies.planner.resting import PLANNER_LOOK, PLANS_MEMORY, RestingPlanner
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import snapshot_fields
from swarm_mj.policies.policy import BroadcastPolicy, team_views
from swarm_mj.protocol.packets import PacketField, check_fits_slot, fits, packet_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import Belief, radio_of


class Planner(BroadcastPolicy):
    """All robots make one plan, from shared snapshots."""

    about = Listed(
        name="planner",
        origin=Leading(over=("spatial-tdma", "sotdma", "gnn")),
        rank=110,
        uses=(
            "its buffer, the senders that it decodes, the clock, common orders, the size of the "
            "team, the area, its prior knowledge of the radio and of errors of positions; and "
            "snapshots of the team in packets"
        ),
        beyond=(
            Information.COMMON_ORDER,
            Information.CLOCK,
            Information.TEAM_SIZE,
            Information.OBSERVED_POSITIONS,
            Information.RADIO_CONSTANTS,
            Information.DECODED_PACKETS,
            Information.AREA,
            Information.PRIOR_KNOWLEDGE,
            Information.POSITION_ERRORS,
        ),
        payload=Payload(
            name="snapshots",
            meaning="two pictures of the whole team, on which robots agree to plan alike",
        ),
        look=PLANNER_LOOK,
        memory=PLANS_MEMORY,
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> BroadcastPolicy:
        """Return the planner of a team that moves, or of one at rest.

        At rest, packets carry what robots learn of links wherever a slot holds that. Tiny teams
        take turns, with the paper's packets.
        """
        if mission.num_robots < PlannerSettings().min_planned_robots:
            return RestingPlanner(mission)
        if mission.moves:
            return cls(mission)
        packet = packet_of(mission, link_fields(mission))
        return RestingPlanner(mission, learns=fits(packet, mission))

    def __init__(self, mission: Mission, settings: PlannerSettings | None = None) -> None:
        """Prepare the policy for the mission's team, in free space unless it is informed otherwise.

        Raises ValueError if the mission's slots do not hold snapshots.
        """
        packet = packet_of(mission, snapshot_fields(mission))
        otherwise = ", or planner --payload none"
        check_fits_slot("packets of planner need", packet, mission, otherwise=otherwise)
        self._mission = mission
        self._settings = settings or PlannerSettings()
        self._belief = Belief(radio=radio_of(mission))

    def payload_fields(self, mission: Mission) -> tuple[PacketField, ...]:
        """Return the fields of the snapshots; arguments as in `Policy.payload_fields`."""
        return snapshot_fields(mission)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw each mission's orders of turns and forget; arguments as in `Policy.start`."""
        self.teams = [
            SnapshotTeam(num_robots, self._mission, self._belief, self._settings, rng)
            for rng in rngs
        ]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who transmits, by its plan or by the discovery."""
        transmits = np.zeros(views.silence.shape, dtype=bool)
        for b, view in enumerate(team_views(views)):
            transmits[b] = self.teams[b].transmits(view)
        return transmits
