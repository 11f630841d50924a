"""The two kinds of window that a policy chooses from: Alg. 1's, and two broadcasts (IV-C).

Each says when robots decide and move; how they talk meanwhile is the `Talk` that `talk_over` chose.
"""

from dataclasses import dataclass
from typing import ClassVar, NamedTuple, Protocol

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import BROADCAST, Buffers
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import Decide, Move, Phase


class PlayWindow(Protocol):
    """A way to play a window of Alg. 1 over a channel of its own; arguments as in `window`."""

    def __call__(
        self,
        buffers: Buffers,
        decide: Decide,
        move: Move,
        *,
        now: Float[np.ndarray, "B"],
        silence_is_attempt: bool,
    ) -> tuple[Phase, Phase]:
        """Return the transmission phase and the response phase."""
        ...


class PlayBroadcast(Protocol):
    """A way to play a slot of broadcasts over a channel of its own; arguments as in `broadcast`."""

    def __call__(
        self,
        buffers: Buffers,
        states: RobotStates,
        recipient: Int[np.ndarray, "B N"],
        *,
        now: Float[np.ndarray, "B"],
        silence_is_attempt: bool,
    ) -> Phase:
        """Return the slot's phase."""
        ...


class Talk(NamedTuple):
    """How robots talk over one channel: one implementation of windows, which `talk_over` chose."""

    window: PlayWindow
    broadcast: PlayBroadcast


@dataclass(frozen=True, kw_only=True)
class RequestResponse:
    """A window of Alg. 1: robots that were addressed answer."""

    is_broadcast: ClassVar[bool] = False  # whether packets are for everyone who hears them
    silence_is_attempt: bool = False  # whether a silent robot notes having addressed itself

    def __call__(
        self,
        buffers: Buffers,
        decide: Decide,
        move: Move,
        talk: Talk,
        now: Float[np.ndarray, "B"],
    ) -> tuple[Phase, ...]:
        """Play one window from t on [windows], and return the phases of its two slots.

        Decisions are trusted; a user's own channel is checked (`checked_decode`).
        """
        return talk.window(
            buffers, decide, move, now=now, silence_is_attempt=self.silence_is_attempt
        )


@dataclass(frozen=True, kw_only=True)
class DoubleBroadcast:
    """A window of two broadcasts that nobody answers, each decided on what is known (IV-C).

    By the authors' half-duplex rule a robot that is addressed hears while it sends, so there a
    broadcast needs an addressee: the next identity, unless the policy names one.
    """

    is_broadcast: ClassVar[bool] = True
    silence_is_attempt: bool = False  # whether a silent robot notes having addressed itself
    needs_addressees: bool = False  # whether the half-duplex rule is the authors'
    moves_each_slot: bool = False  # whether robots move before the second broadcast too

    def __call__(
        self,
        buffers: Buffers,
        decide: Decide,
        move: Move,
        talk: Talk,
        now: Float[np.ndarray, "B"],
    ) -> tuple[Phase, ...]:
        """Play one window; arguments as in `RequestResponse`."""
        recipient = self._addressed(decide(()))
        states = move()
        first = talk.broadcast(
            buffers, states, recipient, now=now, silence_is_attempt=self.silence_is_attempt
        )

        recipient = self._addressed(decide((first,)))
        if self.moves_each_slot:
            states = move()
        t = now + SLOT_WINDOWS
        second = talk.broadcast(
            buffers, states, recipient, now=t, silence_is_attempt=self.silence_is_attempt
        )
        return first, second

    def _addressed(self, recipient: Int[np.ndarray, "B N"]) -> Int[np.ndarray, "B N"]:
        """Return the recipients, or addressees where a broadcast needs one."""
        if not self.needs_addressees:
            return recipient
        next_identity = (np.arange(recipient.shape[1]) + 1) % recipient.shape[1]
        return np.where(recipient == BROADCAST, next_identity, recipient)


WindowProtocol = RequestResponse | DoubleBroadcast  # a policy chooses one
