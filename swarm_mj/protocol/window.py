"""The window (III-B, Alg. 1; IV-C): how robots share what they know, over any channel (Eq. 6).

A window has two slots. In Alg. 1 they hold a transmission phase and a response phase. In IV-C both
are broadcasts that nobody answers. Index order: `[b, i]` is robot `i` of mission `b`.
"""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar, NamedTuple

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import BROADCAST, Buffers, merge, observe_self, record_attempt
from swarm_mj.protocol.checks import checked_decode
from swarm_mj.protocol.compiled_window import answer, silence, talk
from swarm_mj.protocol.packets import PartialBuffers, entries_sent
from swarm_mj.protocol.timestamps import SLOT_WINDOWS, SLOTS_PER_WINDOW
from swarm_mj.radio.asynchronous import AsynchronousChannel
from swarm_mj.radio.free_space import Channel, FreeSpaceRadio, VaryingChannel


class Phase(NamedTuple):
    """The recipients of one slot, and the senders decoded."""

    recipient: Int[np.ndarray, "B N"]  # S^i: whom i addressed, or BROADCAST; itself: it was silent
    heard: Int[np.ndarray, "B N"]  # i with j in R^i: whom robot j decoded; itself: nobody


@dataclass(frozen=True, kw_only=True)
class LocalViews:
    """The robots' knowledge, one view a robot: `[b, i]` in every array belongs to robot i alone.

    Identities are the index i, the team's size is N; both are granted before the mission (II-C).
    The buffers are live: they cannot be written, and change with the next window.
    """

    buffers: Buffers  # robot i's buffer is row [b, i]
    now: Float[np.ndarray, "B"]  # t on the synchronised clock [windows]
    phases: tuple[Phase, ...]  # of this window, or else the last: whom robot i addressed and heard

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


@cache
def _oneself(shape: tuple[int, int]) -> Int[np.ndarray, "B N"]:
    """Return every robot's own identity."""
    return np.broadcast_to(np.arange(shape[1]), shape)


# Whom each robot addresses next, given the phases of this window so far.
Decide = Callable[[tuple[Phase, ...]], Int[np.ndarray, "B N"]]
Move = Callable[[], RobotStates]  # through one window; returns where the robots then are


@dataclass(frozen=True, kw_only=True)
class RequestResponse:
    """A window of Alg. 1: robots that were addressed answer.

    There is one difference: Alg. 1 evaluates the policy after the robots' self-observation; here
    it decides before the robots move, as in the authors' code.
    """

    is_broadcast: ClassVar[bool] = False  # whether packets are for everyone who hears them
    silence_is_attempt: bool = False  # whether a silent robot notes having addressed itself (Eq. 7)

    def __call__(
        self,
        buffers: Buffers,
        decide: Decide,
        move: Move,
        channel: Channel | VaryingChannel,
        now: Float[np.ndarray, "B"],
    ) -> tuple[Phase, ...]:
        """Play one window from t on [windows], and return the phases of its two slots.

        Decisions are trusted; a user's own channel is checked (`checked_decode`).
        """
        noted = self.silence_is_attempt
        recipient = decide(())
        states = move()
        return window(buffers, states, recipient, channel, now, silence_is_attempt=noted)


