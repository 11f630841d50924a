"""A window in one compiled call, for the paper's radio and packets of whole buffers.

`protocol.window` is the text to read. This does the same, function by function, and is made of the
same loops; a test holds it equal to the readable one in every array. Three kinds of positions meet
here: where a robot truly is, which the radio goes by; where it observes itself to be; and where
others believe it to be.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers, merge_newer, write_attempt, write_own
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import Decide, Move, Phase, answer, silence
from swarm_mj.radio.free_space import FreeSpaceRadio, decode_strongest
from swarm_mj.system.compiled import compiled


class _Known(NamedTuple):
    """The arrays of `Buffers` that a window writes: all that robots know of each other."""

    timestamp: Float[np.ndarray, "B N N"]  # T^{i,j} [windows]
    believed_m: Float[np.ndarray, "B N N 2"]  # of M^{i,j}: the buffers' `position_m`
    believed_mps: Float[np.ndarray, "B N N 2"]  # of M^{i,j}: the buffers' `velocity_mps`
    parent: Int[np.ndarray, "B N N"]  # P^{i,j}
    last_attempt: Float[np.ndarray, "B N N"]  # L^{i,j} [windows]


class _Truth(NamedTuple):
    """The robots as they are: the arrays of `RobotStates`."""

    true_m: Float[np.ndarray, "B N 2"]
    observed_m: Float[np.ndarray, "B N 2"]  # its own place, as each robot observes it
    observed_mps: Float[np.ndarray, "B N 2"]  # its own velocity, which it observes without error
    is_active: Bool[np.ndarray, "B N"] | None  # None is compiled apart, as all of them


class _Radio(NamedTuple):
    """The numbers of `FreeSpaceRadio`."""

    received_at_1_m_mw: float
    noise_mw: float
    threshold: float  # linear [1]
    hears_while_sending: bool


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
    believed_m: Float[np.ndarray, "B N N 2"],
    believed_mps: Float[np.ndarray, "B N N 2"],
    parent: Int[np.ndarray, "B N N"],
    last_attempt: Float[np.ndarray, "B N N"],
    true_m: Float[np.ndarray, "B N 2"],
    observed_m: Float[np.ndarray, "B N 2"],
    observed_mps: Float[np.ndarray, "B N 2"],
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
    known = _Known(
        timestamp=timestamp,
        believed_m=believed_m,
        believed_mps=believed_mps,
        parent=parent,
        last_attempt=last_attempt,
    )
    truth = _Truth(
        true_m=true_m,
        observed_m=observed_m,
        observed_mps=observed_mps,
        is_active=is_active,
    )
    radio = _Radio(
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
    known: _Known,
    truth: _Truth,
    radio: _Radio,
    request: Phase,
    response: Phase,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
) -> None:
    """Play a transmission phase, then a response phase; both get what was heard."""
    # Transmission phase.
    t = _a_slot_after(now)
    _observe_self(known, truth, t)
    _record_attempt(known, truth, request, t, silence_is_attempt)
    _transmit(truth, radio, request)
    _merge(known, request)

    # Response phase.
    t = _a_slot_after(t)
    _observe_self(known, truth, t)
    answer(request.recipient, request.heard, response.recipient)
    _transmit(truth, radio, response)
    _merge(known, response)


@compiled()
def _broadcast(
    known: _Known,
    truth: _Truth,
    radio: _Radio,
    phase: Phase,
    now: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
) -> None:
    """Play a single slot; its phase gets what was heard."""
    t = _a_slot_after(now)
    _observe_self(known, truth, t)
    _record_attempt(known, truth, phase, t, silence_is_attempt)
    _transmit(truth, radio, phase)
    _merge(known, phase)


@compiled()
def _transmit(truth: _Truth, radio: _Radio, phase: Phase) -> None:
    """Silence inactive robots, and fill in what the others hear."""
    silence(phase.recipient, truth.is_active)
    sender = decode_strongest(
        truth.true_m,
        phase.recipient,
        radio.received_at_1_m_mw,
        radio.noise_mw,
        radio.threshold,
        radio.hears_while_sending,
    )
    for b in range(sender.shape[0]):
        for j in range(sender.shape[1]):  # an array's assignment takes seconds to compile
            phase.heard[b, j] = sender[b, j]
    silence(phase.heard, truth.is_active)


@compiled()
def _observe_self(known: _Known, truth: _Truth, t: Float[np.ndarray, "B"]) -> None:
    """Let active robots observe themselves at t [windows]."""
    write_own(
        timestamp=known.timestamp,
        believed_m=known.believed_m,
        believed_mps=known.believed_mps,
        observed_m=truth.observed_m,
        observed_mps=truth.observed_mps,
        now=t,
        is_active=truth.is_active,
    )


@compiled()
def _record_attempt(
    known: _Known,
    truth: _Truth,
    phase: Phase,
    t: Float[np.ndarray, "B"],
    silence_is_attempt: bool,
) -> None:
    """Note whom active robots address in the slot that ends at t [windows]."""
    write_attempt(
        last_attempt=known.last_attempt,
        recipient=phase.recipient,
        now=t,
        silence_is_attempt=silence_is_attempt,
        is_active=truth.is_active,
    )


@compiled()
def _merge(known: _Known, phase: Phase) -> None:
    """Merge whole buffers of senders into those of the robots that heard them."""
    merge_newer(
        sent=known.timestamp,
        heard=phase.heard,
        timestamp=known.timestamp,
        believed_m=known.believed_m,
        believed_mps=known.believed_mps,
        parent=known.parent,
    )


@compiled()
def _a_slot_after(now: Float[np.ndarray, "B"]) -> Float[np.ndarray, "B"]:
    """Return when the slot ends that begins now [windows]."""
    t = np.empty_like(now)
    for b in range(now.shape[0]):
        t[b] = now[b] + SLOT_WINDOWS
    return t
