"""Greedy schedules: the transmissions of a window that together make the team's knowledge youngest.

Window by window, the pair of sender and recipient is added that most raises what the whole window
gains, interference and responses included, until none does. The gain of a window is the sum over
receivers i and subjects k of how much T^{i,k} rises: the fall of the age of information times N²
(Eq. 10). Squared rises look further ahead: they prefer what is stalest to many small refreshments.

Where positions are only believed, a packet decodes with a probability, and timestamps are expected
ones. Index order: `i` sends, `j` receives. Times are in halves of a window, float32, which keeps
them exact for 8 million windows. All kernels are in this one file, because numba's cache does not
see changes in another.
"""

import math
from typing import NamedTuple, no_type_check

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numba import njit

from swarm_mj.radio.links import Links

HALVES = 2  # of a window: the unit of time in here
LOGISTIC = 1.702  # 1 / (1 + exp(-1.702 z)) is within 0.01 of the normal distribution function
CERTAIN = 2.5  # standard deviations beyond which a packet decodes for certain, or never
NOBODY = -1
NO_PAIR = (NOBODY, NOBODY)
NOT_A_PAIR = -1.0  # in place of a gain, which is never negative


class _Air(NamedTuple):
    """What is in the air at every receiver j."""

    total_mw: Float[np.ndarray, "N"]
    strongest_mw: Float[np.ndarray, "N"]
    strongest: Int[np.ndarray, "N"]  # who is received with that power


class _Phase(NamedTuple):
    """What every receiver j decodes."""

    heard: Int[np.ndarray, "N"]  # whom; itself is nobody
    chance: Float[np.ndarray, "N"]  # with which probability


@njit(cache=True)
@no_type_check
def schedule(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    is_squared: bool,
    first_pair: tuple[int, int],
    first_gain: float,
    recipient: Int[np.ndarray, "W N"],
) -> float:
    """Fills `recipient` window by window, and brings `timestamp` to the end of the last.

    Args:
        timestamp: T, written in place [halves].
        now: t before the first window [halves].
        links: The radio; the robots stand still.
        is_squared: Whether rises of T count squared.
        first_pair: Who sends to whom in the first window whatever else happens, or `NO_PAIR`.
        first_gain: What that pair gains.
        recipient: Whom each robot addresses; itself is silence.

    Returns:
        The sum of all timestamps after each window, over all windows [halves].
    """
    known = 0.0
    for w in range(recipient.shape[0]):
        if w == 0:
            _complete(timestamp, now, links, is_squared, first_pair, first_gain, recipient[w])
        else:
            _complete(timestamp, now, links, is_squared, NO_PAIR, 0.0, recipient[w])
        _advance(timestamp, now, links, recipient[w])
        known += float(timestamp.sum())
        now += HALVES
    return known


@njit(cache=True)
@no_type_check
def first_pairs(
    timestamp: Float32[np.ndarray, "N N"], now: float, links: Links, is_squared: bool
) -> Float[np.ndarray, "N N"]:
    """What a window gains when i alone sends, to r; `NOT_A_PAIR` where it cannot."""
    sent = _with_own_time(timestamp, now + 1.0)
    worth = _pair_gains(sent, links, is_squared)
    silence = np.arange(timestamp.shape[0])
    return _value_pairs(sent, worth, now, links, is_squared, silence)


@njit(cache=True)
@no_type_check
def _complete(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    is_squared: bool,
    first_pair: tuple[int, int],
    first_gain: float,
    recipient: Int[np.ndarray, "N"],
) -> None:
    """Fills `recipient`: a first pair, if there is one, and then pairs while the gain rises."""
    num_robots = timestamp.shape[0]
    for j in range(num_robots):
        recipient[j] = j
    sent = _with_own_time(timestamp, now + 1.0)
    worth = _pair_gains(sent, links, is_squared)
    gain = first_gain
    if first_pair[0] != NOBODY:
        recipient[first_pair[0]] = first_pair[1]
    while True:
        value = _value_pairs(sent, worth, now, links, is_squared, recipient)
        pair = np.argmax(value)
        i, r = pair // num_robots, pair % num_robots
        if value[i, r] <= gain:
            return
        gain = value[i, r]
        recipient[i] = r


