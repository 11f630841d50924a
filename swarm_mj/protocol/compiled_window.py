"""A window in one compiled call, for the paper's radio and packets of whole buffers.

`protocol.window` is the text to read. This does the same, function by function, and is made of the
same loops, slot by slot (`compiled_slot`). A test holds it equal to the readable one in all arrays.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers
from swarm_mj.protocol.compiled_slot import (
    KnownArrays,
    RadioNumbers,
    TrueArrays,
    a_slot_after,
    merge,
    observe_self,
    record_attempt,
    transmit,
)
from swarm_mj.protocol.window import Decide, Move, Phase, answer
from swarm_mj.radio.free_space import FreeSpaceRadio
from swarm_mj.system.compiled import compiled


def window(
    buffers: Buffers,
    decide: Decide,
    move: Move,
    channel: FreeSpaceRadio,
    now: Float[np.ndarray, "B"],
    *,
    silence_is_attempt: bool = False,
) -> tuple[Phase, Phase]:
    """Play one window of requests and responses; arguments as in `protocol.window.window`."""
    recipient = decide(())
    states = move()
    request = Phase(recipient=_own_copy(recipient), heard=_unfilled(recipient))
    response = Phase(recipient=_unfilled(recipient), heard=_unfilled(recipient))
    _play(
        buffers=buffers,
        states=states,
        channel=channel,
        now=now,
        silence_is_attempt=silence_is_attempt,
        request=request,
        response=response,
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
    """Play a single slot, whose packets nobody answers; arguments as in `window.broadcast`."""
    phase = Phase(recipient=_own_copy(recipient), heard=_unfilled(recipient))
    _play(
        buffers=buffers,
        states=states,
        channel=channel,
        now=now,
        silence_is_attempt=silence_is_attempt,
        request=phase,
        response=None,
    )
    return phase


def _own_copy(recipient: Int[np.ndarray, "B N"]) -> Int[np.ndarray, "B N"]:
    """Return the recipients in the one type and layout that the loops are compiled for."""
    return np.array(recipient, dtype=np.int64, order="C")


def _unfilled(recipient: Int[np.ndarray, "B N"]) -> Int[np.ndarray, "B N"]:
    """Return an array of robots to be filled in."""
    return np.empty(recipient.shape, dtype=np.int64)


def _play(
    buffers: Buffers,
    states: RobotStates,
    channel: FreeSpaceRadio,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
    request: Phase,
    response: Phase | None,
) -> None:
    """Play a window, or without a response a slot of broadcasts, and fill in its phases."""
    # Flat, each array by its name: three named tuples with twelve arrays take 2.3 µs to pass into
    # compiled code, flat arrays 0.7 µs. Within compiled code named tuples cost nothing.
    _compiled_play(
        timestamp=buffers.timestamp,
        believed_m=buffers.position_m,
        believed_mps=buffers.velocity_mps,
        parent=buffers.parent,
        last_attempt=buffers.last_attempt,
        true_m=states.position_m,
        observed_m=states.own_m,
        observed_mps=states.velocity_mps,
        is_active=states.is_active,
        received_at_1_m_mw=channel.received_at_1_m_mw,
        noise_mw=channel.noise_mw,
        threshold=channel.threshold,
        hears_while_sending=channel.recipient_hears_while_sending,
        now=now,
        silence_is_attempt=silence_is_attempt,
        recipient=request.recipient,
        heard=request.heard,
        answered=None if response is None else response.recipient,
        heard_answer=None if response is None else response.heard,
    )


@compiled()
def _compiled_play(
    timestamp: Float[np.ndarray, "B N N"],
    believed_m: Float[np.ndarray, "B N N D"],
    believed_mps: Float[np.ndarray, "B N N D"],
    parent: Int[np.ndarray, "B N N"],
    last_attempt: Float[np.ndarray, "B N N"],
    true_m: Float[np.ndarray, "B N D"],
    observed_m: Float[np.ndarray, "B N D"],
    observed_mps: Float[np.ndarray, "B N D"],
    is_active: Bool[np.ndarray, "B N"] | None,
    received_at_1_m_mw: float,
    noise_mw: float,
    threshold: float,
    hears_while_sending: bool,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
    recipient: Int[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
    answered: Int[np.ndarray, "B N"] | None,
    heard_answer: Int[np.ndarray, "B N"] | None,
) -> None:
    """Pack what came in flat, and play with it."""
    known = KnownArrays(
        timestamp=timestamp,
        believed_m=believed_m,
        believed_mps=believed_mps,
        parent=parent,
        last_attempt=last_attempt,
    )
    truth = TrueArrays(
        true_m=true_m,
        observed_m=observed_m,
        observed_mps=observed_mps,
        is_active=is_active,
    )
    radio = RadioNumbers(
        received_at_1_m_mw=received_at_1_m_mw,
        noise_mw=noise_mw,
        threshold=threshold,
        hears_while_sending=hears_while_sending,
    )
    request = Phase(recipient=recipient, heard=heard)
    if answered is None or heard_answer is None:
        _broadcast(known, truth, radio, request, now, silence_is_attempt)
    else:
        response = Phase(recipient=answered, heard=heard_answer)
        _window(
            known=known,
            truth=truth,
            radio=radio,
            request=request,
            response=response,
            now=now,
            silence_is_attempt=silence_is_attempt,
        )


@compiled()
def _window(
    known: KnownArrays,
    truth: TrueArrays,
    radio: RadioNumbers,
    request: Phase,
    response: Phase,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
) -> None:
    """Play a transmission phase, then a response phase; both get what was heard."""
    # Transmission phase.
    t = a_slot_after(now)
    observe_self(known, truth, t)
    record_attempt(known, truth, request, t, silence_is_attempt)
    transmit(truth, radio, request)
    merge(known, request)

    # Response phase.
    t = a_slot_after(t)
    observe_self(known, truth, t)
    answer(request.recipient, request.heard, response.recipient)
    transmit(truth, radio, response)
    merge(known, response)


@compiled()
def _broadcast(
    known: KnownArrays,
    truth: TrueArrays,
    radio: RadioNumbers,
    phase: Phase,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
) -> None:
    """Play a single slot; its phase gets what was heard."""
    t = a_slot_after(now)
    observe_self(known, truth, t)
    record_attempt(known, truth, phase, t, silence_is_attempt)
    transmit(truth, radio, phase)
    merge(known, phase)
