"""The window (III-B, Alg. 1; IV-C): how robots share what they know, over any channel.

A window has two slots. In Alg. 1 they hold a transmission phase and a response phase. In IV-C both
are broadcasts that nobody answers. Index order: `[b, i]` is robot `i` of mission `b`.

`window` and `broadcast` are the text to read, and play over any channel whose packets arrive in the
slot in which they were sent. `compiled_window` does the same in one compiled call, for the paper's
radio; `asynchronous_window` is for channels whose packets may arrive a slot late. `talk_over`, in
`protocol.talk`, chooses among the three when a swarm starts.
"""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers, merge, observe_self, record_attempt
from swarm_mj.protocol.checks import checked_decode
from swarm_mj.protocol.partial_buffers import entries_sent
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, slot_of
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel
from swarm_mj.system.compiled import compiled


class Phase(NamedTuple):
    """The recipients of one slot, and the senders decoded."""

    recipient: Int[np.ndarray, "B N"]  # S^i: whom i addressed, or BROADCAST; itself: it was silent
    heard: Int[np.ndarray, "B N"]  # i with j in R^i: whom robot j decoded; itself: nobody


@dataclass(frozen=True, kw_only=True)
class LocalViews:
    """The robots' knowledge, one view a robot: `[b, i]` in every array belongs to robot i alone.

    Identities are the index i, the team's size is N; both are granted before the mission (II-C).
    The buffers are live: they cannot be written, and change with the next window.

    Args:
        buffers: What every robot knows about every other; robot i's is row `[b, i]` of each array.
        now: t on the synchronised clock, [B], [windows].
        phases: Whom each robot addressed and heard, slot by slot: of this window, or else of the
            last. Before the first window it is empty.

    Example:
        A robot that asks the teammate whose news is the oldest:

        >>> views = Swarm(paper("stationary"), [1]).views
        >>> recipient = np.argmin(views.buffers.timestamp, axis=2)
    """

    buffers: Buffers
    now: Float[np.ndarray, "B"]
    phases: tuple[Phase, ...]

    def copy(self) -> "LocalViews":
        """Return the same for code that may write: new arrays, and the buffers, which none can."""
        return replace(self, now=self.now.copy(), phases=deepcopy(self.phases))

    @property
    def num_robots(self) -> int:
        """N, known to everyone before the mission (II-C)."""
        return self.buffers.timestamp.shape[1]

    @property
    def silence(self) -> Int[np.ndarray, "B N"]:
        """The recipients that mean silence: everyone addresses itself."""
        return _oneself(self.buffers.shape)

    @property
    def last_recipient(self) -> Int[np.ndarray, "B N"]:
        """The recipient of each robot in the last slot; itself: it was silent."""
        return self.phases[-1].recipient if self.phases else self.silence

    @property
    def last_heard(self) -> Int[np.ndarray, "B N"]:
        """The sender that each robot decoded in the last slot; itself: nobody."""
        return self.phases[-1].heard if self.phases else self.silence


@cache
def _oneself(shape: tuple[int, int]) -> Int[np.ndarray, "B N"]:
    """Return every robot's own identity."""
    return np.broadcast_to(np.arange(shape[1]), shape)


# Whom each robot addresses next, given the phases of this window so far.
Decide = Callable[[tuple[Phase, ...]], Int[np.ndarray, "B N"]]
Move = Callable[[], RobotStates]  # through one window; returns where the robots then are


def window(
    buffers: Buffers,
    decide: Decide,
    move: Move,
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
) -> tuple[Phase, Phase]:
    """Play one communication window: a transmission phase, then a response phase (Alg. 1).

    There is one difference: Alg. 1 evaluates the policy after the robots' self-observation; here
    it decides before the robots move, as in the authors' code.

    Args:
        buffers: The robots' buffers at t; they are written in place.
        decide: The policy, which is asked once: whom each robot addresses, from 0 to N - 1, or
            `BROADCAST`; itself is silence.
        move: Moves the robots once, and returns where they truly are, and what they observe of
            themselves; fixed meanwhile.
        channel: Who decodes whom. Its packets must arrive in the slot in which they were sent; for
            an `AsynchronousChannel` there is `asynchronous_window.window`.
        now: t when the window begins, [B], [windows].
        silence_is_attempt: Whether a silent robot notes having addressed itself.

    Returns:
        The transmission phase and the response phase.

    Raises:
        ValueError: If a user's own channel answers what is no robot, or a robot that is silent.
    """
    recipient = decide(())
    states = move()

    # Transmission phase.
    t = now + SLOT_WINDOWS
    observe_self(buffers, states, t)
    record_attempt(buffers, recipient, t, states.is_active, silence_is_attempt=silence_is_attempt)
    request = transmit(states.position_m, states.is_active, recipient, channel, t)
    merge(buffers, request.heard, entries_sent(buffers, request.recipient))

    # Response phase.
    t = t + SLOT_WINDOWS
    observe_self(buffers, states, t)
    response = transmit(states.position_m, states.is_active, respondents(request), channel, t)
    merge(buffers, response.heard, entries_sent(buffers, response.recipient))
    return request, response


