"""Schedules of broadcasts: who transmits in each slot, chosen greedily, looking ahead.

A slot's transmitters are added one by one: always the one whose packet raises the slot's value
most, while that keeps at least a share of the value before. A share below 1 lets robots far apart
transmit at once: less valuable at that moment, but news then travels on many ways. Looking ahead,
several first transmitters are followed for a few slots, and the one that leaves the team youngest
is taken.

A packet that raises T^{j,k} (Eq. 8) by r has the value r² times a weight of receiver j and subject
k, times the probability that it decodes; timestamps are expected ones. Index order: `i` sends, `j`
receives. Times are in slots, float32, which keeps them exact for 8 million windows.

The first flight compiles these functions, so there are few, and they write loops where an array
expression or a sort would take numba seconds to compile.
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
)
from swarm_mj.radio.reception import NOBODY, Air, silent_air
from swarm_mj.system.compiled import compiled


class Problem(NamedTuple):
    """All that schedules over the same links follow from, but T, t and the slots that are free."""

    links: Links
    lone: Float[np.ndarray, "N N"]  # probability that j decodes i when nobody else transmits
    weight: Float32[np.ndarray, "N N"]  # of a squared rise of T, by receiver j and subject k
    min_share: float  # of a slot's value that must remain when a transmitter is added
    width: int  # first transmitters that are tried; 1: none but the best
    depth: int  # how long each is followed, the slot in question included [slots]


def schedule_slot(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    problem: Problem,
    is_free: Bool[np.ndarray, "depth"],
) -> Bool[np.ndarray, "N"]:
    """Return who transmits in the slot that ends now, and bring `timestamp` to its end.

    Slots that are not free, this one or one of those looked ahead to, are silent.
    """
    first = NOBODY
    if problem.width > 1 and is_free[0]:
        first = _best_first(timestamp, now, problem, is_free)
    _, transmits = _follow(timestamp, now, problem, first, is_free[:1])
    return transmits


def _best_first(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    problem: Problem,
    is_free: Bool[np.ndarray, "depth"],
) -> int:
    """Return the first transmitter of a slot by whose branch most is known, or `NOBODY`."""
    alone = _values_alone(timestamp, now, problem)
    best, most_known = int(NOBODY), -np.inf
    for _ in range(problem.width):
        first = int(np.argmax(alone))
        if alone[first] <= 0.0:
            return best
        alone[first] = 0.0
        known, _ = _follow(timestamp.copy(), now, problem, first, is_free)
        if known > most_known:
            best, most_known = first, known
    return best


@compiled()
def _values_alone(
    timestamp: Float32[np.ndarray, "N N"], now: float, problem: Problem
) -> Float[np.ndarray, "N"]:
    """Return the value of the slot that ends now for each robot that might transmit alone."""
    observe_own(timestamp, now)
    gain, _ = _gains(timestamp, problem)
    alone = np.zeros(timestamp.shape[0])
    for i in range(timestamp.shape[0]):
        for j in range(timestamp.shape[0]):
            alone[i] += gain[i, j] * problem.lone[i, j]
    return alone


@compiled()
def _follow(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    problem: Problem,
    first: int,
    is_free: Bool[np.ndarray, "P"],
) -> tuple[float, Bool[np.ndarray, "N"]]:
    """Bring `timestamp` to the end of slots, of which the first begins with this transmitter.

    Return the sum of all timestamps after each of them, and who transmits in the last.
    """
    known, transmits = 0.0, np.zeros(timestamp.shape[0], dtype=np.bool_)
    for p in range(is_free.shape[0]):
        observe_own(timestamp, now + p)
        if is_free[p]:
            transmits = _choose(timestamp, problem, first if p == 0 else NOBODY)
        total = np.float32(0.0)
        for i in range(timestamp.shape[0]):
            for k in range(timestamp.shape[0]):
                total += timestamp[i, k]
        known += float(total)
    return known, transmits


@compiled()
def _choose(
    timestamp: Float32[np.ndarray, "N N"], problem: Problem, first: int
) -> Bool[np.ndarray, "N"]:
    """Return a slot's transmitters, a given first one among them, and bring T to its end."""
    num_robots, links = timestamp.shape[0], problem.links
    gain, has_news = _gains(timestamp, problem)
    air = silent_air(num_robots)
    heard, probability = np.empty(num_robots, dtype=np.int64), np.empty(num_robots)
    transmits = np.zeros(num_robots, dtype=np.bool_)
    listens = np.ones(num_robots, dtype=np.bool_)
    best, value = first, 0.0
    if first != NOBODY:
        value = _value(links, gain, air, transmits, first)
    while True:
        if best != NOBODY:
            transmits[best], listens[best] = True, False
            broadcast(links, air, best)
        best, best_value = NOBODY, value * problem.min_share
        for i in range(num_robots):
            if listens[i] and has_news[i]:
                with_i = _value(links, gain, air, transmits, i)
                if with_i > best_value:
                    best, best_value = i, with_i
        if best == NOBODY:
            break
        value = best_value
    # The sum of powers anew, since its rounding depends on the order of the transmitters.
    listen(links, air_of(links, transmits), NOBODY, listens, heard, probability)
    # In place: a robot that transmits decodes nothing, so its row is as it was sent.
    merge_expected(timestamp, heard, probability, timestamp)
    return transmits


@compiled()
def _value(
    links: Links,
    gain: Float[np.ndarray, "N N"],
    air: Air,
    transmits: Bool[np.ndarray, "N"],
    also: int,
) -> float:
    """Return the value of the slot when this robot transmits in addition to those in the air."""
    value = 0.0
    for j in range(gain.shape[0]):
        if not transmits[j] and j != also:
            incoming = incoming_with(links, air, also, j)
            news = gain[incoming.sender, j]
            if incoming.strongest > 0.0 and news != 0.0:
                value += news * chance_of_strongest(links, incoming, j)
    return value


@compiled()
def _gains(
    timestamp: Float32[np.ndarray, "N N"], problem: Problem
) -> tuple[Float[np.ndarray, "N N"], Bool[np.ndarray, "N"]]:
    """Return the value of j decoding i, where it can, and which robots have news for anyone."""
    num_robots = timestamp.shape[0]
    gain = np.zeros((num_robots, num_robots))
    has_news = np.zeros(num_robots, dtype=np.bool_)
    for i in range(num_robots):
        for j in range(num_robots):
            if problem.lone[i, j] > 0.0:
                gain[i, j] = _gain(timestamp[i], timestamp[j], problem.weight[j])
                if gain[i, j] > 0.0:
                    has_news[i] = True
    return gain, has_news


# Adding in any order lets the compiler use its vectors. Whole slots add up exactly; products to
# rounding, so robots that plan alike need machines alike.
@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _gain(
    newer: Float32[np.ndarray, "N"],
    older: Float32[np.ndarray, "N"],
    weight: Float32[np.ndarray, "N"],
) -> float:
    """Return the value of raising T from one row to another, summed over subjects."""
    total = np.float32(0.0)
    for k in range(older.shape[0]):
        total += _weighed(rise(newer[k], older[k]), weight[k])
    return float(total)


# Apart from `_gain`, whose permission to reorder sums would extend to this product.
@compiled()
def _weighed(r: np.floating, weight: np.floating) -> np.floating:
    """Return a squared rise times its weight, multiplied in this order."""
    return r * (weight * r)