@dataclass(frozen=True, kw_only=True)
class DoubleBroadcast:
    """A window of two broadcasts that nobody answers, each decided on what is known (IV-C).

    By the authors' half-duplex rule a robot that is addressed hears while it sends, so there a
    broadcast needs an addressee: the next identity, unless the policy names one.
    """

    is_broadcast: ClassVar[bool] = True
    silence_is_attempt: bool = False  # whether a silent robot notes having addressed itself (Eq. 7)
    needs_addressees: bool = False  # whether the half-duplex rule is the authors'
    moves_each_slot: bool = False  # whether robots move before the second broadcast too

    def __call__(
        self,
        buffers: Buffers,
        decide: Decide,
        move: Move,
        channel: Channel | VaryingChannel,
        now: Float[np.ndarray, "B"],
    ) -> tuple[Phase, ...]:
        """Play one window; arguments as in `RequestResponse`."""
        noted = self.silence_is_attempt
        recipient = self._addressed(decide(()))
        states = move()
        first = window(buffers, states, recipient, channel, now, 1, silence_is_attempt=noted)

        recipient = self._addressed(decide(first))
        if self.moves_each_slot:
            states = move()
        t = now + SLOT_WINDOWS
        return first + window(buffers, states, recipient, channel, t, 1, silence_is_attempt=noted)

    def _addressed(self, recipient: Int[np.ndarray, "B N"]) -> Int[np.ndarray, "B N"]:
        if not self.needs_addressees:
            return recipient
        next_identity = (np.arange(recipient.shape[1]) + 1) % recipient.shape[1]
        return np.where(recipient == BROADCAST, next_identity, recipient)


WindowProtocol = RequestResponse | DoubleBroadcast  # a policy chooses one


def window(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "B"],
    num_slots: int = 2,
    *,
    silence_is_attempt: bool = False,
) -> tuple[Phase, ...]:
    """Play one communication window: a transmission phase, then a response phase (Alg. 1).

    A single slot has no responses; there robots address a teammate or, with BROADCAST, everyone
    (III-B, IV-C). Buffers are written in place; `states` are true, and fixed meanwhile; the clock
    shows the start of the first slot [windows]. Silence may count as addressing oneself (Eq. 7).

    `compiled_window.talk` does the same in one call, where radio and packets are the paper's.
    """
    now = now + SLOT_WINDOWS
    if type(channel) is FreeSpaceRadio and not isinstance(buffers, PartialBuffers):
        said = talk(buffers, states, recipient, channel, now, num_slots, silence_is_attempt)
        return tuple([Phase(said[s, 0], said[s, 1]) for s in range(num_slots)])
    record_attempt(buffers, recipient, now, states.is_active, silence_is_attempt=silence_is_attempt)
    phases, answers = [], recipient.copy()
    for slot in range(num_slots):
        t, sent_to = now + slot * SLOT_WINDOWS, answers
        silence(sent_to, states.is_active)
        if not isinstance(channel, AsynchronousChannel):  # a user's channel may look at buffers
            observe_self(buffers, states, t)
        heard = checked_decode(channel_at(channel, t), states.position_m, sent_to)
        silence(heard, states.is_active)
        phases.append(punctual := Phase(recipient=sent_to, heard=heard))
        if isinstance(channel, AsynchronousChannel):  # late packets carry what was known before
            late, punctual = (Phase(*each) for each in channel.split(heard))
            merge(buffers, late.heard, entries_sent(buffers, late.recipient))
            observe_self(buffers, states, t)
        merge(buffers, punctual.heard, entries_sent(buffers, punctual.recipient))
        answers = respondents(punctual)
    return tuple(phases)


def respondents(transmission: Phase) -> Int[np.ndarray, "B N"]:
    """Return whom each robot answers: the sender it decoded, if that packet was meant for it."""
    answered = np.empty_like(transmission.recipient)
    answer(transmission.recipient, transmission.heard, answered)
    return answered


def channel_at(
    channel: Channel | VaryingChannel,
    now: Float[np.ndarray, "B"],
    mission: Int[np.ndarray, "B"] | None = None,
) -> Channel:
    """Return the channel of the slot that ends at t, row by row [windows].

    Rows are those of these missions; None is all missions in order.
    """
    # The usual radio is asked for first: to ask for a runtime protocol takes 10 µs.
    if isinstance(channel, FreeSpaceRadio) or not isinstance(channel, VaryingChannel):
        return channel
    slot = np.rint(now * SLOTS_PER_WINDOW).astype(np.int64) - 1
    return channel.at(slot, np.arange(len(now)) if mission is None else mission)
