"""The packets that a robot sent and decoded, as far as it remembers them, and how ages count.

Row `[b, i]` is written from what robot `i` sent and decoded only. A packet's timestamps are its
sender's at that time; they are followed from window to window here, by Alg. 1.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Float32, Int, Int16

from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.timestamps import (
    SLOT_WINDOWS,
    SLOTS_PER_WINDOW,
    merge_timestamps,
    observe_own,
)
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled

UNKEPT = -1
LONG_WINDOWS = 500.0  # ages count by their logarithm, up to 1 at this one [windows]
LOG_LONG = math.log1p(LONG_WINDOWS)


class Memory(NamedTuple):
    """Times of packets between each pair of robots, and the timestamps that packets carried."""

    heard: Float32[np.ndarray, "B N N"]  # when i last decoded a packet of k itself [windows]
    addressed_by: Float32[np.ndarray, "B N N"]  # when such a packet was last meant for i [windows]
    sent: Float32[np.ndarray, "B N"]  # when i last spoke first [windows]
    packet: Float32[np.ndarray, "B N N N"]  # T^{k,j} in each packet of k that someone remembers
    decoded: Int16[np.ndarray, "B N N"]  # which of these packets of k is the last that i decoded
    said: Float32[np.ndarray, "B N N"]  # T^{i,j} when i last spoke first [windows]
    timestamp: Float32[np.ndarray, "B N N"]  # T^{i,j} when the last window ended [windows]


def empty_memory(num_missions: int, num_robots: int) -> Memory:
    """Return the memory of robots that never heard or said anything."""
    robots = (num_missions, num_robots)
    pairs = (*robots, num_robots)
    return Memory(
        heard=_never(pairs),
        addressed_by=_never(pairs),
        sent=_never(robots),
        packet=_never((*pairs, num_robots)),
        decoded=np.zeros(pairs, dtype=np.int16),
        said=_never(pairs),
        timestamp=_never(pairs),
    )


def _never(shape: tuple[int, ...]) -> Float32[np.ndarray, "..."]:
    assert NEVER == 0.0  # zeros take no memory until something else is written
    return np.zeros(shape, dtype=np.float32)


def remember(memory: Memory, views: LocalViews) -> None:
    """Take in the window of transmission and response that has just ended; must see every one."""
    if views.phases:
        transmission, response = views.phases
        _take_in(
            memory=memory,
            recipient=transmission.recipient,
            heard=transmission.heard,
            time=views.now - SLOT_WINDOWS,
            is_transmission=True,
        )
        _take_in(
            memory=memory,
            recipient=response.recipient,
            heard=response.heard,
            time=views.now,
            is_transmission=False,
        )
    # They were followed above for what packets carried; how the window ended is in the buffers.
    memory.timestamp[...] = views.buffers.timestamp


@compiled()
def _take_in(
    memory: Memory,
    recipient: Int[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
    time: Float[np.ndarray, "B"],
    is_transmission: bool,
) -> None:
    for b in range(len(time)):
        observe_own(memory.timestamp[b], time[b])
        # Packets leave all at once, so none holds what another one just brought.
        packet = memory.timestamp[b].copy()
        kept = np.full(len(packet), UNKEPT)  # as which of its packets each sender's is remembered
        for i, k in enumerate(heard[b]):
            # An answer does not count as speaking first.
            if is_transmission and recipient[b, i] != i:
                memory.sent[b, i] = time[b]
                memory.said[b, i] = packet[i]
            if k != i:
                memory.heard[b, i, k] = time[b]
                if kept[k] == UNKEPT:
                    kept[k] = _find_forgotten(memory.decoded[b, :, k], k)
                    memory.packet[b, k, kept[k]] = packet[k]
                memory.decoded[b, i, k] = kept[k]
                if recipient[b, k] == i:
                    memory.addressed_by[b, i, k] = time[b]
        merge_timestamps(packet, heard[b], memory.timestamp[b])


@compiled()
def _find_forgotten(decoded: Int16[np.ndarray, "N"], sender: int) -> int:
    """Return the first of a sender's N packets that none of the others remembers."""
    # Robots share what they decoded together, and the first places are used again and again: that
    # stays in the processor's memory, where a copy for each pair of robots would not.
    is_remembered = np.zeros(len(decoded), dtype=np.bool_)
    for i in range(len(decoded)):
        if i != sender:
            is_remembered[decoded[i]] = True
    place = 0
    while is_remembered[place]:  # N - 1 robots remember N - 1 packets at most
        place += 1
    return place


@compiled()
def logarithm(windows: float) -> float:
    """Return a time on a logarithmic scale, up to 1 at `LONG_WINDOWS`."""
    return math.log1p(windows) / LOG_LONG


# Ages are of whole and half windows, so almost all of them are looked up: logarithms were most of
# the time that these features take. The last one, 1, is of all that are longer.
NUM_AGES = round(SLOTS_PER_WINDOW * LONG_WINDOWS)
LOG_AGES = np.array([math.log1p(n / SLOTS_PER_WINDOW) / LOG_LONG for n in range(NUM_AGES)] + [1.0])


@compiled()
def log_age(now: float, then: float, is_granted: bool = False) -> float:
    """Return the age on this scale: 0 is now, 1 is long ago.

    What happened at `NEVER` did not happen, so its age is 1, unless it was granted at the start.
    """
    age = now - then
    if not (then > NEVER or is_granted) or age >= LONG_WINDOWS:
        return 1.0
    place = int(SLOTS_PER_WINDOW * age)
    if place == SLOTS_PER_WINDOW * age and place >= 0:
        return LOG_AGES[place]
    return logarithm(age)


@compiled(makes_arrays=False)
def write_log_ages(
    now: float, then: Float[np.ndarray, "N"], is_granted: bool, ages: Float32[np.ndarray, "N"]
) -> None:
    """Write the ages of N times, each as `log_age` returns it."""
    num_others = 0
    for k in range(len(then)):
        # Without branches, so that the loop becomes vectors: all are looked up, wrong ones, too.
        has_happened = is_granted | (then[k] > NEVER)
        place = (
            min(SLOTS_PER_WINDOW * (now - then[k]), 1.0 * NUM_AGES)
            if has_happened
            else 1.0 * NUM_AGES
        )
        whole = np.int32(place)
        is_there = (whole == place) & (whole >= 0)
        ages[k] = LOG_AGES[whole if is_there else 0]
        num_others += not is_there
    if num_others > 0:
        for k in range(len(then)):
            ages[k] = log_age(now, then[k], is_granted)
