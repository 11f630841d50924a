"""The common-knowledge planner of teams that move; teams at rest have `resting.py`.

Identities, the team's size, its area, orders and the clock are common before the mission. Robots
that also hold the same snapshot of the team therefore agree on a schedule without negotiating: each
computes the whole team's, and flies its part. Any robot may transmit in every slot, and nobody
answers. Time is divided into epochs:

1. In the first two, the discovery, robots transmit in turns (`discovery.py`). There is none where
   robots know before the mission where all start.
2. At the start of every epoch but the first, each robot takes a snapshot of the team from its own
   buffer. Packets carry the best snapshot for the next epoch and the one that the sender flies by.
   A robot that decodes a better one adopts it and passes it on. So a connected team soon holds one.
3. In the next epoch every robot runs the same scheduler (`broadcast_scheduler.py`) on the best
   snapshot it holds, and transmits when the schedule says so. The timestamps at the start are those
   that the last schedule leads to, so nobody needs to report what it decoded.

A robot that missed the best snapshot flies by the best it has, may collide, and still listens. A
snapshot that lacks robots is not flown by: the discovery goes on for some rounds. After that, and
whenever a robot was not heard from for long, some windows are left to the search for it.
"""

import math
from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.mission import Mission
from swarm_mj.policies.about import (
    Information,
    Leading,
    Listed,
    Look,
    PairMemory,
    Payload,
)
from swarm_mj.policies.planner.discovery import Discovery
from swarm_mj.policies.planner.link_tables import link_fields
from swarm_mj.policies.planner.plan import Plan, epoch_plan
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import Snapshots, snapshot_fields, take_snapshots
from swarm_mj.policies.policy import BroadcastPolicy, TeamView, team_views
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.packets import PacketField, check_fits, fits, packet_of
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, SLOTS_PER_WINDOW
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.mission_radio import Belief, radio_of

