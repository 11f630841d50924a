"""Schedules of broadcasts: who transmits in each slot, chosen greedily, looking ahead.

A slot's transmitters are added one by one: always the one whose packet makes what the slot is
worth highest, while that keeps at least a share of what it was worth before. A share below 1 lets
robots far apart transmit at the same time, each heard by those near it: worth less at that moment,
but news then travels on many ways at once. Looking ahead, several first transmitters are followed
for a few slots, and the one that leaves the team youngest is taken.

A packet that raises T^{j,k} (Eq. 8) by r is worth r² times a weight of receiver j and subject k.
Where positions are only believed, a packet decodes with a probability, and timestamps are expected
ones. Index order: `i` sends, `j` receives. Times are in slots, float32, which keeps them exact for
8 million windows.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32

from swarm_mj.protocol.timestamps import merge_expected, observe_own, rise
from swarm_mj.radio.links import (
    Links,
    air_of,
    broadcast,
    chance_of_strongest,
    incoming_with,
    listen,
    lone_probabilities,
)
from swarm_mj.radio.reception import NOBODY, Air, silent_air
from swarm_mj.system.compiled import compiled


class Weights(NamedTuple):
    """What it is worth that a receiver (row) hears of a subject (column)."""

    squared_rise: Float32[np.ndarray, "N N"]  # times the square of what T rises by
    least_share: float  # of a slot's worth that must remain when a transmitter is added


class Foresight(NamedTuple):
    """How far a schedule looks ahead."""

    branches: int  # first transmitters that are tried; 1: none but the best
    slots: int  # how long each is followed, the slot in question included


@compiled()
def schedule(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    weights: Weights,
    foresight: Foresight,
    is_free: Bool[np.ndarray, "P"],
    transmits: Bool[np.ndarray, "P N"],
) -> None:
    """Fill `transmits`, slot by slot, and brings `timestamp` to the end of the last.

    Args:
        timestamp: T, written in place [slots].
        now: t before the first slot [slots].
        links: The radio; the robots stand still.
        weights: What news is worth.
        foresight: How far to look ahead.
        is_free: Which slots the schedule may fill; in the others nobody transmits.
        transmits: Who transmits in each.
    """
    reach = lone_probabilities(links) > 0.0
    after = np.empty_like(timestamp)
    for p in range(transmits.shape[0]):
        now += 1.0
        observe_own(timestamp, now)
        transmits[p] = False
        if is_free[p]:
            first = NOBODY
            if foresight.branches > 1:
                first = _best_first(timestamp, now, links, reach, weights, foresight, is_free[p:])
            _choose(timestamp, links, reach, weights, first, transmits[p])
            _advance(timestamp, links, transmits[p], after)
            timestamp[:] = after


@compiled()
def _best_first(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
    foresight: Foresight,
    is_free: Bool[np.ndarray, "P"],
) -> int:
    """The first transmitter whose branch knows most, summed over its slots; `NOBODY`: none."""
    alone = _worth_alone(timestamp, links, reach, weights)
    best, most_known = NOBODY, -np.inf
    for first in np.argsort(-alone, kind="mergesort")[: foresight.branches]:
        if alone[first] > 0.0:
            num_ahead = min(foresight.slots, len(is_free))
            known = _follow(timestamp, now, links, reach, weights, first, is_free[:num_ahead])
            if known > most_known:
                best, most_known = first, known
    return best


@compiled()
def _follow(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
    first: int,
    is_free: Bool[np.ndarray, "P"],
) -> float:
    """Return the sum of all timestamps after each of the slots that begin with this transmitter."""
    known = 0.0
    before, after = timestamp.copy(), np.empty_like(timestamp)
    transmits = np.zeros(timestamp.shape[0], dtype=np.bool_)
    for p in range(len(is_free)):
        if p > 0:
            now += 1.0
            observe_own(before, now)
        if is_free[p]:
            _choose(before, links, reach, weights, first if p == 0 else NOBODY, transmits)
            _advance(before, links, transmits, after)
            before, after = after, before
        known += float(before.sum())
    return known


@compiled()
def _choose(
    timestamp: Float32[np.ndarray, "N N"],
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
    first: int,
    transmits: Bool[np.ndarray, "N"],
) -> None:
    """Fill `transmits` with a slot's transmitters, a given first one before all others."""
    num_robots = timestamp.shape[0]
    gain = _gains(timestamp, reach, weights)
    has_news = _has_news(gain)
    air = silent_air(num_robots)
    transmits[:] = False
    value = 0.0
    if first != NOBODY:
        value = _value(links, gain, air, transmits, first)
        transmits[first] = True
        broadcast(links, air, first)
    while True:
        best, best_value = NOBODY, value * weights.least_share
        for i in range(num_robots):
            if not transmits[i] and has_news[i]:
                with_i = _value(links, gain, air, transmits, i)
                if with_i > best_value:
                    best, best_value = i, with_i
        if best == NOBODY:
            return
        value = best_value
        transmits[best] = True
        broadcast(links, air, best)


