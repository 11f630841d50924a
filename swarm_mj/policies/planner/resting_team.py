"""A team at rest: one plan from positions and the clock, and links learned on the way.

Whoever has heard of everyone holds the same positions as every other robot that has. The plan that
follows from them and the clock is common, whatever else buffers say (`standing_plan.py`). Under a
channel that nobody was told of, some of its packets never arrive. So robots note what they decoded
and what they missed (`link_evidence.py`), and packets carry these counts of all robots, each as old
as what else they tell of it. At common times every robot makes a table of links from what it then
knows (`link_tables.py`). Packets carry the best table: that of a robot whose knowledge is youngest.
At the next common time all fly by a plan made from the best table that they hold. Where the table
says that links are as they were believed, the plan goes on.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.planner.link_evidence import Evidence, no_observation, observe
from swarm_mj.policies.planner.link_tables import Tables, expected, learned
from swarm_mj.policies.planner.settings import LearningSettings, PlannerSettings
from swarm_mj.policies.planner.standing_plan import StandingPlan
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.link_models import Belief
from swarm_mj.radio.links import Links

NEVER_JOINED = np.iinfo(np.int64).max


class Flight(NamedTuple):
    """A plan, and what those who follow it believe of links."""

    plan: StandingPlan
    prior: Links  # before anything was learned
    expected_mw: Float[np.ndarray, "N N"]  # power of i at j, by what was learned [mW]


class RestingTeam:
    """The robots of one mission, side by side; row i of every array is robot i's memory."""

    def __init__(
        self, num_robots: int, belief: Belief, settings: PlannerSettings, *, learns: bool
    ) -> None:
        """Prepare the team.

        Args:
            num_robots: N.
            belief: The channel that is believed in.
            settings: Of the planner.
            learns: Whether packets carry what was learned of links.
        """
        self._belief = belief
        self._settings = settings
        self._times = CommonTimes(num_robots, settings.learning) if learns else None
        self._everyone = np.arange(num_robots)
        self._flights: dict[tuple[bytes, int | None], Flight] = {}  # by positions and table
        self._followed: list[tuple[np.ndarray, Flight]] = []  # in the slot before
        self._transmitted = np.zeros(num_robots, dtype=bool)
        self._joined = np.full(num_robots, NEVER_JOINED)  # the slot since when i follows plans
        self._evidence = Evidence(num_robots)
        self._flown: Tables | None = None
        self._next: Tables | None = None
        self._holds = self._everyone  # whose table of those flown by is the best that i has
        self._will_hold = self._everyone  # the same of the next ones

    def transmits(
        self,
        slot: int,
        in_turn: Bool[np.ndarray, "N"],
        can_plan: Bool[np.ndarray, "N"],
        heard: Int[np.ndarray, "N"],
        position_m: Float[np.ndarray, "N N 2"],
        known_until: Int[np.ndarray, "N N"],
    ) -> Bool[np.ndarray, "N"]:
        """Who transmits in a slot, by its plan or in its turn.

        Args:
            slot: Counted from the beginning of the mission; every slot once, in order.
            in_turn: Who transmits of those that cannot plan.
            can_plan: Who knows where everyone rests.
            heard: Whom each robot decoded in the slot before; itself is nobody.
            position_m: Where each robot (row) believes the others to be [m].
            known_until: [j, i]: the slot in which i told what reached j last, or a negative number.
        """
        if self._times is not None and slot > 0:
            self._note(self._times, slot, heard, known_until)
            self._pass_on(heard)
            self._keep_time(self._times, slot, known_until)
            self._joined[can_plan] = np.minimum(self._joined[can_plan], slot)
        members: dict[tuple[bytes, int | None], list[int]] = {}
        for i in np.flatnonzero(can_plan).tolist():
            members.setdefault((position_m[i].tobytes(), self._owner(i)), []).append(i)
        self._followed = []
        transmits = in_turn.copy()
        for key, robots in members.items():
            if key not in self._flights:
                self._flights[key] = self._flight(position_m[robots[0]], key[1], slot)
            flight = self._flights[key]
            follows = np.isin(self._everyone, robots)
            transmits[follows] = flight.plan.transmits(slot)[follows]
            self._followed.append((follows, flight))
        self._transmitted = transmits
        return transmits

    def _note(
        self,
        times: "CommonTimes",
        slot: int,
        heard: Int[np.ndarray, "N"],
        known_until: Int[np.ndarray, "N N"],
    ) -> None:
        """What the slot before taught those who followed a plan in it."""
        observation = no_observation(len(self._everyone))
        is_silent = known_until < slot - times.round_slots  # so nothing that it told is awaited
        knows_all = np.all(is_silent | (self._joined[None, :] <= known_until), axis=1)
        for robots, flight in self._followed:
            observe(
                robots & ~self._transmitted,
                heard,
                flight.plan.last,
                knows_all,
                flight.expected_mw,
                flight.prior.received_mw,
                flight.prior.noise_mw,
                flight.prior.threshold,
                observation,
            )
        self._evidence.add(observation)

    def _pass_on(self, heard: Int[np.ndarray, "N"]) -> None:
        """Whoever decoded someone takes over its tables where they are better."""
        if self._flown is not None:
            self._holds = self._flown.better(self._holds, self._holds[heard])
        if self._next is not None:
            self._will_hold = self._next.better(self._will_hold, self._will_hold[heard])

    def _keep_time(
        self, times: "CommonTimes", slot: int, known_until: Int[np.ndarray, "N N"]
    ) -> None:
        """Make tables and flies by them when it is time."""
        if times.are_made(slot):
            self._next = Tables(self._evidence, known_until, self._settings.learning)
            self._will_hold = self._everyone
        if times.are_flown(slot) and self._next is not None:
            self._flown, self._holds = self._next, self._will_hold
            self._flights = {key: of for key, of in self._flights.items() if key[1] is None}

    def _owner(self, i: int) -> int | None:
        """Whose table i flies by; None if it changes nothing."""
        if self._flown is None:
            return None
        owner = int(self._holds[i])
        return None if self._flown.table(owner).changes_nothing else owner

    def _flight(self, position_m: Float[np.ndarray, "N 2"], owner: int | None, slot: int) -> Flight:
        prior = self._belief.links(position_m)
        if owner is None or self._flown is None or self._times is None:
            return Flight(StandingPlan(prior, self._settings), prior, prior.received_mw)
        table = self._flown.table(owner)
        links = learned(prior, table, self._settings.learning)
        plan = StandingPlan(links, self._settings, self._times.begin(slot))
        return Flight(plan, prior, expected(prior, table))


class CommonTimes:
    """When tables are made, and when all begin to fly by them; counted in slots."""

    def __init__(self, num_robots: int, settings: LearningSettings) -> None:
        slots = SLOTS_PER_WINDOW * max(num_robots, settings.min_round_windows)
        self.round_slots = slots
        self._first = round(settings.first_rounds * slots)
        self._length = round(settings.flown_rounds * slots)
        self._spread = round(settings.spread_rounds * slots)

    def are_made(self, slot: int) -> bool:
        """Whether everyone makes a table before this slot."""
        return self.are_flown(slot + self._spread)

    def are_flown(self, slot: int) -> bool:
        """Whether everyone begins to fly by the tables made last."""
        return slot >= self._first and (slot - self._first) % self._length == 0

    def begin(self, slot: int) -> int:
        """When everyone began to fly by the tables that are flown by in this slot."""
        return slot - (slot - self._first) % self._length
