"""A team at rest: one plan from positions and the clock, and links learned on the way.

Robots that have heard of all hold the same positions. The plan that follows from them and the clock
is common, whatever else buffers say. Under a channel that the robots do not know, some of its
packets never arrive. So robots note what they decoded and what they missed (`link_evidence.py`),
and packets carry these counts of all robots, each as old as the rest of what they say of it. At
common times every robot fits a table of links to what it then knows (`link_tables.py`). Packets
carry the best table: that of the robot whose knowledge is youngest. At the next common time each
robot flies by a plan made from the best table that it holds. Where the table says that links are as
they were believed, the plan goes on.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.planner.link_evidence import NOTHING, Evidence, observe
from swarm_mj.policies.planner.link_tables import Tables, corrected, expected_mw
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.settings import LearningSettings, PlannerSettings
from swarm_mj.policies.planner.snapshots import better
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.links import Links
from swarm_mj.radio.mission_radio import Belief

NOT_YET = np.iinfo(np.int64).max


class Flight(NamedTuple):
    """A plan, and what those who follow it believe of links."""

    plan: Plan
    begin: int  # the slot of the mission in which it does
    prior: Links  # before anything was learned
    expected_mw: Float[np.ndarray, "N N"]  # power of i at j, by what was learned [mW]


class RestingTeam:
    """The robots of one mission, side by side; row i of every array is robot i's memory."""

    def __init__(
        self, num_robots: int, belief: Belief, settings: PlannerSettings, *, learns: bool
    ) -> None:
        """Prepare the team, whose packets carry what was learned of links, if it learns."""
        self._belief = belief
        self._settings = settings
        self._times = CommonTimes(num_robots, settings.learning) if learns else None
        self._everyone = np.arange(num_robots)
        self._flights: dict[tuple[bytes, int | None], Flight] = {}  # by positions and table
        # In the slot before: groups of robots, their flight, and who transmitted by its plan.
        self._followed: list[tuple[np.ndarray, Flight, np.ndarray]] = []
        self._transmitted = np.zeros(num_robots, dtype=bool)
        self._joined = np.full(num_robots, NOT_YET)  # the slot since when i follows plans
        self._evidence = Evidence(num_robots)
        self._current: Tables | None = None
        self._next: Tables | None = None
        self._holds = self._everyone  # the owner of the best of the current tables that i has
        self._will_hold = self._everyone  # the same of the next ones

    def transmits(
        self,
        slot: int,
        first_slot: int,
        in_turn: Bool[np.ndarray, "N"],
        heard: Int[np.ndarray, "N"],
        buffers: Buffers,
        b: int,
    ) -> Bool[np.ndarray, "N"]:
        """Return who transmits in a slot of mission b: by its plan or, if it cannot plan, in turn.

        Slots count from the first in which a decision was asked for, every slot once, in order.
        `heard` is the sender that each robot decoded in the slot before, itself: none.
        """
        can_plan = np.all(buffers.is_known[b], axis=1) & ~np.any(
            buffers.velocity_mps[b], axis=(1, 2)
        )
        if self._times is not None and slot > 0:
            # [j, i]: the last slot of which j knows what i observed. A packet's news of its sender
            # is from before the slot in which it was sent.
            observed = np.rint(buffers.timestamp[b] * SLOTS_PER_WINDOW).astype(np.int64)
            self._learn(self._times, slot, heard, observed - 2 - first_slot)
            self._joined[can_plan] = np.minimum(self._joined[can_plan], slot)
        members: dict[tuple[bytes, int | None], list[int]] = {}
        for i in np.flatnonzero(can_plan).tolist():
            key = buffers.position_m[b, i].tobytes(), self._owner(i)
            members.setdefault(key, []).append(i)
        self._followed = []
        transmits = in_turn.copy()
        for key, robots in members.items():
            if key not in self._flights:
                self._flights[key] = self._flight(buffers.position_m[b, robots[0]], key[1], slot)
            flight = self._flights[key]
            planned = flight.plan.transmits(slot - flight.begin)
            transmits[robots] = planned[robots]
            self._followed.append((np.isin(self._everyone, robots), flight, planned))
        self._transmitted = transmits
        return transmits

    def _learn(
        self,
        times: "CommonTimes",
        slot: int,
        heard: Int[np.ndarray, "N"],
        known_until: Int[np.ndarray, "N N"],
    ) -> None:
        """Note what the slot before taught, adopt better tables, and fit or use them in time."""
        kinds = np.full(len(self._everyone), NOTHING)
        # A robot that has been silent for a round may be gone, and is not waited for.
        is_silent = known_until < slot - times.round_slots
        knows_all = np.all(is_silent | (self._joined[None, :] <= known_until), axis=1)
        for follows, flight, planned in self._followed:
            is_witness = follows & ~self._transmitted & knows_all
            observe(is_witness, heard, planned, flight.expected_mw, flight.prior, kinds)
        self._evidence.add(kinds)
        if self._current is not None:
            self._holds = better(self._current.rank, self._holds, heard)
        if self._next is not None:
            self._will_hold = better(self._next.rank, self._will_hold, heard)
        if times.are_made(slot):
            self._next = Tables(self._evidence, known_until, self._settings.learning)
            self._will_hold = self._everyone
        if times.are_flown(slot) and self._next is not None:
            self._current, self._holds = self._next, self._will_hold
            self._flights = {key: of for key, of in self._flights.items() if key[1] is None}

    def _owner(self, i: int) -> int | None:
        """Return the owner of the table that i flies by; None if it changes nothing."""
        if self._current is None:
            return None
        owner = int(self._holds[i])
        return None if self._current.table(owner).changes_nothing else owner

    def _flight(self, position_m: Float[np.ndarray, "N 2"], owner: int | None, slot: int) -> Flight:
        prior = self._belief.links(position_m)
        if owner is None or self._current is None or self._times is None:
            return Flight(Plan(prior, self._settings), 0, prior, prior.received_mw)
        table = self._current.table(owner)
        plan = Plan(corrected(prior, table, self._settings.learning), self._settings)
        return Flight(plan, self._times.begin(slot), prior, expected_mw(prior, table))


class CommonTimes:
    """When tables are made, and when all begin to fly by them [slots]."""

    def __init__(self, num_robots: int, settings: LearningSettings) -> None:
        slots = SLOTS_PER_WINDOW * max(num_robots, settings.min_round_windows)
        self.round_slots = slots
        self._first = round(settings.first_rounds * slots)
        self._length = round(settings.flown_rounds * slots)
        self._spread = round(settings.spread_rounds * slots)

    def are_made(self, slot: int) -> bool:
        """Return whether all robots make a table before this slot."""
        return self.are_flown(slot + self._spread)

    def are_flown(self, slot: int) -> bool:
        """Return whether all robots begin to use the tables made last."""
        return slot >= self._first and slot == self.begin(slot)

    def begin(self, slot: int) -> int:
        """Return when everyone began to fly by the tables that are current in this slot."""
        return slot - (slot - self._first) % self._length