def broadcast(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
) -> Phase:
    """Play a single slot, whose packets nobody answers (IV-C): a transmission phase alone.

    Args:
        buffers: The robots' buffers at t; they are written in place.
        states: Where the robots truly are, and what they observe of themselves; fixed meanwhile.
        recipient: Whom each robot addresses, [B N], from 0 to N - 1, or `BROADCAST`; itself is
            silence.
        channel: Who decodes whom. Its packets must arrive in the slot in which they were sent.
        now: t when the slot begins, [B], [windows].
        silence_is_attempt: Whether a silent robot notes having addressed itself.

    Returns:
        The slot's phase: its recipients, and the senders decoded.

    Raises:
        ValueError: If a user's own channel answers what is no robot, or a robot that is silent.
    """
    t = now + SLOT_WINDOWS
    observe_self(buffers, states, t)
    record_attempt(buffers, recipient, t, states.is_active, silence_is_attempt=silence_is_attempt)
    phase = transmit(states.position_m, states.is_active, recipient, channel, t)
    merge(buffers, phase.heard, entries_sent(buffers, phase.recipient))
    return phase


def transmit(
    position_m: Float[np.ndarray, "B N D"],
    is_active: Bool[np.ndarray, "B N"] | None,
    recipient: Int[np.ndarray, "B N"],
    channel: Channel | VaryingChannel,
    t: Float[np.ndarray, "B"],
    mission: Int[np.ndarray, "B"] | None = None,
) -> Phase:
    """Return what the channel makes of the packets of a slot.

    Inactive robots are silent, and decode nothing.

    Args:
        position_m: Where the robots truly are [m].
        is_active: Robots that have not failed; without it, all transmit.
        recipient: Whom each robot addresses; itself is silence.
        channel: Who decodes whom.
        t: When the slot ends [windows].
        mission: The mission of each row; without it, row b is of mission b.
    """
    sent_to = recipient.copy()
    silence(sent_to, is_active)
    heard = checked_decode(channel_at(channel, t, mission), position_m, sent_to)
    silence(heard, is_active)
    return Phase(recipient=sent_to, heard=heard)


def respondents(transmission: Phase) -> Int[np.ndarray, "B N"]:
    """Return whom each robot answers: the sender it decoded, if that packet was meant for it.

    Args:
        transmission: The recipients and the senders decoded in a window's first slot.

    Returns:
        Recipients of the response phase, [B N], from 0 to N - 1; itself is silence.
    """
    answered = np.empty_like(transmission.recipient)
    answer(transmission.recipient, transmission.heard, answered)
    return answered


@compiled()
def answer(
    recipient: Int[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
    answered: Int[np.ndarray, "B N"],
) -> None:
    """Fill in whom each robot answers: the sender it decoded, if that packet was meant for it."""
    for b in range(recipient.shape[0]):
        for j in range(recipient.shape[1]):
            i = heard[b, j]
            answered[b, j] = i if recipient[b, i] == j else j


@compiled()
def silence(robots: Int[np.ndarray, "B N"], is_active: Bool[np.ndarray, "B N"] | None) -> None:
    """Give inactive robots their own identities for their choices: silence, or no one."""
    if is_active is not None:
        for b in range(robots.shape[0]):
            for i in range(robots.shape[1]):
                if not is_active[b, i]:
                    robots[b, i] = i


def channel_at(
    channel: Channel | VaryingChannel,
    t: Float[np.ndarray, "B"],
    mission: Int[np.ndarray, "B"] | None = None,
) -> Channel:
    """Return the channel of one slot, row by row.

    Args:
        channel: Who decodes whom.
        t: When each row's slot ends, not when it begins, [B], [windows]: slot 0 ends at 0.5.
        mission: Each row's mission, [B]; None is all missions in order.
    """
    # The usual radio is asked for first: to ask for a runtime protocol takes 10 µs.
    if isinstance(channel, FreeSpaceRadio) or not isinstance(channel, VaryingChannel):
        return channel
    return channel.at(slot_of(t) - 1, np.arange(len(t)) if mission is None else mission)
