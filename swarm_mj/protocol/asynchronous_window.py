"""The window over asynchronous clocks (VI), where packets may arrive a slot late.

It is `protocol.window` but for two things. A packet holds what its sender knew when it began: a
late one was written before the slot in which it arrives, so it is merged before the robots observe
themselves in that slot. And it arrives when the responses are already on their way, so only
punctual packets are answered.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers, copied, merge, observe_self, record_attempt
from swarm_mj.protocol.partial_buffers import entries_sent
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import Decide, Move, Phase, respondents, transmit
from swarm_mj.radio.asynchronous import AsynchronousChannel


class _Slot(NamedTuple):
    """The packets of one slot, and of those the punctual ones."""

    phase: Phase  # all packets that it began with, and all that were decoded in it
    punctual: Phase  # of both, those of robots whose packets arrive in their own slot


@dataclass(kw_only=True)
class UnderWay:
    """The contents of packets that arrive in the next slot; each flight has its own."""

    # None: what their senders know. By the authors' half-duplex rule these may decode others
    # meanwhile, and then this is what they knew before.
    written: Buffers | None = None


def window(
    buffers: Buffers,
    decide: Decide,
    move: Move,
    channel: AsynchronousChannel,
    now: Float[np.ndarray, "B"],
    under_way: UnderWay,
    *,
    silence_is_attempt: bool = False,
) -> tuple[Phase, Phase]:
    """Play one window of requests and responses; arguments as in `protocol.window.window`.

    Slots must be played in order, and each of them once, with the same `under_way`.
    """
    recipient = decide(())
    states = move()
    t = now + SLOT_WINDOWS
    record_attempt(buffers, recipient, t, states.is_active, silence_is_attempt=silence_is_attempt)
    request = _play_slot(buffers, states, recipient, channel, t, under_way)
    answered = respondents(request.punctual)
    response = _play_slot(buffers, states, answered, channel, t + SLOT_WINDOWS, under_way)
    return request.phase, response.phase


def broadcast(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: AsynchronousChannel,
    now: Float[np.ndarray, "B"],
    under_way: UnderWay,
    *,
    silence_is_attempt: bool = False,
) -> Phase:
    """Play a single slot, whose packets nobody answers; arguments as in `window.broadcast`."""
    t = now + SLOT_WINDOWS
    record_attempt(buffers, recipient, t, states.is_active, silence_is_attempt=silence_is_attempt)
    return _play_slot(buffers, states, recipient, channel, t, under_way).phase


def _play_slot(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: AsynchronousChannel,
    t: Float[np.ndarray, "B"],
    under_way: UnderWay,
) -> _Slot:
    """Transmit in the slot that ends at t, and merge what arrives in it."""
    phase = transmit(states.position_m, states.is_active, recipient, channel, t)
    arrivals = channel.split(phase.heard)
    learned_too_late = arrivals.learned_too_late
    before = copied(buffers) if np.any(learned_too_late) else None

    _merge(buffers, arrivals.heard_late, arrivals.late, under_way.written)
    observe_self(buffers, states, t)
    if before is not None:
        observe_self(before, states, t)
    written = _written(buffers, before, learned_too_late)
    _merge(buffers, arrivals.heard_now, arrivals.punctual, written)

    # Once more: what came in before a late packet began is in it, punctual packets too.
    under_way.written = _written(buffers, before, learned_too_late)
    punctual = Phase(recipient=arrivals.punctual, heard=arrivals.heard_now)
    return _Slot(phase=phase, punctual=punctual)


def _merge(
    buffers: Buffers,
    heard: Int[np.ndarray, "B N"],
    recipient: Int[np.ndarray, "B N"],
    written: Buffers | None,
) -> None:
    """Merge packets that hold what was written, or else what their senders know."""
    sent = entries_sent(buffers if written is None else written, recipient)
    merge(buffers, heard, sent, written=written)


def _written(
    buffers: Buffers, before: Buffers | None, learned_too_late: Bool[np.ndarray, "B N"]
) -> Buffers | None:
    """Return what packets hold: of robots that learned too late, what they knew before."""
    if before is None:
        return None
    written = copied(buffers)
    written.timestamp[learned_too_late] = before.timestamp[learned_too_late]
    written.position_m[learned_too_late] = before.position_m[learned_too_late]
    written.velocity_mps[learned_too_late] = before.velocity_mps[learned_too_late]
    written.parent[learned_too_late] = before.parent[learned_too_late]
    return written
