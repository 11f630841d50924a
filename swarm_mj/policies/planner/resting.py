"""The planner of teams at rest: robots agree from their buffers, and may learn their links.

Where nobody moves, robots that have heard of all hold the same positions. The plan that follows
from these and the clock is common, whatever else buffers say. It begins with a team that knows
nothing when the mission begins, so that it does not matter when a robot joins it; until then a
robot takes its turns as in spatial TDMA. Without a payload they keep this plan.

Under a channel that the robots do not know, some of its packets never arrive. With a payload,
robots note what they decoded and what they missed (`link_tables.py`), and packets carry these
counts of all robots, each as old as the rest of what they say of it. At common times every robot
fits a table of links to what it then knows. Packets carry the best table: that of the robot whose
knowledge is youngest. At the next common time each robot flies by a plan made from the best table
that it holds, or goes on if the table says that links are as believed.

Where robots move, no two buffers hold the same positions for long, and schedules made from them
would jam each other. A robot that hears of motion does as the planner of moving teams, or, without
a payload, goes on with spatial TDMA, whose rule tolerates small differences.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

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
from swarm_mj.policies.planner.assent import Assent, turns_every
from swarm_mj.policies.planner.epochs import SnapshotTeam
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.planner.snapshots import snapshot_fields
from swarm_mj.policies.policy import BroadcastPolicy, TeamView, team_views
from swarm_mj.policies.tdma import SpatialTdma, Tdma
from swarm_mj.protocol.packets import PacketField, fits, packet_of
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, SLOTS_PER_WINDOW
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.links import Links
from swarm_mj.radio.mission_radio import Belief, radio_of
from swarm_mj.system.decibels import from_db

WITHOUT_PAYLOAD = "planner --payload none"  # the option makes it a policy of its own
NOT_YET = np.iinfo(np.int64).max  # the slot since when a robot follows plans, if it does not
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

    Until then they take turns, as in spatial TDMA. With a payload they learn their links, too, and
    tell each other who hears of all; while someone does not, turns have a share of the slots
    (`assent.py`). Teams of up to 6 take turns only, where plans gain little and may fail.
    """

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
        look=Look(label="planner, no payload", colour="#a6d854", marker="<"),
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
        """Return those of observed links; arguments as in `Policy.payload_fields`."""
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
            _Team(num_robots, self._belief, self._settings, learns=self._learns) for _ in rngs
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


class _Basis(NamedTuple):
    """The grounds of a plan: robots for which both are equal follow the same one."""

    positions: bytes  # all of them, as the robot holds them
    owner: int | None  # of the table of links; None: links are as believed


class _Flight(NamedTuple):
    """A plan, and what those who follow it believe of links."""

    plan: Plan
    begin: int  # the slot of the mission in which it does
    prior: Links  # before anything was learned
    expected_mw: Float[np.ndarray, "N N"]  # power of i at j, by what was learned [mW]


class _Followed(NamedTuple):
    """A flight in one slot: who followed it, and who should have transmitted by its plan."""

    follows: Bool[np.ndarray, "N"]
    flight: _Flight
    planned: Bool[np.ndarray, "N"]


