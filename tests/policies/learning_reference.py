"""Robots at rest that learn their links, one object each, which share nothing but packets.

A mind is handed its own buffer row and what the packets hold that it decoded. It notes, makes
tables and plans alone.
"""

import copy
import math
from collections import Counter
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from decentralised_reference import Flight, planned, rows

from swarm_mj.policies.planner.link_tables import LAWS, LinkTable, corrected, fit, link_fields
from swarm_mj.policies.planner.resting import RestingPlanner
from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.registry import make_policy
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of

NUM_SLOTS = 120  # of a mission, at most

# Rounds of 8 windows: tables are made in slots 32, 48, 64 and flown by from 40, 56, 72 on.
SHORT = PlannerSettings(
    first_table_rounds=2.5,
    flown_rounds=1.0,
    spread_rounds=0.5,
    min_round_windows=8,
    min_log_odds=1.0,
    min_planned_robots=2,
)


def learner(mission, settings=SHORT):
    """The planner that learns, by other numbers."""
    return RestingPlanner(mission, settings, learns=True)


def rounded(field, values):
    """Numbers as they arrive in a field of a packet."""
    codes = np.rint((values - field.low) / field.step)
    return field.low + field.step * np.clip(codes, 0, 2**field.bits - 1)


class Told(NamedTuple):
    """What a robot says of itself; others pass it on as it is."""

    slot: int  # in which it said so; it knew what it noted in the slots before
    follows: bool  # whether it had begun to follow plans before
    notes: frozenset  # how often it noted (sender, bin, whether decoded)
    assents: bool  # whether it had heard of all lately, one slot before


class Table(NamedTuple):
    """A table of links as a packet carries it."""

    rank: tuple[int, int]  # the less the better
    law: int
    mean_db: np.ndarray
    std_db: np.ndarray

    @property
    def changes_nothing(self):
        differs = self.mean_db.any() or self.std_db.any()
        return math.isinf(LAWS[self.law][0]) and not differs


class LearningPacket(NamedTuple):
    """What comes beside T, M and P."""

    told: dict[int, Told]
    flown: Table | None
    upcoming: Table | None


