"""Schedules of broadcasts: who speaks in each half window, chosen greedily, looking ahead.

A half window's speakers are added one by one: always the one whose packet makes what the half
window is worth highest, while that keeps at least a share of what it was worth before. A share
below 1 lets robots far apart speak at the same time, each heard by those near it: worth less at
that moment, but news then travels on many ways at once. Looking ahead, several first speakers are
followed for a few half windows, and the one that leaves the team youngest is taken.

A packet that raises T^{j,k} (Eq. 8) by r is worth r² times a weight of receiver j and subject k.
Where positions are only believed, a packet decodes with a probability, and timestamps are expected
ones. Index order: `i` sends, `j` receives. Times are in half windows, float32, which keeps them
exact for 8 million windows. All kernels are in this one file, because numba's cache does not see
changes in another.
"""

from typing import NamedTuple, no_type_check

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numba import njit

from swarm_mj.radio.links import Links

LOGISTIC = 1.702  # 1 / (1 + exp(-1.702 z)) is within 0.01 of the normal distribution function
CERTAIN = 2.5  # standard deviations beyond which a packet decodes for certain, or never
NOBODY = -1


class Weights(NamedTuple):
    """What it is worth that a receiver (row) hears of a subject (column)."""

    squared_rise: Float32[np.ndarray, "N N"]  # times the square of what T rises by
    least_share: float  # of a half window's worth that must remain when a speaker is added


class Foresight(NamedTuple):
    """How far a schedule looks ahead."""

    branches: int  # first speakers that are tried; 1: none but the best
    half_windows: int  # how long each is followed, the half window in question included


class _Air(NamedTuple):
    """What is in the air at every receiver j."""

    total_mw: Float[np.ndarray, "N"]
    strongest_mw: Float[np.ndarray, "N"]
    strongest: Int[np.ndarray, "N"]  # who is received with that power


@njit(cache=True)
@no_type_check
def schedule(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    weights: Weights,
    foresight: Foresight,
    is_free: Bool[np.ndarray, "P"],
    speaks: Bool[np.ndarray, "P N"],
) -> None:
    """Fills `speaks`, half window by half window, and brings `timestamp` to the end of the last.

    Args:
        timestamp: T, written in place [half windows].
        now: t before the first half window [half windows].
        links: The radio; the robots stand still.
        weights: What news is worth.
        foresight: How far to look ahead.
        is_free: Which half windows the schedule may fill; in the others nobody speaks.
        speaks: Who speaks in each.
    """
    reach = _reach(links)
    after = np.empty_like(timestamp)
    for p in range(speaks.shape[0]):
        now += 1.0
        _observe_self(timestamp, now)
        speaks[p] = False
        if is_free[p]:
            first = NOBODY
            if foresight.branches > 1:
                first = _best_first(timestamp, now, links, reach, weights, foresight, is_free[p:])
            _choose(timestamp, links, reach, weights, first, speaks[p])
            _advance(timestamp, links, speaks[p], after)
            timestamp[:] = after


@njit(cache=True)
@no_type_check
def fly(
    timestamp: Float32[np.ndarray, "N N"], now: float, links: Links, speaks: Bool[np.ndarray, "P N"]
) -> float:
    """Brings `timestamp` to where these speakers lead over these links.

    Args:
        timestamp: T, written in place [half windows].
        now: t before the first half window [half windows].
        links: The radio; the robots stand still.
        speaks: Who speaks in each half window.

    Returns:
        The mean age of information after each half window, over all of them [half windows].
    """
    after = np.empty_like(timestamp)
    age = 0.0
    for p in range(speaks.shape[0]):
        now += 1.0
        _observe_self(timestamp, now)
        _advance(timestamp, links, speaks[p], after)
        timestamp[:] = after
        age += now - float(timestamp.mean())
    return age / speaks.shape[0]


@njit(cache=True)
@no_type_check
def _best_first(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
    foresight: Foresight,
    is_free: Bool[np.ndarray, "P"],
) -> int:
    """The first speaker whose branch knows most, summed over its half windows; `NOBODY`: none."""
    alone = _worth_alone(timestamp, links, reach, weights)
    best, most_known = NOBODY, -np.inf
    for first in np.argsort(-alone, kind="mergesort")[: foresight.branches]:
        if alone[first] > 0.0:
            num_ahead = min(foresight.half_windows, len(is_free))
            known = _follow(timestamp, now, links, reach, weights, first, is_free[:num_ahead])
            if known > most_known:
                best, most_known = first, known
    return best


