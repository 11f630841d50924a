"""Greedy windows: the transmissions that together make the team's knowledge youngest.

The pair of sender and recipient is added that most raises the gain of the whole window,
interference and responses included, until none does. The gain is the sum over receivers i and
subjects k of the rise of T^{i,k}: the fall of the age of information times N² (Eq. 10).

Over uncertain links a packet decodes with a probability, and timestamps are expected ones. Index
order: `i` sends, `j` receives. Times are in slots, float32, which keeps them exact for 8 million
windows.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.protocol.timestamps import merge_expected, observe_own, rise
from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.radio.links import Links, air_of, listen
from swarm_mj.radio.reception import NOBODY
from swarm_mj.system.compiled import compiled


class _Slot(NamedTuple):
    """The packet that every receiver j may decode."""

    heard: Int[np.ndarray, "N"]  # its sender; j itself where there is none
    probability: Float[np.ndarray, "N"]  # that j decodes it


@compiled()
def greedy_window(
    timestamp: Float32[np.ndarray, "N N"], now: float, links: Links
) -> Int[np.ndarray, "N"]:
    """Return the recipient of every robot; itself is silence.

    Args:
        timestamp: T before the window [slots].
        now: t before the window [slots].
        links: The radio; the robots stand still.
    """
    num_robots = timestamp.shape[0]
    sent = timestamp.copy()
    observe_own(sent, now + 1.0)
    gains = packet_gains(sent, links)
    recipient = np.arange(num_robots)
    gain = 0.0
    while True:
        # A new pair changes the interference at all receivers, so every candidate is valued anew.
        value = window_gains(sent, gains, now, links, recipient)
        pair = np.argmax(value)
        i, r = pair // num_robots, pair % num_robots
        if value[i, r] <= gain:
            return recipient
        gain = value[i, r]
        recipient[i] = r


@compiled()
def window_gains(
    sent: Float32[np.ndarray, "N N"],
    gains: Float[np.ndarray, "N N"],
    now: float,
    links: Links,
    recipient: Int[np.ndarray, "N"],
) -> Float[np.ndarray, "N N"]:
    """Return the gain of the whole window when i also addresses r; -inf where it cannot.

    Neither robot of a new pair may send or be addressed already: a robot that sends hears nothing.
    Of all r that do not decode i, hence do not answer, one stands for all: a broadcast.

    Args:
        sent: T in the packets of the first slot [slots].
        gains: Of every packet, as `packet_gains` has them.
        now: t before the window [slots].
        links: The radio.
        recipient: Of every robot so far; itself is silence.
    """
    num_robots = sent.shape[0]
    is_silent = recipient == np.arange(num_robots)
    is_free = is_silent.copy()
    for i in range(num_robots):
        if not is_silent[i]:
            is_free[recipient[i]] = False
    air = air_of(links, ~is_silent)
    value = np.full((num_robots, num_robots), -np.inf)
    after = np.empty_like(sent)
    slot = _deaf_slot(num_robots)
    for i in range(num_robots):
        if is_free[i]:
            listen(links, air, i, is_silent, slot.heard, slot.probability)
            gain = 0.0
            for j in range(num_robots):
                gain += slot.probability[j] * gains[slot.heard[j], j]
            merge_expected(sent, slot.heard, slot.probability, after)
            observe_own(after, now + SLOTS_PER_WINDOW)
            _add_responses(links, i, recipient, is_free, slot, after, gain, value[i])
    return value


@compiled()
def _add_responses(
    links: Links,
    i: int,
    recipient: Int[np.ndarray, "N"],
    is_free: Bool[np.ndarray, "N"],
    slot: _Slot,
    after: Float32[np.ndarray, "N N"],
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
                    # A response is only sent if the request was decoded.
                    is_sent = slot_probability[heard[j]]
                    total += probability[j] * is_sent * _gain(after[heard[j]], after[j])
            value[r] = total


@compiled()
def _answers(slot: _Slot, recipient: Int[np.ndarray, "N"]) -> Bool[np.ndarray, "N"]:
    """Return who answers: robots that may decode a packet addressed to them."""
    answers = np.zeros(recipient.shape[0], dtype=np.bool_)
    for j in range(recipient.shape[0]):
        sender = slot.heard[j]
        answers[j] = sender != j and recipient[sender] == j
    return answers


@compiled()
def _deaf_slot(num_robots: int) -> _Slot:
    return _Slot(np.arange(num_robots), np.zeros(num_robots))


@compiled()
def packet_gains(sent: Float32[np.ndarray, "N N"], links: Links) -> Float[np.ndarray, "N N"]:
    """Return what j gains from i's packet [slots]; 0 where it is never received."""
    num_robots = sent.shape[0]
    gains = np.zeros((num_robots, num_robots))
    for i in range(num_robots):
        for j in range(num_robots):
            if links.received_mw[i, j] > 0.0:
                gains[i, j] = _gain(sent[i], sent[j])
    return gains


# Adding in any order lets the compiler use its vectors. Whole slots add up exactly; expected ones
# to rounding.
@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _gain(newer: Float32[np.ndarray, "N"], older: Float32[np.ndarray, "N"]) -> float:
    """Return the rise of T from one row to another, summed over subjects."""
    total = np.float32(0.0)
    for k in range(older.shape[0]):
        total += rise(newer[k], older[k])
    return float(total)