class _Team:
    """The robots of one mission, side by side; row i of every array is robot i's memory."""

    def __init__(
        self, num_robots: int, belief: Belief, settings: PlannerSettings, *, learns: bool
    ) -> None:
        self._belief = belief
        self._settings = settings
        self._learns = learns
        self._everyone = np.arange(num_robots)
        self._round = SLOTS_PER_WINDOW * max(num_robots, settings.min_round_windows)  # [slots]
        self._first_slot: int | None = None  # in which the first decision was asked for
        self._flights: dict[_Basis, _Flight] = {}
        self._followed: list[_Followed] = []  # in the slot before
        self._transmitted = np.zeros(num_robots, dtype=bool)  # likewise
        self._assent = Assent(num_robots, settings)
        self._turns_every = turns_every(num_robots, settings, learns=learns)
        self._joined = np.full(num_robots, NOT_YET)  # the slot since when i follows plans
        self._evidence = link_tables.Evidence(num_robots)
        self._current: link_tables.Tables | None = None
        self._current_begin = 0  # the slot since when robots fly by these tables
        self._next: link_tables.Tables | None = None

    def transmits(
        self, view: TeamView, in_turn: Bool[np.ndarray, "N"], owns_slot: Bool[np.ndarray, "N"]
    ) -> Bool[np.ndarray, "N"]:
        """Return who transmits in this slot: by its plan or, if it cannot plan, in turn.

        Every slot is asked for once, in order.

        Args:
            view: What each robot knows.
            in_turn: Who transmits by spatial TDMA.
            owns_slot: Whose slot it is by TDMA: one robot.
        """
        now = round(view.now / SLOT_WINDOWS)
        if self._first_slot is None:
            self._first_slot = now
        slot = now - self._first_slot
        knows_all = np.all(view.is_known, axis=1)
        knows_motion = np.any(view.velocity_mps, axis=(1, 2))
        can_plan = knows_all & ~knows_motion
        serves_all = np.zeros_like(can_plan)  # without a payload nobody can tell
        if self._learns:
            known_until = _known_until(view, self._first_slot)
            if slot > 0:
                self._learn(slot, view.heard, known_until)
                self._joined[can_plan] = np.minimum(self._joined[can_plan], slot)
            serves_all = self._assent.tell(slot, can_plan, known_until)
        is_for_turns = now % self._turns_every == 0
        if is_for_turns:
            # Turns without those who join them: they would join by what they believe of links.
            in_turn = np.where(can_plan, owns_slot, in_turn)
            follows_plan = can_plan & serves_all
        else:
            follows_plan = can_plan
        self._followed = []
        transmits = in_turn.copy()
        for basis, robots in self._groups(view, follows_plan).items():
            if basis not in self._flights:
                self._flights[basis] = self._flight(view.position_m[robots[0]], basis.owner)
            flight = self._flights[basis]
            planned = flight.plan.transmits(slot - flight.begin)
            transmits[robots] = planned[robots]
            follows = np.isin(self._everyone, robots)
            # Of slots for turns nobody can say who follows its plan there, so they teach nothing.
            if not is_for_turns:
                self._followed.append(_Followed(follows, flight, planned))
        self._transmitted = transmits
        return transmits

    def _groups(self, view: TeamView, can_plan: Bool[np.ndarray, "N"]) -> dict[_Basis, list[int]]:
        """Return the robots that can plan, by what their plans follow from."""
        groups: dict[_Basis, list[int]] = {}
        for i in np.flatnonzero(can_plan).tolist():
            basis = _Basis(view.position_m[i].tobytes(), self._owner(i))
            groups.setdefault(basis, []).append(i)
        return groups

    def _learn(
        self, slot: int, heard: Int[np.ndarray, "N"], known_until: Int[np.ndarray, "N N"]
    ) -> None:
        """Note what the slot before taught, adopt better tables, and fit or use them in time."""
        self._note(slot, heard, known_until)
        for tables in (self._current, self._next):
            if tables is not None:
                tables.adopt(heard)
        # Fitted early enough to reach everyone before they are flown by.
        if self._are_flown(slot + round(self._settings.spread_rounds * self._round)):
            self._next = link_tables.tables_of(self._evidence, known_until, self._settings)
        if self._are_flown(slot) and self._next is not None:
            self._current = self._next
            self._current_begin = slot
            # Owners have other tables now. The plan by none goes on as it began.
            for basis in list(self._flights):
                if basis.owner is not None:
                    del self._flights[basis]

    def _note(
        self, slot: int, heard: Int[np.ndarray, "N"], known_until: Int[np.ndarray, "N N"]
    ) -> None:
        """Note what packets were decoded or missed in the slot before, by who can tell."""
        # A robot that has been silent for so long may be gone, and is not waited for.
        is_silent = known_until < slot - round(self._settings.gone_rounds * self._round)
        # Whether all others follow plans, as far as j knows: else j cannot say who transmitted.
        is_joined = self._joined[None, :] <= known_until
        knows_all_plan = np.all(is_silent | is_joined, axis=1)
        kinds = np.full(len(self._everyone), link_tables.NOTHING)
        for follows, flight, planned in self._followed:
            listens = follows & ~self._transmitted & knows_all_plan
            noted = link_tables.observe(listens, heard, planned, flight.expected_mw, flight.prior)
            # Each robot follows one flight, and nothing is noted of it in the others.
            kinds = np.maximum(kinds, noted)
        self._evidence.add(kinds)

    def _are_flown(self, slot: int) -> bool:
        """Return whether all robots begin to use the tables made last."""
        first = round(self._settings.first_table_rounds * self._round)
        every = round(self._settings.flown_rounds * self._round)
        return slot >= first and (slot - first) % every == 0

    def _owner(self, i: int) -> int | None:
        """Return the owner of the table that i flies by; None if it changes nothing."""
        if self._current is None:
            return None
        owner = int(self._current.held[i])
        return None if self._current.table(owner).changes_nothing else owner

    def _flight(self, position_m: Float[np.ndarray, "N 2"], owner: int | None) -> _Flight:
        """Return the flight from these positions, by someone's table or as was believed."""
        prior = self._belief.links(position_m)
        if owner is None or self._current is None:
            drawn = None
            if self._belief.position_noise_m:
                drawn = partial(self._drawn, position_m)
            return _Flight(
                plan=Plan(prior, self._settings, links_from=drawn),
                begin=0,  # whenever a robot joins it
                prior=prior,
                expected_mw=prior.received_mw,
            )
        table = self._current.table(owner)
        links = link_tables.corrected(prior, table, self._settings)
        return _Flight(
            plan=Plan(links, self._settings),
            begin=self._current_begin,
            prior=prior,
            expected_mw=prior.received_mw * from_db(table.mean_db),
        )

    def _drawn(self, position_m: Float[np.ndarray, "N 2"], slot: int) -> Links:
        """Return links between places where robots may be, drawn by the slot: the same for all.

        A link that never works would else be planned with for ever, as packets over it have the
        same chance each time.
        """
        noise_m = self._belief.position_noise_m
        share = self._settings.drawn_share
        error_m = noise_m * np.random.default_rng(slot).standard_normal(position_m.shape)
        # What is drawn of the variance, share ** 2, is no longer doubted.
        belief = replace(self._belief, position_noise_m=math.sqrt(1.0 - share**2) * noise_m)
        return belief.links(position_m + share * error_m)


def _known_until(view: TeamView, first_slot: int) -> Int[np.ndarray, "N N"]:
    """Return, as [j, i], the last slot of which j knows what i observed.

    Slots count from the first one. T is when the slot ended in which i sent what j knows of it, and
    in that packet i could only tell of the slots before.
    """
    ended = np.rint(view.timestamp * SLOTS_PER_WINDOW).astype(np.int64)
    sent_in = ended - 1 - first_slot
    return sent_in - 1
