"""The protocol (III-B, Alg. 1): one communication window over any channel, f of Eq. 6.

Two phases of half a window each: a transmission and its responses, or, for flooding, two
transmissions that nobody answers (IV-C). Index order: `[b, i]` is robot `i` of mission `b`.
"""

from dataclasses import dataclass
from typing import no_type_check

import numpy as np
from jaxtyping import Bool, Float, Int
from numba import njit

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers, merge, observe_self, record_attempt
from swarm_mj.radio.free_space import Channel

SLOTS_PER_WINDOW = 2  # a transmission takes one, and so do its responses
SLOT_WINDOWS = 1.0 / SLOTS_PER_WINDOW  # Delta t: what a slot lasts [windows]
PHASE = SLOT_WINDOWS


@dataclass(frozen=True, kw_only=True)
class Phase:
    """Who addressed whom in half a window, and whose packet everyone decoded."""

    recipient: Int[np.ndarray, "B N"]  # S^i: whom each robot addressed; itself: it was silent
    heard: Int[np.ndarray, "B N"]  # i with j in R^i: whom robot j decoded; itself: nobody


def window(
    buffers: Buffers,
    bodies: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: Channel,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
    is_on: Bool[np.ndarray, "B N"] | None = None,
) -> tuple[Phase, Phase]:
    """One communication window: a transmission phase, then a response phase (Alg. 1).

    There is one difference: Alg. 1 evaluates the policy after the robots' self-observation; here
    `recipient` was decided at the end of the previous window, before the robots moved, as in the
    authors' code.

    Args:
        buffers: Written in place.
        bodies: True states, fixed during the window.
        recipient: Whom each robot addresses; itself is silence.
        channel: Who decodes whom (Eq. 6).
        now: t at the start of the window [windows].
        silence_is_attempt: Whether silence counts as addressing oneself (Eq. 7).
        is_on: Who takes part; the others neither send, decode nor observe. None is everyone.

    Returns:
        The transmission and the response phase.

    Raises:
        ValueError: A recipient, or a sender that the channel names, is no robot.
    """
    transmission = transmit(
        buffers,
        bodies,
        recipient,
        channel,
        now + PHASE,
        silence_is_attempt=silence_is_attempt,
        is_on=is_on,
    )

    observe_self(buffers, bodies.position_m, bodies.velocity_mps, now + 2 * PHASE, is_on)
    response = _send(buffers, bodies, respondents(transmission), channel, is_on)
    return transmission, response


def transmit(
    buffers: Buffers,
    bodies: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: Channel,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
    is_on: Bool[np.ndarray, "B N"] | None = None,
) -> Phase:
    """One transmission phase: the first half of Alg. 1, and each half of flooding's window.

    Args:
        buffers: Written in place.
        bodies: True states.
        recipient: Whom each robot addresses; itself is silence.
        channel: Who decodes whom (Eq. 6).
        now: t of this phase [windows].
        silence_is_attempt: Whether silence counts as addressing oneself (Eq. 7).
        is_on: Who takes part; the others neither send, decode nor observe. None is everyone.

    Returns:
        The phase.

    Raises:
        ValueError: A recipient, or a sender that the channel names, is no robot.
    """
    observe_self(buffers, bodies.position_m, bodies.velocity_mps, now, is_on)
    record_attempt(buffers, recipient, now, silence_is_attempt=silence_is_attempt, is_on=is_on)
    return _send(buffers, bodies, recipient, channel, is_on)


def respondents(transmission: Phase) -> Int[np.ndarray, "B N"]:
    """Whom each robot answers: the sender it decoded, if that packet was meant for it."""
    answered = np.empty_like(transmission.recipient)
    _answer_senders(transmission.recipient, transmission.heard, answered)
    return answered


def _send(
    buffers: Buffers,
    bodies: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: Channel,
    is_on: Bool[np.ndarray, "B N"] | None,
) -> Phase:
    """Everyone's packet through the channel and, decoded, into the buffers."""
    sent_to = _or_oneself(recipient, is_on)
    heard = _or_oneself(channel(bodies.position_m, sent_to), is_on)
    merge(buffers, heard)
    return Phase(recipient=sent_to.copy(), heard=heard)


def _or_oneself(
    robots: Int[np.ndarray, "B N"], is_on: Bool[np.ndarray, "B N"] | None
) -> Int[np.ndarray, "B N"]:
    """One robot per robot, and of those that are off themselves: silence, or nobody heard."""
    if is_on is None:
        return robots
    return np.where(is_on, robots, np.arange(is_on.shape[1], dtype=robots.dtype))


@njit(cache=True)
@no_type_check
def _answer_senders(
    recipient: Int[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
    answered: Int[np.ndarray, "B N"],
) -> None:
    num_missions, num_robots = recipient.shape
    for b in range(num_missions):
        for j in range(num_robots):
            i = heard[b, j]
            answered[b, j] = i if recipient[b, i] == j else j
