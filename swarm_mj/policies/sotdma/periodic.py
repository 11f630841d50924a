"""Schedules that repeat: who is heard by whom in a frame, and how old the team's news becomes.

Index order: `[s, i]` is robot `i` in slot `s` of the frame. Powers are in units of the noise.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.radio.reception import Incoming, add_packet, decoded
from swarm_mj.system.compiled import compiled

NOWHERE = -1  # no slot of the frame


class Periodic(NamedTuple):
    """A frame, as one robot believes it to be."""

    power: Float[np.ndarray, "N N"]  # of i's packets at j [noise]
    threshold: float  # least SINR that decodes, linear [1]
    interference: float  # factor by which more of it is reckoned with
    transmits: Bool[np.ndarray, "F N"]
    heard: Int[np.ndarray, "F N"]  # whom j decodes; itself is nobody
    timestamp: Float32[np.ndarray, "N N"]  # room to simulate T [slots]
    frames: int  # that are simulated
    start_age: float  # of all news when that begins [slots]


@compiled()
def empty_frame(
    power: Float[np.ndarray, "N N"],
    threshold: float,
    interference: float,
    num_slots: int,
    frames: int,
    start_age: float,
) -> Periodic:
    """Return a frame in which nobody transmits."""
    num_robots = power.shape[0]
    heard = np.empty((num_slots, num_robots), dtype=np.int64)
    for s in range(num_slots):
        for j in range(num_robots):
            heard[s, j] = j
    transmits = np.zeros((num_slots, num_robots), dtype=np.bool_)
    timestamp = np.empty((num_robots, num_robots), dtype=np.float32)
    return Periodic(power, threshold, interference, transmits, heard, timestamp, frames, start_age)


@compiled()
def listen(frame: Periodic, s: int) -> None:
    """Write the sender that each robot decodes in one slot (Eqs. 3-4)."""
    power, transmits, heard = frame.power, frame.transmits[s], frame.heard[s]
    for j in range(power.shape[0]):
        if transmits[j]:
            heard[j] = j
            continue
        incoming = Incoming(0.0, 0.0, j)
        for i in range(power.shape[0]):
            if transmits[i] and i != j:
                incoming = add_packet(incoming, i, power[i, j], power[i, j])
        heard[j] = decoded(incoming, j, 1.0, frame.threshold, factor=frame.interference)


@compiled()
def move(frame: Periodic, k: int, before: int, after: int) -> None:
    """Robot k leaves one slot and transmits in another; either may be `NOWHERE`."""
    if before != NOWHERE:
        frame.transmits[before, k] = False
        listen(frame, before)
    if after != NOWHERE:
        frame.transmits[after, k] = True
        listen(frame, after)


@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _merge(held: Float32[np.ndarray, "N"], sent: Float32[np.ndarray, "N"]) -> None:
    for k in range(held.shape[0]):
        held[k] = max(held[k], sent[k])


@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _sum(row: Float32[np.ndarray, "N"]) -> np.floating:
    total = np.float32(0.0)
    for k in range(row.shape[0]):
        total += row[k]
    return total


@compiled()
def mean_age(frame: Periodic) -> float:
    """Mean age of information in the last of the frames simulated [slots]."""
    heard, timestamp = frame.heard, frame.timestamp
    num_slots, num_robots = heard.shape
    timestamp[...] = -frame.start_age
    now, age = np.float32(0.0), 0.0
    for n in range(frame.frames * num_slots):
        now += np.float32(1.0)
        for i in range(num_robots):
            timestamp[i, i] = now
        for j in range(num_robots):
            sender = heard[n % num_slots, j]
            if sender != j:  # who transmits decodes nothing, so its row is as it was sent
                _merge(timestamp[j], timestamp[sender])
        if n >= (frame.frames - 1) * num_slots:
            for i in range(num_robots):
                age += now - _sum(timestamp[i]) / num_robots
    return age / (num_slots * num_robots)


@compiled()
def best_slot(
    frame: Periodic, k: int, own: int, least_gain: float, is_marked: Bool[np.ndarray, "F N"]
) -> int:
    """The slot in which k's packets keep the team's news youngest; k must not transmit so far.

    Args:
        frame: Of all others; as it was when this returns.
        k: Who chooses.
        own: Its present slot, which it keeps unless another is better by the least gain.
        least_gain: Of mean age [slots].
        is_marked: Who does not decode k in which slot, whatever powers say.

    Returns:
        The slot.
    """
    num_slots, num_robots = frame.heard.shape
    before = np.empty(num_robots, dtype=np.int64)
    best, least = own, np.inf
    for s in range(num_slots):
        before[:] = frame.heard[s]
        move(frame, k, NOWHERE, s)
        for j in range(num_robots):
            if frame.heard[s, j] == k and is_marked[s, j]:
                frame.heard[s, j] = j
        age = mean_age(frame) - (least_gain if s == own else 0.0)
        if age < least:
            best, least = s, age
        frame.transmits[s, k] = False
        frame.heard[s] = before
    return best
