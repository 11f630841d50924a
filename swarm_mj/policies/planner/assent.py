"""Robots tell each other whether a plan serves all; while it does not, turns have some slots.

A plan may fail for ever: robots of small teams join it one by one, each in the turn of another; or
a link that it rests on does not exist. So no plan has all slots. Every few slots belong to the
turns of TDMA, and a robot takes its turn there unless it knows that the plan serves everyone.

Each packet carries a bit of every robot: whether it hears of all lately. Robots wait for one whose
bit is not set, or not known. So no state lasts in which a robot is overdue somewhere: either that
reaches all as a bit, or those whom it does not reach miss news themselves; then all take turns in
these slots until the news has come. The slots visit every robot's turn, as their distance and the
number of turns have no common divisor.
"""

import math

import numpy as np
from jaxtyping import Bool, Int

from swarm_mj.policies.planner.settings import PlannerSettings
from swarm_mj.protocol.timestamps import SLOTS_PER_WINDOW


class Assent:
    """Who hears of all lately, as robots of one mission tell each other."""

    def __init__(self, num_robots: int, settings: PlannerSettings) -> None:
        """Begin without any assent."""
        self._overdue = round(SLOTS_PER_WINDOW * settings.overdue_rounds * num_robots)  # [slots]
        # Of the latest slots, by their remainder: older bits are of robots that are overdue anyway.
        self._bits = np.zeros((self._overdue + 2, num_robots), dtype=np.bool_)
        self._everyone = np.arange(num_robots)

    def tell(
        self, slot: int, can_plan: Bool[np.ndarray, "N"], known_until: Int[np.ndarray, "N N"]
    ) -> Bool[np.ndarray, "N"]:
        """Note who hears of all, and return who knows that all do.

        Args:
            slot: The present one, one after that of the last call.
            can_plan: Who has heard of all, and of no motion, [N].
            known_until: [j, i] is the last slot of which j knows what i observed.
        """
        since = slot - known_until
        since[self._everyone, self._everyone] = 0
        is_fresh = since <= self._overdue
        assents = can_plan & np.all(is_fresh, axis=1)
        self._bits[slot % len(self._bits)] = assents
        reported = self._bits[(slot - since) % len(self._bits), self._everyone]
        return np.all(reported & is_fresh & (slot >= since), axis=1)


def turns_every(num_robots: int, settings: PlannerSettings, *, learns: bool) -> int:
    """Return every how many slots one belongs to the turns, of which there is one of each robot.

    Without a payload nobody can know that the turns are not needed, so they are rarer.
    """
    least = settings.min_turns_every if learns else settings.min_turns_every_without_payload
    every = max(least, round(settings.turns_every_robots * num_robots))
    while math.gcd(every, num_robots) > 1:
        every += 1
    return every