@compiled()
def _has_news(gain: Float[np.ndarray, "N N"]) -> Bool[np.ndarray, "N"]:
    """Whether it is worth anything to anyone that i transmits; who has none had better listen."""
    has_news = np.zeros(gain.shape[0], dtype=np.bool_)
    for i in range(gain.shape[0]):
        for j in range(gain.shape[0]):
            if gain[i, j] > 0.0:
                has_news[i] = True
    return has_news


@compiled()
def _worth_alone(
    timestamp: Float32[np.ndarray, "N N"],
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
) -> Float[np.ndarray, "N"]:
    """What a slot is worth in which i alone transmits."""
    num_robots = timestamp.shape[0]
    gain = _gains(timestamp, reach, weights)
    air = silent_air(num_robots)
    nobody = np.zeros(num_robots, dtype=np.bool_)
    alone = np.empty(num_robots)
    for i in range(num_robots):
        alone[i] = _value(links, gain, air, nobody, i)
    return alone


@compiled()
def _value(
    links: Links,
    gain: Float[np.ndarray, "N N"],
    air: Air,
    transmits: Bool[np.ndarray, "N"],
    also: int,
) -> float:
    """What the slot is worth when this robot transmits beside those in the air."""
    value = 0.0
    for j in range(gain.shape[0]):
        if not transmits[j] and j != also:
            incoming = incoming_with(links, air, also, j)
            worth = gain[incoming.sender, j]
            if incoming.strongest > 0.0 and worth != 0.0:
                value += worth * chance_of_strongest(links, incoming, j)
    return value


@compiled()
def _advance(
    timestamp: Float32[np.ndarray, "N N"],
    links: Links,
    transmits: Bool[np.ndarray, "N"],
    after: Float32[np.ndarray, "N N"],
) -> None:
    """Fill `after`: T as expected after a slot with these transmitters."""
    num_robots = timestamp.shape[0]
    air = air_of(links, transmits)
    heard, probability = np.arange(num_robots), np.zeros(num_robots)
    listen(links, air, NOBODY, ~transmits, heard, probability)
    merge_expected(timestamp, heard, probability, after)


@compiled()
def _gains(
    timestamp: Float32[np.ndarray, "N N"], reach: Bool[np.ndarray, "N N"], weights: Weights
) -> Float[np.ndarray, "N N"]:
    """What it is worth that j decodes i; 0 where it cannot."""
    num_robots = timestamp.shape[0]
    gains = np.zeros((num_robots, num_robots))
    for i in range(num_robots):
        for j in range(num_robots):
            if reach[i, j]:
                gains[i, j] = _gain(timestamp[i], timestamp[j], weights.squared_rise[j])
    return gains


# Adding in any order lets the compiler use its vectors. Whole slots add up exactly; products to
# rounding, so robots that plan alike need machines alike.
@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _gain(
    newer: Float32[np.ndarray, "N"],
    older: Float32[np.ndarray, "N"],
    weight: Float32[np.ndarray, "N"],
) -> float:
    """Return the worth of raising T from one row to another, summed over subjects."""
    total = np.float32(0.0)
    for k in range(older.shape[0]):
        total += _weighed(rise(newer[k], older[k]), weight[k])
    return float(total)


@compiled()
def _weighed(r: np.floating, weight: np.floating) -> np.floating:
    """A squared rise times its weight, multiplied in this order, whatever that of the sum is."""
    return r * (weight * r)
