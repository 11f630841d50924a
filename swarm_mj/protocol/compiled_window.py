"""A window in one compiled call, for the paper's radio and packets of whole buffers.

`protocol.window` is the text to read. This does the same, function by function, and is made of the
same loops; a test holds it equal to the readable one in every array. Arrays go into compiled code
flat and by name: named tuples of them take three times as long to pass.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers, merge_newer, write_attempt, write_own
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import Phase, answer, silence
from swarm_mj.radio.free_space import FreeSpaceRadio, decode_strongest
from swarm_mj.system.compiled import compiled


def window(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: FreeSpaceRadio,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
) -> tuple[Phase, Phase]:
    """Play one window of requests and responses; arguments as in `protocol.window.window`."""
    request = Phase(recipient=_own_copy(recipient), heard=_unfilled(recipient))
    response = Phase(recipient=_unfilled(recipient), heard=_unfilled(recipient))
    _window(
        timestamp=buffers.timestamp,
        believed_m=buffers.position_m,
        believed_mps=buffers.velocity_mps,
        parent=buffers.parent,
        last_attempt=buffers.last_attempt,
        position_m=states.position_m,
        own_m=states.own_m,
        velocity_mps=states.velocity_mps,
        is_active=states.is_active,
        now=now,
        silence_is_attempt=silence_is_attempt,
        received_at_1_m_mw=channel.received_at_1_m_mw,
        noise_mw=channel.noise_mw,
        threshold=channel.threshold,
        hears_while_sending=channel.recipient_hears_while_sending,
        requested=request.recipient,
        heard=request.heard,
        answered=response.recipient,
        heard_answer=response.heard,
    )
    return request, response


def broadcast(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    channel: FreeSpaceRadio,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
) -> Phase:
    """Play a single slot, whose packets nobody answers; arguments as in `window`."""
    phase = Phase(recipient=_own_copy(recipient), heard=_unfilled(recipient))
    _broadcast(
        timestamp=buffers.timestamp,
        believed_m=buffers.position_m,
        believed_mps=buffers.velocity_mps,
        parent=buffers.parent,
        last_attempt=buffers.last_attempt,
        position_m=states.position_m,
        own_m=states.own_m,
        velocity_mps=states.velocity_mps,
        is_active=states.is_active,
        now=now,
        silence_is_attempt=silence_is_attempt,
        received_at_1_m_mw=channel.received_at_1_m_mw,
        noise_mw=channel.noise_mw,
        threshold=channel.threshold,
        hears_while_sending=channel.recipient_hears_while_sending,
        recipient=phase.recipient,
        heard=phase.heard,
    )
    return phase


def _own_copy(recipient: Int[np.ndarray, "B N"]) -> Int[np.ndarray, "B N"]:
    """Return the recipients in the one type and layout that the loops are compiled for."""
    return np.array(recipient, dtype=np.int64, order="C")


def _unfilled(recipient: Int[np.ndarray, "B N"]) -> Int[np.ndarray, "B N"]:
    """Return an array of robots to be filled in."""
    return np.empty(recipient.shape, dtype=np.int64)


@compiled()
def _window(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N 2"],
    believed_mps: Float[np.ndarray, "B N N 2"],
    parent: Int[np.ndarray, "B N N"],
    last_attempt: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N 2"],
    own_m: Float[np.ndarray, "B N 2"],
    velocity_mps: Float[np.ndarray, "B N 2"],
    is_active: Bool[np.ndarray, "B N"] | None,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
    received_at_1_m_mw: float,
    noise_mw: float,
    threshold: float,
    hears_while_sending: bool,
    requested: Int[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
    answered: Int[np.ndarray, "B N"],
    heard_answer: Int[np.ndarray, "B N"],
) -> None:
    """Play a transmission phase and a response phase; fill in what was heard and answered."""
    t = _a_slot_after(now)
    write_attempt(last_attempt, requested, t, silence_is_attempt, is_active)
    _play_slot(
        timestamp=timestamp,
        believed_m=believed_m,
        believed_mps=believed_mps,
        parent=parent,
        position_m=position_m,
        own_m=own_m,
        velocity_mps=velocity_mps,
        is_active=is_active,
        t=t,
        received_at_1_m_mw=received_at_1_m_mw,
        noise_mw=noise_mw,
        threshold=threshold,
        hears_while_sending=hears_while_sending,
        recipient=requested,
        heard=heard,
    )
    answer(requested, heard, answered)
    _play_slot(
        timestamp=timestamp,
        believed_m=believed_m,
        believed_mps=believed_mps,
        parent=parent,
        position_m=position_m,
        own_m=own_m,
        velocity_mps=velocity_mps,
        is_active=is_active,
        t=_a_slot_after(t),
        received_at_1_m_mw=received_at_1_m_mw,
        noise_mw=noise_mw,
        threshold=threshold,
        hears_while_sending=hears_while_sending,
        recipient=answered,
        heard=heard_answer,
    )


@compiled()
def _broadcast(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N 2"],
    believed_mps: Float[np.ndarray, "B N N 2"],
    parent: Int[np.ndarray, "B N N"],
    last_attempt: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N 2"],
    own_m: Float[np.ndarray, "B N 2"],
    velocity_mps: Float[np.ndarray, "B N 2"],
    is_active: Bool[np.ndarray, "B N"] | None,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
    received_at_1_m_mw: float,
    noise_mw: float,
    threshold: float,
    hears_while_sending: bool,
    recipient: Int[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
) -> None:
    """Play a single slot; fill in what was heard."""
    t = _a_slot_after(now)
    write_attempt(last_attempt, recipient, t, silence_is_attempt, is_active)
    _play_slot(
        timestamp=timestamp,
        believed_m=believed_m,
        believed_mps=believed_mps,
        parent=parent,
        position_m=position_m,
        own_m=own_m,
        velocity_mps=velocity_mps,
        is_active=is_active,
        t=t,
        received_at_1_m_mw=received_at_1_m_mw,
        noise_mw=noise_mw,
        threshold=threshold,
        hears_while_sending=hears_while_sending,
        recipient=recipient,
        heard=heard,
    )


@compiled()
def _play_slot(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N 2"],
    believed_mps: Float[np.ndarray, "B N N 2"],
    parent: Int[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N 2"],
    own_m: Float[np.ndarray, "B N 2"],
    velocity_mps: Float[np.ndarray, "B N 2"],
    is_active: Bool[np.ndarray, "B N"] | None,
    t: Float[np.ndarray, "B"],
    received_at_1_m_mw: float,
    noise_mw: float,
    threshold: float,
    hears_while_sending: bool,
    recipient: Int[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
) -> None:
    """Let robots observe themselves, transmit and merge in the slot that ends at t."""
    write_own(timestamp, believed_m, believed_mps, own_m, velocity_mps, t, is_active)
    silence(recipient, is_active)
    sender = decode_strongest(
        position_m, recipient, received_at_1_m_mw, noise_mw, threshold, hears_while_sending
    )
    for b in range(sender.shape[0]):
        for j in range(sender.shape[1]):  # an array's assignment takes seconds to compile
            heard[b, j] = sender[b, j]
    silence(heard, is_active)
    merge_newer(
        sent=timestamp,
        heard=heard,
        timestamp=timestamp,
        position_m=believed_m,
        velocity_mps=believed_mps,
        parent=parent,
    )


@compiled()
def _a_slot_after(now: Float[np.ndarray, "B"]) -> Float[np.ndarray, "B"]:
    """Return when the slot ends that begins now [windows]."""
    t = np.empty_like(now)
    for b in range(now.shape[0]):
        t[b] = now[b] + SLOT_WINDOWS
    return t
