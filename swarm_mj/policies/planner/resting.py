"""The planner of teams at rest: robots agree from their buffers, and may learn their links.

Where nobody moves, robots that have heard of all hold the same positions. The plan that follows
from these and the clock is common, whatever else buffers say. It begins with a team that knows
nothing when the mission begins, so that it does not matter when a robot joins it; until then a
robot takes its turns as in spatial TDMA. Without a payload they keep this plan.

Under a channel that the robots do not know, some of its packets never arrive. With a payload,
robots note what they decoded and what they missed (`link_evidence.py`), and packets carry these
counts of all robots, each as old as the rest of what they say of it. At common times every robot
fits a table of links to what it then knows. Packets carry the best table: that of the robot whose
knowledge is youngest. At the next common time each robot flies by a plan made from the best table
that it holds, or goes on if the table says that links are as believed.

Where robots move, no two buffers hold the same positions for long, and schedules made from them
would jam each other. A robot that hears of motion does as the planner of moving teams, or, without
a payload, goes on with spatial TDMA, whose rule tolerates small differences.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool

from swarm_mj.mission import Mission
from swarm_mj.policies.about import (
    About,
    Information,
    Listed,
    Look,
    PairMemory,
    Payload,
    VariantOf,
)
from swarm_mj.policies.planner import link_tables
from swarm_mj.policies.planner.epochs import SnapshotTeam
from swarm_mj.policies.planner.resting_team import RestingTeam
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import snapshot_fields
from swarm_mj.policies.policy import BroadcastPolicy, team_views
from swarm_mj.policies.tdma import SpatialTdma, Tdma
from swarm_mj.protocol.packets import PacketField, fits, packet_of
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import Belief, radio_of

WITHOUT_PAYLOAD = "planner --payload none"  # the option makes it a policy of its own
PLANNER_LOOK = Look(label="planner", colour="#80391e", marker="d")  # moving or at rest
# A plan by each of the snapshots that are still flown by, of which moving teams have many.
PLANS_MEMORY = PairMemory(bytes_per_pair=250.0, from_round=1.0, moving_bytes_per_robot=4.0)
# Of what either kind of packets leads to.
BEYOND = (
    Information.COMMON_ORDER,
    Information.CLOCK,
    Information.TEAM_SIZE,
    Information.OBSERVED_POSITIONS,
    Information.RADIO_CONSTANTS,
    # Of spatial TDMA in large teams, and where positions have errors.
    Information.COMMON_RANDOM_NUMBERS,
    Information.DECODED_PACKETS,
    Information.AREA,
    Information.PRIOR_KNOWLEDGE,
    Information.POSITION_ERRORS,
)
# Of `planner` at rest, whose robots know and send other things than those that move.
WITH_LINKS = About(
    uses=(
        "its buffer, the senders that it decodes, the clock, common orders, the size of the team, "
        "the area, its prior knowledge of the radio and of errors of positions; and all robots' "
        "observations of their links, in packets"
    ),
    beyond=BEYOND,
    payload=Payload(
        name="links",
        meaning=(
            "how often robots decoded and missed each other, and what that says of the channel"
        ),
    ),
    look=PLANNER_LOOK,
    memory=PLANS_MEMORY,
)


class RestingPlanner(BroadcastPolicy):
    """Robots make one plan when they know where all rest.

    Teams of up to 6 take turns only, as in TDMA: plans gain them little, and may fail. Others take
    turns until they know, as in spatial TDMA. With a payload they learn their links, too, and tell
    each other who hears of all; while someone does not, turns have a share of the slots.
    """

    # How they tell each other stands in `assent.py`.

    about = Listed(
        name=WITHOUT_PAYLOAD,
        origin=VariantOf(policy="planner"),
        rank=120,
        uses=(
            "as planner, without a payload: stationary robots agree from the positions in their "
            "buffers, the clock and their prior knowledge alone; moving teams fly spatial-tdma"
        ),
        beyond=BEYOND,
        payload=None,
        look=Look(label="planner --payload none", colour="#a6d854", marker="<"),
        memory=PLANS_MEMORY,
    )

    @classmethod
    def for_mission(cls, mission: Mission) -> "RestingPlanner":
        """Return the planner of a team at rest, whose packets carry nothing beyond T, M and P."""
        return cls(mission)

    def __init__(
        self, mission: Mission, settings: PlannerSettings | None = None, *, learns: bool = False
    ) -> None:
        """Prepare the policy, whose packets carry what robots observed of links, if it learns.

        If it learns, robots that hear of motion follow the planner of moving teams, unless only
        links fit into packets, as in some large teams.
        """
        self._mission = mission
        self._belief = Belief(radio=radio_of(mission))
        self._settings = settings or PlannerSettings()
        # Tiny teams take turns, whatever they know.
        self._plans = mission.num_robots >= self._settings.min_planned_robots
        self._learns = learns and self._plans
        self._turns = SpatialTdma(mission) if self._plans else Tdma()
        has_room = fits(packet_of(mission, snapshot_fields(mission)), mission)
        self._heeds_motion = self._learns and has_room
        if self._learns:
            self.about = WITH_LINKS
            self.payload = WITH_LINKS.payload_name

    def payload_fields(self, mission: Mission) -> tuple[PacketField, ...]:
        """Return the fields of observed links; arguments as in `Policy.payload_fields`."""
        return link_tables.link_fields(mission) if self._learns else ()

    def inform(self, belief: Belief) -> None:
        """Plan by this belief from now on, also in the turns."""
        super().inform(belief)
        self._turns.inform(belief)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw each mission's order of turns and forget; arguments as in `Policy.start`."""
        # The turns draw first: without a payload, missions begin as those of spatial TDMA do.
        self._turns.start(num_robots, rngs)
        self._moving_teams: list[SnapshotTeam] = []
        if self._heeds_motion:
            for rng in rngs:
                team = SnapshotTeam(num_robots, self._mission, self._belief, self._settings, rng)
                self._moving_teams.append(team)
        self._has_moved = np.zeros(len(rngs), dtype=bool)
        self._teams = [
            RestingTeam(num_robots, self._belief, self._settings, learns=self._learns) for _ in rngs
        ]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who transmits, by the schedule it knows or in its turn."""
        transmits = self._turns.transmits(views)
        if not self._plans:
            return transmits
        owns_slot = self._turns.owns_slot(views)
        each = team_views(views)
        for b, team in enumerate(self._teams):
            transmits[b] = team.transmits(each[b], transmits[b], owns_slot[b])
        if self._heeds_motion:
            knows_motion = np.any(views.buffers.velocity_mps, axis=(2, 3))
            # Once a team has moved its epochs go on, also while all of its robots rest again.
            self._has_moved |= np.any(knows_motion, axis=1)
            for b in np.flatnonzero(self._has_moved).tolist():
                by_snapshot = self._moving_teams[b].transmits(each[b])
                transmits[b, knows_motion[b]] = by_snapshot[knows_motion[b]]
        return transmits
