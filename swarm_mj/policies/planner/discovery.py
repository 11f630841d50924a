"""Turns to transmit without a plan: the discovery of the team, and the search for the missing.

Both need only what is common before the mission: identities, the team's size and area, orders and
the clock. What a robot hears meanwhile can only keep it silent.
"""

from enum import Enum, auto
from functools import reduce

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.policies.policy import TeamView
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW


class Purpose(Enum):
    """The purpose of a slot."""

    DISCOVERY = auto()  # robots that may not know each other yet take turns
    SEARCH = auto()  # for robots that were not heard from for long
    PLAN = auto()


class Discovery:
    """One mission's turns to transmit; row i of every result depends on robot i's buffer alone."""

    def __init__(
        self,
        num_robots: int,
        settings: PlannerSettings,
        rng: np.random.Generator,
        *,
        num_reaches: float,
        range_m: float,
    ) -> None:
        """Draw the orders of a mission whose area is as large as this many circles of the range."""
        self._range_m = range_m
        self._settings = settings
        self._order = rng.permutation(num_robots)  # of the search
        self._place = np.argsort(self._order)  # of each robot in it
        fitting = round(settings.transmitters_per_reach * num_reaches)
        at_once = min(max(1, fitting), settings.max_transmitters)
        # The first round is fast although packets collide in it: few robots know any other yet.
        later = max(1, int(at_once * settings.later_share))
        self._groups: list[Int[np.ndarray, " G"]] = []  # of robots that transmit at the same time
        for n in range(settings.num_orders):
            order = rng.permutation(num_robots)
            size = at_once if n < settings.num_fast_rounds else later
            size = min(size, num_robots - 1)  # someone has to listen
            for first in range(0, num_robots, size):
                self._groups.append(order[first : first + size])
        windows = min(settings.search_rounds * num_robots, settings.latest_search_windows)
        self._search_slot = SLOTS_PER_WINDOW * windows

    def purpose(
        self, slot: int, is_known: Bool[np.ndarray, "N"], is_fresh: Bool[np.ndarray, "N"]
    ) -> Purpose:
        """Return what a slot is for, by a snapshot: which robots it knows, and which are fresh."""
        if slot < self._search_slot:
            return Purpose.PLAN if np.all(is_known) else Purpose.DISCOVERY
        is_turn = (slot // SLOTS_PER_WINDOW) % self._settings.search_every_windows == 0
        return Purpose.SEARCH if is_turn and not np.all(is_fresh) else Purpose.PLAN

    def transmits(self, slot: int, view: TeamView) -> Bool[np.ndarray, "N"]:
        """Return whose turn it is, except robots that know one nearby that comes before them."""
        group = self._groups[slot % len(self._groups)]
        transmits = np.zeros(len(self._order), dtype=bool)
        for turn, i in enumerate(group.tolist()):
            here_m = view.position_m[i, i]
            is_near = self._are_near(view, i, here_m, self._settings.polite_ranges)
            transmits[i] = not np.any(is_near[group[:turn]])
        return transmits

    def seeks(
        self,
        slot: int,
        view: TeamView,
        *,
        is_fresh: Bool[np.ndarray, "N"],
        was_fresh: Bool[np.ndarray, "N N"],
    ) -> Bool[np.ndarray, "N"]:
        """Return who transmits: one robot in a window's first slot, those that hear it in the next.

        A robot that has just heard a missing one answers, unless another robot near that one comes
        first. Of the missing, one after the other transmits, too. Row i of `was_fresh` is from the
        snapshot that i flew by before the last slot, since the call itself may bring a snapshot in
        which the caller is fresh.
        """
        everyone = np.arange(len(self._order))
        transmits = np.zeros(len(self._order), dtype=bool)
        turn = slot // SLOTS_PER_WINDOW // self._settings.search_every_windows
        if slot % SLOTS_PER_WINDOW == 0:
            transmits[self._order[turn % len(self._order)]] = True
            return transmits
        missing = self._order[~is_fresh[self._order]]
        transmits[missing[turn % len(missing)]] = True
        # Row i of `was_fresh` at whom i heard: False if that robot was missing to i.
        has_found = (view.heard != everyone) & ~was_fresh[everyone, view.heard]
        for i in np.flatnonzero(has_found).tolist():
            there_m = view.position_m[i, view.heard[i]]
            could = was_fresh[i] & self._are_near(view, i, there_m, 1.0)
            transmits[i] = not np.any(could & (self._place < self._place[i]))
        return transmits

    def _are_near(
        self, view: TeamView, i: int, position_m: Float[np.ndarray, "D"], ranges: float
    ) -> Bool[np.ndarray, "N"]:
        """Return the robots that i knows within some ranges of a place."""
        apart_m = view.position_m[i] - position_m
        is_near = reduce(np.hypot, apart_m.T) < ranges * self._range_m
        return is_near & view.is_known[i]