@dataclass(kw_only=True)
class LearningMind:
    """One robot: its identity, what is common before the mission, and its memory."""

    me: int
    mission: object
    settings: PlannerSettings
    learns: bool
    told: dict[int, Told] = field(default_factory=dict)  # the youngest, of every robot
    notes: Counter = field(default_factory=Counter)
    follows: bool = False
    assents: bool = False
    flown: Table | None = None
    upcoming: Table | None = None
    heard: int | None = None  # whom it decoded in the slot before
    plan: tuple | None = None  # what it followed then
    transmitted: bool = False
    plans: dict = field(default_factory=dict)
    took_over: int = 0  # how often it found a better table than the one that it flew by

    def packet(self):
        """What it sends in this slot."""
        return LearningPacket(dict(self.told), self.flown, self.upcoming)

    def hear(self, sender, packet):
        """One slot: whom it decoded, if anybody, and what came beside T, M and P."""
        self.heard = sender
        if packet is None:
            return
        for i, told in packet.told.items():
            if i not in self.told or told.slot > self.told[i].slot:
                self.told[i] = told
        if packet.flown is not None and packet.flown.rank < self.flown.rank:
            self.flown, self.took_over = packet.flown, self.took_over + 1
        if packet.upcoming is not None and packet.upcoming.rank < self.upcoming.rank:
            self.upcoming = packet.upcoming

    def transmits(self, row, slot, in_turn, owns_slot):
        """Whether it does in the slot that begins now."""
        seen, position_m, velocity_mps = row
        if slot > 0:
            self.note(slot - 1)
            self.keep_time(slot)
        self.told[self.me] = Told(slot, self.follows, frozenset(self.notes.items()), self.assents)
        self.plan, self.transmitted = None, in_turn
        can_plan = all(seen > 0.0) and not velocity_mps.any()
        self.assents = can_plan and self.hears_of_all(slot)
        is_for_turns = slot % self.turns_every == 0
        if can_plan:
            self.follows = True
        if can_plan and is_for_turns and not (self.learns and self.knows_that_all_assent()):
            self.transmitted = owns_slot
        elif can_plan:
            begin, transmits, *beliefs = self.plan_for(position_m, slot)
            self.transmitted = bool(transmits[slot - begin, self.me])
            if not is_for_turns:
                self.plan = (begin, transmits, *beliefs)
        return self.transmitted

    @property
    def turns_every(self):
        """The least number from a quarter of the team's, that has no divisor in common with it."""
        num_robots = self.mission.num_robots
        every = max(3 if self.learns else 8, round(num_robots / 4))
        while any(every % k == num_robots % k == 0 for k in range(2, every + 1)):
            every += 1
        return every

    def hears_of_all(self, slot):
        """Whether what it was told of each of the others is not overdue, in rounds of N windows."""
        others = [told for i, told in self.told.items() if i != self.me]
        overdue = 2 * self.settings.overdue_rounds * self.mission.num_robots
        return all(slot - told.slot + 1 <= overdue for told in others)

    def knows_that_all_assent(self):
        """Whether all said lately that they hear of all, and it does as well."""
        others = [told for i, told in self.told.items() if i != self.me]
        return self.assents and all(told.assents for told in others)

    @property
    def num_slots(self):
        """When the first table is flown by, how long each is, and how long it spreads [slots]."""
        learning = self.settings
        of_round = 2 * max(self.mission.num_robots, learning.min_round_windows)
        return [
            round(rounds * of_round)
            for rounds in (
                learning.first_table_rounds,
                learning.flown_rounds,
                learning.spread_rounds,
            )
        ]

    def keep_time(self, slot):
        """Makes its table, or flies by the best that it holds, when it is time."""
        first, length, spread = self.num_slots
        if slot in range(first - spread, slot + 1, length):
            self.upcoming = self.table()
        if slot in range(first, slot + 1, length):
            self.flown = self.upcoming

    def table(self):
        """What follows from what it was told; ranked by how young that is."""
        num_robots = self.mission.num_robots
        counts = np.zeros((2, num_robots, num_robots, 24), dtype=np.int64)
        for j, told in self.told.items():
            for (i, place, is_decoded), times in told.notes:
                counts[int(is_decoded), j, i, place] = times
        of = fit(counts[1], counts[0], self.settings)
        *_, mean, std = link_fields(self.mission)
        known = sum(self.told[i].slot if i in self.told else -1 for i in range(num_robots))
        return Table((-known, self.me), of.law, rounded(mean, of.mean_db), rounded(std, of.std_db))

    def plan_for(self, position_m, slot):
        """When the plan began, who transmits from then on, and the powers it believes in."""
        first, length, _ = self.num_slots
        table = None if self.flown is None or self.flown.changes_nothing else self.flown
        begin = 0 if table is None else slot - (slot - first) % length
        num_slots = NUM_SLOTS if table is None else length
        key = None if table is None else (begin, table.rank)
        if key not in self.plans:
            prior = links_between(radio_of(self.mission), position_m)
            believed, links = prior.received_mw, prior
            if table is not None:
                believed = believed * 10.0 ** (table.mean_db / 10.0)
                of = LinkTable(law=table.law, mean_db=table.mean_db, std_db=table.std_db)
                links = corrected(prior, of, self.settings)
            self.plans[key] = (begin, planned(links, self.settings, num_slots), believed, prior)
        return self.plans[key]

    def note(self, slot):
        """What it decoded or missed in a slot of which it knows who transmitted."""
        # Whoever told nothing younger for three rounds is not waited for.
        least = slot + 2 - 6 * max(self.mission.num_robots, self.settings.min_round_windows)
        knows_all = len(self.told) == self.mission.num_robots and all(
            told.follows or told.slot < least for told in self.told.values()
        )
        if self.plan is None or self.transmitted or not knows_all:
            return
        begin, transmits, believed_mw, prior = self.plan
        sending = [k for k in np.flatnonzero(transmits[slot - begin]).tolist() if k != self.me]
        sender = self.heard
        if sender is None and sending:
            sender = max(sending, key=lambda k: believed_mw[k, self.me])
        if sender is None:
            return
        others_mw = sum(believed_mw[k, self.me] for k in sending if k != sender)
        ratio = prior.received_mw[sender, self.me] / (prior.noise_mw + others_mw)
        # Bins of 2 dB; the lowest is around -15 dB.
        place = math.floor((10.0 * math.log10(ratio / prior.threshold) + 16.0) / 2.0)
        if place < 0 and self.heard is None:
            return
        kind = (sender, min(max(place, 0), 23), self.heard is not None)
        if self.notes[kind] < 255 and (kind in +self.notes or len(+self.notes) < 64):
            self.notes[kind] += 1
        self.notes = +self.notes


class LearnedApart(Flight):
    """A flight of the planner at rest beside minds; without a payload, none learns."""

    def __init__(self, mission, seed, *, channel=None, settings=SHORT, learns=True):
        self.learns, self.turns = learns, make_policy("spatial-tdma", mission)
        plain = RestingPlanner(mission, settings)
        policy = learner(mission, settings) if learns else plain
        minds = [
            LearningMind(me=i, mission=mission, settings=settings, learns=learns)
            for i in range(mission.num_robots)
        ]
        super().__init__(policy, mission, seed, channel=channel, minds=minds)

    def start(self, num_robots, rngs):
        self.turns.start(num_robots, copy.deepcopy(rngs))
        super().start(num_robots, rngs)

    def transmits(self, views):
        self.in_turn = self.turns.transmits(views)[0]
        self.owns_slot = self.turns.owns_slot(views)[0]
        return super().transmits(views)

    def asked(self, mind, views, slot):
        row = rows(views.buffers, mind.me)
        if self.learns:  # what packets tell of a robot is as old as T
            for i, t in enumerate(row[0].tolist()):
                told = mind.told.get(i)
                assert t == (0.0 if told is None else (told.slot + 1) / 2)
        in_turn, owns_slot = bool(self.in_turn[mind.me]), bool(self.owns_slot[mind.me])
        return mind.transmits(row, slot, in_turn, owns_slot)

    def converse(self, heard):
        if self.learns:
            super().converse(heard)
