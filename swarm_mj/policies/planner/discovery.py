"""Turns to transmit without a plan: the discovery of the team, and the search for the missing.

Both need only what is common before the mission: identities, the team's size and area, orders and
the clock. What a robot hears meanwhile can only keep it silent.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.planner.settings import DiscoverySettings, PlannerSettings
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.window import SLOTS_PER_WINDOW


class Discovery:
    """One mission's turns to transmit; row i of every result depends on robot i's buffer alone."""

    def __init__(
        self,
        num_robots: int,
        num_reaches: float,
        range_m: float,
        settings: PlannerSettings,
        rng: np.random.Generator,
    ) -> None:
        """Draw the orders of a mission whose area is as large as this many circles of the range."""
        self.num_robots = num_robots
        self._range_m = range_m
        self._polite_ranges = settings.discovery.polite_ranges
        self._search = settings.search
        self._order = rng.permutation(num_robots)
        self._place = np.argsort(self._order)
        self._groups = [
            group
            for size in _group_sizes(num_robots, num_reaches, settings.discovery)
            for group in _cut(rng.permutation(num_robots), size)
        ]

    def is_discovered(self, slot: int, is_complete: bool) -> bool:
        """Return whether a slot is the discovery's, by a snapshot that has all robots or not."""
        return not is_complete and not self._is_late(slot)

    def is_sought(self, slot: int, is_fresh: Bool[np.ndarray, "N"]) -> bool:
        """Return whether a slot is the search's, by a snapshot in which these are fresh."""
        is_turn = (slot // SLOTS_PER_WINDOW) % self._search.every_windows == 0
        return is_turn and self._is_late(slot) and not np.all(is_fresh)

    def transmits(self, slot: int, buffers: Buffers, b: int) -> Bool[np.ndarray, "N"]:
        """Return whose turn it is, except robots that know one nearby that comes before them."""
        group = self._groups[slot % len(self._groups)]
        transmits = np.zeros(self.num_robots, dtype=bool)
        for turn, i in enumerate(group.tolist()):
            here_m = buffers.position_m[b, i, i]
            is_near = self._are_near(buffers, b, i, here_m, self._polite_ranges)
            transmits[i] = not np.any(is_near[group[:turn]])
        return transmits

    def seeks(
        self,
        slot: int,
        is_fresh: Bool[np.ndarray, "N"],
        was_fresh: Bool[np.ndarray, "N N"],
        heard: Int[np.ndarray, "N"],
        buffers: Buffers,
        b: int,
    ) -> Bool[np.ndarray, "N"]:
        """Return who transmits: one robot in a window's first slot, those that hear it in the next.

        A robot that has just heard a missing one answers, unless another robot near that one comes
        first. Of the missing that hold this snapshot, one after the other transmits. Row i of
        `was_fresh` is from the snapshot that i flew by before the last slot, since the call itself
        may bring a snapshot in which the caller is fresh.
        """
        transmits = np.zeros(self.num_robots, dtype=bool)
        turn = slot // SLOTS_PER_WINDOW // self._search.every_windows
        if slot % SLOTS_PER_WINDOW == 0:
            transmits[self._order[turn % self.num_robots]] = True
            return transmits
        missing = self._order[~is_fresh[self._order]]
        transmits[missing[turn % len(missing)]] = True
        everyone = np.arange(self.num_robots)
        has_found = (heard != everyone) & ~was_fresh[everyone, heard]
        for i in np.flatnonzero(has_found).tolist():
            there_m = buffers.position_m[b, i, heard[i]]
            could = was_fresh[i] & self._are_near(buffers, b, i, there_m, 1.0)
            transmits[i] = not np.any(could & (self._place < self._place[i]))
        return transmits

    def _is_late(self, slot: int) -> bool:
        windows = min(
            self._search.start_rounds * self.num_robots, self._search.latest_start_windows
        )
        return slot >= SLOTS_PER_WINDOW * windows

    def _are_near(
        self, buffers: Buffers, b: int, i: int, position_m: Float[np.ndarray, "2"], ranges: float
    ) -> Bool[np.ndarray, "N"]:
        """Return the robots that i knows within some ranges of a place."""
        apart_m = buffers.position_m[b, i] - position_m
        is_near = np.hypot(apart_m[:, 0], apart_m[:, 1]) < ranges * self._range_m
        return is_near & buffers.is_known[b, i]


def _group_sizes(num_robots: int, num_reaches: float, settings: DiscoverySettings) -> list[int]:
    """Return how many robots transmit at once, in each round."""
    at_once = round(settings.transmitters_per_reach * num_reaches)
    at_once = int(np.clip(at_once, 1, settings.max_transmitters))
    # The first round is fast although packets collide in it, since few robots know any other yet.
    later = max(1, int(at_once * settings.later_share))
    num_later = settings.num_rounds - settings.num_fast_rounds
    sizes = [at_once] * settings.num_fast_rounds + [later] * num_later
    return [min(size, num_robots - 1) for size in sizes]


def _cut(order: Int[np.ndarray, "N"], size: int) -> list[Int[np.ndarray, "K"]]:
    """Return an order cut into groups that transmit at the same time."""
    return [order[begin : begin + size] for begin in range(0, len(order), size)]
