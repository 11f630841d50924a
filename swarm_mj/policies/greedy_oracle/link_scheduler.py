"""Greedy schedules: the transmissions of a window that together make the team's knowledge youngest.

Window by window, the pair of sender and recipient is added that most raises what the whole window
gains, interference and responses included, until none does. The gain of a window is the sum over
receivers i and subjects k of how much T^{i,k} rises: the fall of the age of information times N²
(Eq. 10). Squared rises look further ahead: they prefer what is stalest to many small refreshments.

Over uncertain links a packet decodes with a probability, and timestamps are expected ones. Index
order: `i` sends, `j` receives. Times are in slots, float32, which keeps them exact for 8 million
windows.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.protocol.timestamps import merge_expected, observe_own, rise
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.links import NOBODY, Links, air_of, listen
from swarm_mj.system.compiled import compiled

NO_PAIR = (NOBODY, NOBODY)
NOT_A_PAIR = -1.0  # in place of a gain, which is never negative


class _Slot(NamedTuple):
    """What every receiver j decodes."""

    heard: Int[np.ndarray, "N"]  # whom; itself is nobody
    probability: Float[np.ndarray, "N"]  # with which probability


@compiled()
def schedule(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    is_squared: bool,
    first_pair: tuple[int, int],
    first_gain: float,
    recipient: Int[np.ndarray, "W N"],
) -> float:
    """Fill `recipient` window by window, and brings `timestamp` to the end of the last.

    Args:
        timestamp: T, written in place [slots].
        now: t before the first window [slots].
        links: The radio; the robots stand still.
        is_squared: Whether rises of T count squared.
        first_pair: Who sends to whom in the first window whatever else happens, or `NO_PAIR`.
        first_gain: What that pair gains.
        recipient: Whom each robot addresses; itself is silence.

    Returns:
        The sum of all timestamps after each window, over all windows [slots].
    """
    known = 0.0
    for w in range(recipient.shape[0]):
        if w == 0:
            _complete(timestamp, now, links, is_squared, first_pair, first_gain, recipient[w])
        else:
            _complete(timestamp, now, links, is_squared, NO_PAIR, 0.0, recipient[w])
        _advance(timestamp, now, links, recipient[w])
        known += float(timestamp.sum())
        now += SLOTS_PER_WINDOW
    return known


@compiled()
def first_pairs(
    timestamp: Float32[np.ndarray, "N N"], now: float, links: Links, is_squared: bool
) -> Float[np.ndarray, "N N"]:
    """What a window gains when i alone sends, to r; `NOT_A_PAIR` where it cannot."""
    sent = _with_own_time(timestamp, now + 1.0)
    worth = _pair_gains(sent, links, is_squared)
    silence = np.arange(timestamp.shape[0])
    return _value_pairs(sent, worth, now, links, is_squared, silence)


@compiled()
def _complete(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    is_squared: bool,
    first_pair: tuple[int, int],
    first_gain: float,
    recipient: Int[np.ndarray, "N"],
) -> None:
    """Fill `recipient`: a first pair, if there is one, and then pairs while the gain rises."""
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


@compiled()
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
    for i in range(num_robots):
        if not is_silent[i]:
            is_free[recipient[i]] = False
    air = air_of(links, ~is_silent)
    value = np.full((num_robots, num_robots), NOT_A_PAIR)
    after = np.empty_like(sent)
    slot = _deaf_slot(num_robots)
    for i in range(num_robots):
        if is_free[i]:
            listen(links, air, i, is_silent, slot.heard, slot.probability)
            gain = 0.0
            for j in range(num_robots):
                gain += slot.probability[j] * worth[slot.heard[j], j]
            _advance_slot(sent, slot, now, after)
            _value_responses(links, i, recipient, is_free, slot, after, is_squared, gain, value[i])
    return value


@compiled()
def _value_responses(
    links: Links,
    i: int,
    recipient: Int[np.ndarray, "N"],
    is_free: Bool[np.ndarray, "N"],
    slot: _Slot,
    after: Float32[np.ndarray, "N N"],
    is_squared: bool,
    gain: float,
    value: Float[np.ndarray, "N"],
) -> None:
    """Fill `value[r]`: the gain of the first slot and of the responses if r is i's recipient."""
    answers = _answers(slot, recipient)
    air, listens = air_of(links, answers), ~answers
    response = _deaf_slot(recipient.shape[0])
    heard, probability, slot_probability = response.heard, response.probability, slot.probability
    has_broadcast = False
    for r in range(recipient.shape[0]):
        decodes = slot.heard[r] == i
        if r != i and is_free[r] and (decodes or not has_broadcast):
            has_broadcast |= not decodes
            answerer = r if decodes else NOBODY
            listen(links, air, answerer, listens, heard, probability)
            total = gain
            for j in range(recipient.shape[0]):
                if probability[j] > 0.0:
                    is_sent = slot_probability[heard[j]]
                    total += probability[j] * is_sent * _gain(after[heard[j]], after[j], is_squared)
            value[r] = total