PLANNER_LOOK = Look(label="planner", colour="#80391e", marker="d")  # moving or at rest
# A plan by each of the snapshots that are still flown by, of which moving teams have many.
PLANS_MEMORY = PairMemory(bytes_per_pair=250.0, from_round=1.0, moving_bytes_per_robot=4.0)


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

        At rest, packets carry what robots learn of links wherever a slot holds that.
        """
        if mission.moves:
            return cls(mission)
        from swarm_mj.policies.planner.resting import RestingPlanner  # which knows this one

        packet = packet_of(mission, link_fields(mission))
        return RestingPlanner(mission, learns=fits(packet, mission))

    def __init__(self, mission: Mission, settings: PlannerSettings | None = None) -> None:
        """Prepare the policy for the mission's team, in free space unless it is informed otherwise.

        Raises ValueError if the mission's slots do not hold snapshots.
        """
        packet = packet_of(mission, snapshot_fields(mission))
        otherwise = ", or planner --payload none"
        check_fits("packets of planner need", packet, mission, otherwise=otherwise)
        self._mission, self._settings = mission, settings or PlannerSettings()
        self._belief = Belief(radio=radio_of(mission))

    def payload_fields(self, mission: Mission) -> tuple[PacketField, ...]:
        """Return those of the snapshots; arguments as in `Policy.payload_fields`."""
        return snapshot_fields(mission)

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draw each mission's orders of turns and forget; arguments as in `Policy.start`."""
        self.teams = [
            _Team(num_robots, self._mission, self._belief, self._settings, rng) for rng in rngs
        ]

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Return who transmits, by its plan or by the discovery."""
        each = zip(self.teams, team_views(views), strict=True)
        return np.stack([team.transmits(view) for team, view in each])


class _Team:
    """The robots of one mission, side by side: row i of every array is robot i's memory."""

    def __init__(
        self,
        num_robots: int,
        mission: Mission,
        belief: Belief,
        settings: PlannerSettings,
        rng: np.random.Generator,
    ) -> None:
        num_reaches = mission.side_m**2 / (math.pi * mission.range_m**2)
        self._discovery = Discovery(
            num_robots, settings, rng, num_reaches=num_reaches, range_m=mission.range_m
        )
        self._belief, self._settings, self._window_s = belief, settings, mission.window_s
        self._everyone = np.arange(num_robots)
        self._first: float | None = None  # when the first decision was asked for [windows]
        self._epoch = -1
        self._begin = self._end = 0  # of the epoch, after the first decision [windows]
        self._num_skipped = 0  # epochs without a discovery begin with the second
        self._current: Snapshots | None = None  # taken for this epoch
        self._upcoming: Snapshots | None = None  # taken for the next one
        self._plans: dict[int, Plan] = {}  # of this epoch, by the owner of the snapshot
        self._planned_by = self._everyone  # the owner of i's plan when it took its upcoming one
        self._before: list[Plan | None] = []  # what i followed in the last epoch

    def transmits(self, view: TeamView) -> Bool[np.ndarray, "N"]:
        """Return who transmits in this slot."""
        self._first = view.now if self._first is None else self._first
        slot = round((view.now - self._first) / SLOT_WINDOWS)
        held = self._held()
        # Packets of the last slot carry snapshots of the epoch that may end now, so they are
        # adopted before the next one begins.
        for snapshots in (self._current, self._upcoming):
            if snapshots is not None:
                snapshots.adopt(view.heard)
        if slot >= SLOTS_PER_WINDOW * self._end:
            self._begin_epoch(view)
        if (current := self._current) is None:
            return self._discovery.transmits(slot, view)
        transmits = np.zeros(len(self._everyone), dtype=bool)
        was_fresh = current.is_fresh[held]
        for owner in np.unique(current.held).tolist():
            # Made even where nobody follows it yet, since the next epoch's plan continues it.
            plan = self._plan(current, owner)
            is_fresh = current.is_fresh[owner]
            purpose = self._discovery.purpose(slot, current.is_known[owner], is_fresh)
            if purpose == "discovery":
                chosen = self._discovery.transmits(slot, view)
            elif purpose == "search":
                chosen = self._discovery.seeks(slot, view, is_fresh=is_fresh, was_fresh=was_fresh)
            else:
                chosen = plan.transmits(slot - SLOTS_PER_WINDOW * self._begin)
            follows = current.held == owner
            transmits[follows] = chosen[follows]
        return transmits

    def _held(self) -> Int[np.ndarray, "N"]:
        """Return whose snapshot each robot flies by, itself if it has none yet."""
        return self._everyone if self._current is None else self._current.held.copy()

    def _begin_epoch(self, view: TeamView) -> None:
        """Fly by the snapshots taken for this epoch, and take those for the next."""
        self._epoch += 1
        self._before = [self._plans.get(owner) for owner in self._planned_by.tolist()]
        self._plans = {}
        # Whether all robots begin with the same complete picture of one moment.
        is_same = np.all(view.is_known) and np.all(view.timestamp == view.timestamp[0, 0])
        is_common = self._epoch == 0 and bool(is_same)
        self._num_skipped += is_common  # there is nothing to discover
        epoch, num_robots = self._epoch + self._num_skipped, len(self._everyone)
        length = epoch_windows(epoch, num_robots, self._settings)
        self._begin, self._end = self._end, self._end + length

        def take(windows_ahead: float) -> Snapshots:
            taken = take_snapshots(
                view, self._settings, window_s=self._window_s, windows_ahead=windows_ahead
            )
            if is_common:
                taken.held[:] = 0  # all are the same
            return taken

        self._current = take(length / 2.0) if is_common else self._upcoming
        if epoch > 0:
            next_length = epoch_windows(epoch + 1, num_robots, self._settings)
            self._upcoming = take(length + next_length / 2.0)
            self._planned_by = self._held()

    def _plan(self, current: Snapshots, owner: int) -> Plan:
        """Return the plan that follows from someone's snapshot."""
        if owner not in self._plans:
            is_known, is_fresh = current.is_known[owner], current.is_fresh[owner]
            before = self._before[owner]
            # At rest nothing else would correct two robots that expect different timestamps.
            is_at_rest = not np.any(current.position_std_m[owner])
            if is_at_rest and self._epoch % self._settings.forget_every == 0:
                before = None
            slots = range(SLOTS_PER_WINDOW * self._begin, SLOTS_PER_WINDOW * self._end)
            purposes = [self._discovery.purpose(slot, is_known, is_fresh) for slot in slots]
            nothing = np.full(current.is_known.shape, NEVER)
            self._plans[owner] = epoch_plan(
                current,
                owner,
                self._belief,
                self._settings,
                timestamp=nothing if before is None else before.outcome(),
                now=self._begin + (self._first or 0.0),
                is_free=np.array(purposes) == "plan",
            )
        return self._plans[owner]


def epoch_windows(epoch: int, num_robots: int, settings: PlannerSettings) -> int:
    """Return how long an epoch is: the first, then two short ones, then all others."""
    if epoch > 2:
        return max(settings.min_epoch_windows, round(settings.epoch_rounds * num_robots))
    rounds = settings.early_epoch_rounds if epoch > 0 else settings.first_epoch_rounds
    return max(settings.min_early_epoch_windows, round(rounds * num_robots))