@njit(cache=True)
@no_type_check
def _value_pairs(
    sent: Float32[np.ndarray, "N N"],
    worth: Float[np.ndarray, "N N"],
    now: float,
    links: Links,
    is_squared: bool,
    recipient: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "N N"]:
    """What the whole window gains when i also addresses r; `NOT_A_PAIR` where it cannot.

    Neither of a new pair may send or be addressed already: a robot that sends hears nothing. Of
    all r that do not decode i, hence do not answer, one stands for all: a broadcast.
    """
    num_robots = sent.shape[0]
    is_silent = recipient == np.arange(num_robots)
    is_free = is_silent.copy()
    air = _silent_air(num_robots)
    for i in np.flatnonzero(~is_silent):
        is_free[recipient[i]] = False
        _transmit(links, air, i)
    value = np.full((num_robots, num_robots), NOT_A_PAIR)
    after = np.empty_like(sent)
    phase = _deaf_phase(num_robots)
    for i in range(num_robots):
        if is_free[i]:
            _listen(links, air, i, is_silent, phase)
            gain = 0.0
            for j in range(num_robots):
                gain += phase.chance[j] * worth[phase.heard[j], j]
            _merge(sent, phase, now, after)
            _value_responses(links, i, recipient, is_free, phase, after, is_squared, gain, value[i])
    return value


@njit(cache=True)
@no_type_check
def _value_responses(
    links: Links,
    i: int,
    recipient: Int[np.ndarray, "N"],
    is_free: Bool[np.ndarray, "N"],
    phase: _Phase,
    after: Float32[np.ndarray, "N N"],
    is_squared: bool,
    gain: float,
    value: Float[np.ndarray, "N"],
) -> None:
    """Fills `value[r]`: the gain of the first phase and of the responses if r is i's recipient."""
    answers, air = _answer(links, phase, recipient)
    listens = ~answers
    response = _deaf_phase(recipient.shape[0])
    heard, chance, phase_chance = response.heard, response.chance, phase.chance
    has_broadcast = False
    for r in range(recipient.shape[0]):
        decodes = phase.heard[r] == i
        if r != i and is_free[r] and (decodes or not has_broadcast):
            has_broadcast |= not decodes
            _listen(links, air, r if decodes else NOBODY, listens, response)
            total = gain
            for j in range(recipient.shape[0]):
                if chance[j] > 0.0:
                    is_sent = phase_chance[heard[j]]
                    total += chance[j] * is_sent * _gain(after[heard[j]], after[j], is_squared)
            value[r] = total


@njit(cache=True)
@no_type_check
def _answer(
    links: Links, phase: _Phase, recipient: Int[np.ndarray, "N"]
) -> tuple[Bool[np.ndarray, "N"], _Air]:
    """Who answers whom it decoded, being addressed, and what is in the air then."""
    num_robots = recipient.shape[0]
    air = _silent_air(num_robots)
    answers = np.zeros(num_robots, dtype=np.bool_)
    for j in range(num_robots):
        sender = phase.heard[j]
        if sender != j and recipient[sender] == j:
            answers[j] = True
            _transmit(links, air, j)
    return answers, air


@njit(cache=True)
@no_type_check
def _advance(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    recipient: Int[np.ndarray, "N"],
) -> None:
    """Brings T through a window of Alg. 1, as far as it can be expected."""
    num_robots = timestamp.shape[0]
    is_silent = recipient == np.arange(num_robots)
    air = _silent_air(num_robots)
    for i in np.flatnonzero(~is_silent):
        _transmit(links, air, i)
    phase = _deaf_phase(num_robots)
    _listen(links, air, NOBODY, is_silent, phase)
    after = np.empty_like(timestamp)
    _merge(_with_own_time(timestamp, now + 1.0), phase, now, after)
    answers, air = _answer(links, phase, recipient)
    response = _deaf_phase(num_robots)
    _listen(links, air, NOBODY, ~answers, response)
    for j in range(num_robots):
        response.chance[j] *= phase.chance[response.heard[j]]
    _merge(after, response, now, timestamp)


@njit(cache=True)
@no_type_check
def _with_own_time(timestamp: Float32[np.ndarray, "N N"], now: float) -> Float32[np.ndarray, "N N"]:
    """T when everyone has just observed itself (Eq. 5) at this time."""
    observed = timestamp.copy()
    for i in range(timestamp.shape[0]):
        observed[i, i] = now
    return observed


@njit(cache=True)
@no_type_check
def _silent_air(num_robots: int) -> _Air:
    return _Air(np.zeros(num_robots), np.zeros(num_robots), np.zeros(num_robots, dtype=np.int64))


@njit(cache=True)
@no_type_check
def _deaf_phase(num_robots: int) -> _Phase:
    return _Phase(np.arange(num_robots), np.zeros(num_robots))


