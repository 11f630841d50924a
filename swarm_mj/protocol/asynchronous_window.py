"""The window over asynchronous clocks (VI), where packets may arrive a slot late.

It is `protocol.window` but for two things. A late packet was written before the slot in which it
arrives, so it is merged before the robots observe themselves in that slot. And it arrives when the
responses are already on their way, so only punctual packets are answered.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers, merge, observe_self, record_attempt
from swarm_mj.protocol.partial_buffers import entries_sent
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import Decide, Move, Phase, respondents, transmit
from swarm_mj.radio.asynchronous import AsynchronousChannel


class _Slot(NamedTuple):
    """The packets of one slot, and of those the punctual ones."""

    phase: Phase  # all packets that it began with, and all that were decoded in it
    punctual: Phase  # of both, those of robots whose packets arrive in their own slot


def window(
    buffers: Buffers,
    decide: Decide,
    move: Move,
    channel: AsynchronousChannel,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
) -> tuple[Phase, Phase]:
    """Play one window of requests and responses; arguments as in `protocol.window.window`.

    Slots must be played in order, and each of them once.
    """
    recipient = decide(())
    states = move()
    t = now + SLOT_WINDOWS
    record_attempt(buffers, recipient, t, states.is_active, silence_is_attempt=silence_is_attempt)
    request = _play_slot(buffers, states, recipient, channel, t)
    answered = respondents(request.punctual)
    response = _play_slot(buffers, states, answered, channel, t + SLOT_WINDOWS)
    return request.phase, response.phase


def broadcast(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: AsynchronousChannel,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
) -> Phase:
    """Play a single slot, whose packets nobody answers; arguments as in `window.broadcast`."""
    t = now + SLOT_WINDOWS
    record_attempt(buffers, recipient, t, states.is_active, silence_is_attempt=silence_is_attempt)
    return _play_slot(buffers, states, recipient, channel, t).phase


def _play_slot(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: AsynchronousChannel,
    t: Float[np.ndarray, "B"],
) -> _Slot:
    """Transmit in the slot that ends at t, and merge what arrives in it."""
    phase = transmit(states, recipient, channel, t)
    arrivals = channel.split(phase.heard)
    merge(buffers, arrivals.heard_late, entries_sent(buffers, arrivals.late))
    observe_self(buffers, states, t)
    merge(buffers, arrivals.heard_now, entries_sent(buffers, arrivals.punctual))
    punctual = Phase(recipient=arrivals.punctual, heard=arrivals.heard_now)
    return _Slot(phase=phase, punctual=punctual)