@njit(cache=True)
@no_type_check
def _follow(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
    first: int,
    is_free: Bool[np.ndarray, "P"],
) -> float:
    """The sum of all timestamps after each of the half windows that begin with this speaker."""
    known = 0.0
    before, after = timestamp.copy(), np.empty_like(timestamp)
    speaks = np.zeros(timestamp.shape[0], dtype=np.bool_)
    for p in range(len(is_free)):
        if p > 0:
            now += 1.0
            _observe_self(before, now)
        if is_free[p]:
            _choose(before, links, reach, weights, first if p == 0 else NOBODY, speaks)
            _advance(before, links, speaks, after)
            before, after = after, before
        known += float(before.sum())
    return known


@njit(cache=True)
@no_type_check
def _choose(
    timestamp: Float32[np.ndarray, "N N"],
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
    first: int,
    speaks: Bool[np.ndarray, "N"],
) -> None:
    """Fills `speaks` with a half window's speakers, a given first one before all others."""
    num_robots = timestamp.shape[0]
    gain = _gains(timestamp, reach, weights)
    has_news = _has_news(gain)
    air = _silent_air(num_robots)
    speaks[:] = False
    value = 0.0
    if first != NOBODY:
        value = _value(links, gain, air, speaks, first)
        _speak(links, air, speaks, first)
    while True:
        best, best_value = NOBODY, value * weights.least_share
        for i in range(num_robots):
            if not speaks[i] and has_news[i]:
                with_i = _value(links, gain, air, speaks, i)
                if with_i > best_value:
                    best, best_value = i, with_i
        if best == NOBODY:
            return
        value = best_value
        _speak(links, air, speaks, best)


@njit(cache=True)
@no_type_check
def _has_news(gain: Float[np.ndarray, "N N"]) -> Bool[np.ndarray, "N"]:
    """Whether it is worth anything to anyone that i speaks; who has none had better listen."""
    has_news = np.zeros(gain.shape[0], dtype=np.bool_)
    for i in range(gain.shape[0]):
        for j in range(gain.shape[0]):
            if gain[i, j] > 0.0:
                has_news[i] = True
    return has_news


@njit(cache=True)
@no_type_check
def _worth_alone(
    timestamp: Float32[np.ndarray, "N N"],
    links: Links,
    reach: Bool[np.ndarray, "N N"],
    weights: Weights,
) -> Float[np.ndarray, "N"]:
    """What a half window is worth in which i alone speaks."""
    num_robots = timestamp.shape[0]
    gain = _gains(timestamp, reach, weights)
    air = _silent_air(num_robots)
    nobody = np.zeros(num_robots, dtype=np.bool_)
    alone = np.empty(num_robots)
    for i in range(num_robots):
        alone[i] = _value(links, gain, air, nobody, i)
    return alone


@njit(cache=True)
@no_type_check
def _value(
    links: Links,
    gain: Float[np.ndarray, "N N"],
    air: _Air,
    speaks: Bool[np.ndarray, "N"],
    also: int,
) -> float:
    """What the half window is worth when this robot speaks beside those in the air."""
    received_mw, distance_over_std = links.received_mw, links.distance_over_std
    noise_mw, threshold = links.noise_mw, links.threshold
    total_mw, strongest_mw, strongest = air.total_mw, air.strongest_mw, air.strongest
    value = 0.0
    for j in range(gain.shape[0]):
        if not speaks[j] and j != also:
            added_mw = received_mw[also, j]
            is_stronger = added_mw > strongest_mw[j]
            sender = also if is_stronger else strongest[j]
            signal_mw = added_mw if is_stronger else strongest_mw[j]
            if signal_mw > 0.0 and gain[sender, j] != 0.0:
                noise = noise_mw + (total_mw[j] + added_mw - signal_mw)
                value += gain[sender, j] * _chance(
                    signal_mw, noise, threshold, distance_over_std[sender, j]
                )
    return value


