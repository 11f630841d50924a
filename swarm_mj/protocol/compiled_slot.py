"""The steps of a slot, compiled, for the paper's radio and packets of whole buffers.

`compiled_window` puts these together. Three kinds of positions meet here: where a robot truly is,
which the radio goes by; where it observes itself to be; and where others believe it to be. Named
tuples keep them apart, and cost nothing within compiled code.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.protocol.buffers import merge_newer, senders_listen, write_attempt, write_own
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.protocol.window import Phase, silence
from swarm_mj.radio.free_space import decode_strongest
from swarm_mj.system.compiled import compiled


class KnownArrays(NamedTuple):
    """The arrays of `Buffers` that a window writes: all that robots know of each other."""

    timestamp: Float[np.ndarray, "B N N"]  # T^{i,j} [windows]
    believed_m: Float[np.ndarray, "B N N D"]  # of M^{i,j}: the buffers' `position_m`
    believed_mps: Float[np.ndarray, "B N N D"]  # of M^{i,j}: the buffers' `velocity_mps`
    parent: Int[np.ndarray, "B N N"]  # P^{i,j}
    last_attempt: Float[np.ndarray, "B N N"]  # L^{i,j} [windows]


class TrueArrays(NamedTuple):
    """The robots as they are: the arrays of `RobotStates`."""

    true_m: Float[np.ndarray, "B N D"]
    observed_m: Float[np.ndarray, "B N D"]  # its own place, as each robot observes it
    observed_mps: Float[np.ndarray, "B N D"]  # its own velocity, which it observes without error
    is_active: Bool[np.ndarray, "B N"] | None  # None is compiled apart, as all of them


class RadioNumbers(NamedTuple):
    """The numbers of `FreeSpaceRadio`."""

    received_at_1_m_mw: float
    noise_mw: float
    threshold: float  # linear [1]
    hears_while_sending: bool


@compiled()
def transmit(truth: TrueArrays, radio: RadioNumbers, phase: Phase) -> None:
    """Silence inactive robots, and fill in what the others hear."""
    silence(phase.recipient, truth.is_active)
    sender = decode_strongest(
        position_m=truth.true_m,
        recipient=phase.recipient,
        received_at_1_m_mw=radio.received_at_1_m_mw,
        noise_mw=radio.noise_mw,
        threshold=radio.threshold,
        hears_while_sending=radio.hears_while_sending,
    )
    for b in range(sender.shape[0]):
        for j in range(sender.shape[1]):  # an array's assignment takes seconds to compile
            phase.heard[b, j] = sender[b, j]
    silence(phase.heard, truth.is_active)


@compiled()
def observe_self(known: KnownArrays, truth: TrueArrays, t: Float[np.ndarray, "B"]) -> None:
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
def record_attempt(
    known: KnownArrays,
    truth: TrueArrays,
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
def merge(known: KnownArrays, phase: Phase) -> None:
    """Merge whole buffers of senders into those of the robots that heard them."""
    packets = known
    if senders_listen(phase.heard):
        packets = KnownArrays(
            timestamp=known.timestamp.copy(),
            believed_m=known.believed_m.copy(),
            believed_mps=known.believed_mps.copy(),
            parent=known.parent.copy(),
            last_attempt=known.last_attempt,
        )
    merge_newer(
        sent_t=packets.timestamp,
        sent_m=packets.believed_m,
        sent_mps=packets.believed_mps,
        sent_parent=packets.parent,
        heard=phase.heard,
        timestamp=known.timestamp,
        believed_m=known.believed_m,
        believed_mps=known.believed_mps,
        parent=known.parent,
    )


@compiled()
def a_slot_after(now: Float[np.ndarray, "B"]) -> Float[np.ndarray, "B"]:
    """Return when the slot ends that begins now [windows]."""
    t = np.empty_like(now)
    for b in range(now.shape[0]):
        t[b] = now[b] + SLOT_WINDOWS
    return t