@compiled()
def _answers(slot: _Slot, recipient: Int[np.ndarray, "N"]) -> Bool[np.ndarray, "N"]:
    """Who answers: whoever may decode a packet that is meant for it."""
    answers = np.zeros(recipient.shape[0], dtype=np.bool_)
    for j in range(recipient.shape[0]):
        sender = slot.heard[j]
        answers[j] = sender != j and recipient[sender] == j
    return answers


@compiled()
def _advance(
    timestamp: Float32[np.ndarray, "N N"],
    now: float,
    links: Links,
    recipient: Int[np.ndarray, "N"],
) -> None:
    """Brings T through a window of Alg. 1, as far as it can be expected."""
    num_robots = timestamp.shape[0]
    is_silent = recipient == np.arange(num_robots)
    slot = _deaf_slot(num_robots)
    air = air_of(links, ~is_silent)
    listen(links, air, NOBODY, is_silent, slot.heard, slot.probability)
    after = np.empty_like(timestamp)
    _advance_slot(_with_own_time(timestamp, now + 1.0), slot, now, after)
    answers = _answers(slot, recipient)
    response = _deaf_slot(num_robots)
    air = air_of(links, answers)
    listen(links, air, NOBODY, ~answers, response.heard, response.probability)
    for j in range(num_robots):
        response.probability[j] *= slot.probability[response.heard[j]]
    _advance_slot(after, response, now, timestamp)


@compiled()
def _with_own_time(timestamp: Float32[np.ndarray, "N N"], now: float) -> Float32[np.ndarray, "N N"]:
    """T when everyone has just observed itself (Eq. 5) at this time."""
    observed = timestamp.copy()
    observe_own(observed, now)
    return observed


@compiled()
def _advance_slot(
    sent: Float32[np.ndarray, "N N"], slot: _Slot, now: float, after: Float32[np.ndarray, "N N"]
) -> None:
    """Fill `after`: T as expected after a slot, own timestamps those of the window's end."""
    merge_expected(sent, slot.heard, slot.probability, after)
    observe_own(after, now + SLOTS_PER_WINDOW)


@compiled()
def _deaf_slot(num_robots: int) -> _Slot:
    return _Slot(np.arange(num_robots), np.zeros(num_robots))


@compiled()
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


# Adding in any order lets the compiler use its vectors. Whole slots add up exactly; squares and
# expected ones to rounding.
@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _gain(
    newer: Float32[np.ndarray, "N"], older: Float32[np.ndarray, "N"], is_squared: bool
) -> float:
    """Return the rise of T from one row to another, summed over subjects."""
    total = np.float32(0.0)
    if is_squared:
        for k in range(older.shape[0]):
            total += rise(newer[k], older[k]) ** 2
    else:
        for k in range(older.shape[0]):
            total += rise(newer[k], older[k])
    return float(total)
