"""A window's slots in one compiled call, for the paper's radio and packets of whole buffers.

`protocol.window` is the text to read, and what every other channel and packet goes by. This is its
second implementation, made of the same loops and equal to it in every array.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import Buffers, merge_newer, write_attempt, write_own
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.radio.free_space import FreeSpaceRadio, decode_strongest
from swarm_mj.system.compiled import compiled


def talk(
    buffers: Buffers,
    states: RobotStates,
    recipient: Int[np.ndarray, "B N"],
    radio: FreeSpaceRadio,
    now: Float[np.ndarray, "B"],
    num_slots: int,
    silence_is_attempt: bool,
) -> Int[np.ndarray, "S 2 B N"]:
    """Play a slot of transmissions, and a second of responses if there are two.

    Arguments are as in `window.window`, the clock showing when the first slot ends. Returns whom
    each robot addressed and whom it decoded, slot by slot.
    """
    said = np.empty((num_slots, 2, *recipient.shape), dtype=np.int64)
    said[0, 0] = recipient  # in the one type and layout that the loops are compiled for
    known = buffers.timestamp, buffers.position_m, buffers.velocity_mps, buffers.parent
    truth = states.position_m, states.own_m, states.velocity_mps, states.is_active
    _talk(*known, buffers.last_attempt, *truth, now, silence_is_attempt, *radio.rule, said)
    return said


@compiled()
def _talk(
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
    said: Int[np.ndarray, "S 2 B N"],
) -> None:
    write_attempt(last_attempt, said[0, 0], now, silence_is_attempt, is_active)
    time = now.copy()  # of the slot's end
    for slot in range(said.shape[0]):
        recipient, heard = said[slot, 0], said[slot, 1]
        if slot > 0:
            answer(said[slot - 1, 0], said[slot - 1, 1], recipient)
        for b in range(time.shape[0]):
            time[b] = now[b] + slot * SLOT_WINDOWS
        write_own(timestamp, believed_m, believed_mps, own_m, velocity_mps, time, is_active)
        silence(recipient, is_active)
        sender = decode_strongest(
            position_m, recipient, received_at_1_m_mw, noise_mw, threshold, hears_while_sending
        )
        for b in range(sender.shape[0]):
            for j in range(sender.shape[1]):  # an array's assignment takes seconds to compile
                heard[b, j] = sender[b, j]
        silence(heard, is_active)
        merge_newer(timestamp, heard, timestamp, believed_m, believed_mps, parent)


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