@njit(cache=True)
@no_type_check
def _chance(signal_mw: float, noise_mw: float, threshold: float, distance_over_std: float) -> float:
    """How probably a packet over a believed distance decodes; see `greedy._chance`."""
    ratio = signal_mw / noise_mw / threshold
    if distance_over_std == np.inf:
        return 1.0 if ratio >= 1.0 else 0.0
    deviations = (np.sqrt(ratio) - 1.0) * distance_over_std
    if abs(deviations) > CERTAIN:
        return 1.0 if deviations > 0.0 else 0.0
    return 1.0 / (1.0 + np.exp(-LOGISTIC * deviations))


@njit(cache=True)
@no_type_check
def _reach(links: Links) -> Bool[np.ndarray, "N N"]:
    """Whether j may decode i when nobody else speaks."""
    num_robots = links.received_mw.shape[0]
    reach = np.zeros((num_robots, num_robots), dtype=np.bool_)
    for i in range(num_robots):
        for j in range(num_robots):
            signal_mw = links.received_mw[i, j]
            if signal_mw > 0.0:
                chance = _chance(
                    signal_mw, links.noise_mw, links.threshold, links.distance_over_std[i, j]
                )
                reach[i, j] = chance > 0.0
    return reach


@njit(cache=True)
@no_type_check
def _silent_air(num_robots: int) -> _Air:
    return _Air(np.zeros(num_robots), np.zeros(num_robots), np.zeros(num_robots, dtype=np.int64))


@njit(cache=True)
@no_type_check
def _speak(links: Links, air: _Air, speaks: Bool[np.ndarray, "N"], i: int) -> None:
    """Adds i's packet to the air."""
    speaks[i] = True
    for j in range(speaks.shape[0]):
        received_mw = links.received_mw[i, j]
        air.total_mw[j] += received_mw
        if received_mw > air.strongest_mw[j]:
            air.strongest_mw[j] = received_mw
            air.strongest[j] = i


@njit(cache=True)
@no_type_check
def _observe_self(timestamp: Float32[np.ndarray, "N N"], now: float) -> None:
    """Everyone observes itself, as Eq. 5 has it."""
    for i in range(timestamp.shape[0]):
        timestamp[i, i] = now


@njit(cache=True, fastmath={"nnan", "nsz"})
@no_type_check
def _advance(
    timestamp: Float32[np.ndarray, "N N"],
    links: Links,
    speaks: Bool[np.ndarray, "N"],
    after: Float32[np.ndarray, "N N"],
) -> None:
    """Fills `after`: T as expected after a half window with these speakers, by Eq. 8."""
    num_robots = timestamp.shape[0]
    air, added = _silent_air(num_robots), np.zeros(num_robots, dtype=np.bool_)
    for i in np.flatnonzero(speaks):
        _speak(links, air, added, i)
    for j in range(num_robots):
        chance, sender = np.float32(0.0), air.strongest[j]
        signal_mw = air.strongest_mw[j]
        if not speaks[j] and signal_mw > 0.0:
            noise_mw = links.noise_mw + (air.total_mw[j] - signal_mw)
            distance_over_std = links.distance_over_std[sender, j]
            chance = np.float32(_chance(signal_mw, noise_mw, links.threshold, distance_over_std))
        for k in range(num_robots):
            rise = max(timestamp[sender, k] - timestamp[j, k], np.float32(0.0))
            after[j, k] = timestamp[j, k] + chance * rise


@njit(cache=True)
@no_type_check
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


# Adding in any order lets the compiler use its vectors. Whole halves add up exactly; products to
# rounding, so robots that plan alike need machines alike.
@njit(cache=True, fastmath={"reassoc", "nnan", "nsz"})
@no_type_check
def _gain(
    newer: Float32[np.ndarray, "N"],
    older: Float32[np.ndarray, "N"],
    weight: Float32[np.ndarray, "N"],
) -> float:
    """The worth of raising T from one row to another, summed over subjects."""
    total = np.float32(0.0)
    for k in range(older.shape[0]):
        rise = max(newer[k] - older[k], np.float32(0.0))
        total += _weighed(rise, weight[k])
    return float(total)


@njit(cache=True, fastmath=False)  # said here, for it is the caller's otherwise
@no_type_check
def _weighed(rise: float, weight: float) -> float:
    """A squared rise times its weight, multiplied in this order, whatever that of the sum is."""
    return rise * (weight * rise)
