"""One team at rest, slot by slot: the plans that its robots follow, and what they learn of links.

The rules are those of `resting.py`. Every robot decides from its own row of what the team holds;
robots whose plans follow from the same grounds share one, which is made once.
"""

import math
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.planner import link_evidence, link_tables
from swarm_mj.policies.planner.assent import Assent, turns_every
from swarm_mj.policies.planner.plan import Plan
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import TeamView
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW, slot_at, slot_of
from swarm_mj.radio.links import Links
from swarm_mj.radio.mission_radio import Belief
from swarm_mj.system.decibels import from_db

NOT_YET = np.iinfo(np.int64).max  # the slot since when a robot follows plans, if it does not


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


class RestingTeam:
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
        self._evidence = link_evidence.Evidence(num_robots)
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
        now = slot_at(view.now)
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
        kinds = np.full(len(self._everyone), link_evidence.NOTHING)
        for follows, flight, planned in self._followed:
            listens = follows & ~self._transmitted & knows_all_plan
            noted = link_evidence.observe(listens, heard, planned, flight.expected_mw, flight.prior)
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

    def _flight(self, position_m: Float[np.ndarray, "N D"], owner: int | None) -> _Flight:
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

    def _drawn(self, position_m: Float[np.ndarray, "N D"], slot: int) -> Links:
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
    sent_in = slot_of(view.timestamp) - 1 - first_slot
    return sent_in - 1