@njit(cache=True)
@no_type_check
def _transmit(links: Links, air: _Air, i: int) -> None:
    """Adds i's packet to the air."""
    for j in range(air.total_mw.shape[0]):
        received_mw = links.received_mw[i, j]
        air.total_mw[j] += received_mw
        if received_mw > air.strongest_mw[j]:
            air.strongest_mw[j] = received_mw
            air.strongest[j] = i


@njit(cache=True)
@no_type_check
def _listen(
    links: Links, air: _Air, also: int, is_silent: Bool[np.ndarray, "N"], phase: _Phase
) -> None:
    """Fills `phase` with what the silent robots decode, when `also` sends too, or `NOBODY`."""
    num_robots = is_silent.shape[0]
    heard, chance = phase.heard, phase.chance
    received_mw, distance_over_std = links.received_mw, links.distance_over_std
    total_mw, strongest_mw, strongest = air.total_mw, air.strongest_mw, air.strongest
    for j in range(num_robots):
        heard[j], chance[j] = j, 0.0
        if is_silent[j] and j != also:
            # A robot adds nothing to the air at itself, so it stands for nobody.
            added_mw = received_mw[j if also == NOBODY else also, j]
            is_stronger = added_mw > strongest_mw[j]
            signal_mw = added_mw if is_stronger else strongest_mw[j]
            sender = also if is_stronger else strongest[j]
            if signal_mw > 0.0:
                chance[j] = _chance(
                    signal_mw,
                    total_mw[j] + added_mw,
                    links.noise_mw,
                    links.threshold,
                    distance_over_std[sender, j],
                )
                heard[j] = sender if chance[j] > 0.0 else j


@njit(cache=True)
@no_type_check
def _chance(
    strongest_mw: float,
    total_mw: float,
    noise_mw: float,
    threshold: float,
    distance_over_std: float,
) -> float:
    """How probably the strongest packet at a receiver decodes (Eqs. 3-4).

    A lone packet decodes up to some distance; interference shortens it to d sqrt(SINR /
    threshold), so a packet over a believed d comes through if the true distance is below that.
    """
    ratio = strongest_mw / (noise_mw + (total_mw - strongest_mw)) / threshold
    if distance_over_std == np.inf:
        return 1.0 if ratio >= 1.0 else 0.0
    deviations = (math.sqrt(ratio) - 1.0) * distance_over_std
    if abs(deviations) > CERTAIN:
        return 1.0 if deviations > 0.0 else 0.0
    return 1.0 / (1.0 + math.exp(-LOGISTIC * deviations))


@njit(cache=True, fastmath={"nnan", "nsz"})
@no_type_check
def _merge(
    sent: Float32[np.ndarray, "N N"],
    phase: _Phase,
    now: float,
    merged: Float32[np.ndarray, "N N"],
) -> None:
    """Fills `merged`: T as expected after a phase (Eq. 8), own timestamps those of its end."""
    num_robots = sent.shape[0]
    for j in range(num_robots):
        chance = np.float32(phase.chance[j])
        own, other, row = sent[j], sent[phase.heard[j]], merged[j]
        for k in range(num_robots):
            row[k] = own[k] + chance * max(other[k] - own[k], np.float32(0.0))
        merged[j, j] = now + HALVES


@njit(cache=True)
@no_type_check
def _pair_gains(
    sent: Float32[np.ndarray, "N N"], links: Links, is_squared: bool
) -> Float[np.ndarray, "N N"]:
    """What j gains from i's packet; 0 where it is never received."""
    num_robots = sent.shape[0]
    gains = np.zeros((num_robots, num_robots))
    for i in range(num_robots):
        for j in range(num_robots):
            if links.received_mw[i, j] > 0.0:
                gains[i, j] = _gain(sent[i], sent[j], is_squared)
    return gains


# Adding in any order lets the compiler use its vectors. Whole halves add up exactly; squares and
# expected halves to rounding, so robots that plan alike need machines alike.
@njit(cache=True, fastmath={"reassoc", "nnan", "nsz"})
@no_type_check
def _gain(
    newer: Float32[np.ndarray, "N"], older: Float32[np.ndarray, "N"], is_squared: bool
) -> float:
    """The rise of T from one row to another, summed over subjects."""
    total = np.float32(0.0)
    if is_squared:
        for k in range(older.shape[0]):
            rise = max(newer[k] - older[k], np.float32(0.0))
            total += rise * rise
    else:
        for k in range(older.shape[0]):
            total += max(newer[k] - older[k], np.float32(0.0))
    return float(total)
