"""The clock, and timestamps T alone (II-B): Eqs. 5 and 8 to plan, replay and remember windows.

Index order: `[i, k]` is when robot `k` observed what robot `i` knows of it.
"""

import numpy as np
from jaxtyping import Float, Float32, Int

from swarm_mj.mission.team import SLOTS_PER_WINDOW
from swarm_mj.system.compiled import compiled

# Delta t of Alg. 1: what a slot lasts [windows]. In IV-A the paper means a window by it.
SLOT_WINDOWS = 1.0 / SLOTS_PER_WINDOW


def slot_of(t: Float[np.ndarray, "*S"]) -> Int[np.ndarray, "*S"]:
    """Return the slot that begins at t [windows], counted from 0 at the mission's start."""
    return np.rint(t / SLOT_WINDOWS).astype(np.int64)


def slot_at(t: float) -> int:
    """Return the slot that begins at t [windows]: `slot_of` for one time."""
    return round(t / SLOT_WINDOWS)


# The rule of the merge stands here, as a condition and as the rise that follows from it. The loops
# around it are several, because each carries other arrays: `buffers.merge_newer` whole entries,
# `merge_timestamps` T alone, `merge_expected` the mean of T, `sotdma.frame` a bit for each subject.
# One loop for all would take the slowest one's time.
@compiled()
def is_newer(sent: float, held: float) -> bool:
    """Return whether a packet's entry replaces what its receiver holds: the merge's condition."""
    return held < sent


@compiled(fastmath={"nnan", "nsz"})
def rise(sent: np.floating, held: np.floating) -> np.floating:
    """Return the rise of a receiver's timestamp when it decodes a packet."""
    return max(sent - held, np.float32(0.0))


# Adding in any order lets the compiler use its vectors. Whole slots add up exactly; expected ones
# to rounding.
@compiled(fastmath={"reassoc", "nnan", "nsz"}, makes_arrays=False)
def total_rise(newer: Float32[np.ndarray, "N"], older: Float32[np.ndarray, "N"]) -> float:
    """Return the rise of T from one row to another, summed over subjects."""
    total = np.float32(0.0)
    for k in range(older.shape[0]):
        total += rise(newer[k], older[k])
    return float(total)


@compiled()
def observe_own(timestamp: Float[np.ndarray, "N N"], now: float) -> None:
    """Let everyone observe itself at the time `now`."""
    for i in range(timestamp.shape[0]):
        timestamp[i, i] = now


@compiled()
def merge_timestamps(
    packet: Float[np.ndarray, "N N"],
    heard: Int[np.ndarray, "N"],
    timestamp: Float[np.ndarray, "N N"],
) -> None:
    """Merge senders' T of before the slot into receivers'."""
    for i in range(heard.shape[0]):
        j = heard[i]
        if j != i:
            sent = packet[j]
            held = timestamp[i]
            for k in range(heard.shape[0]):
                # Written each time: the loop becomes vectors.
                held[k] = sent[k] if is_newer(sent[k], held[k]) else held[k]


@compiled(fastmath={"nnan", "nsz"})
def merge_expected(
    timestamp: Float[np.ndarray, "N N"],
    heard: Int[np.ndarray, "N"],
    probability: Float[np.ndarray, "N"],
    merged: Float[np.ndarray, "N N"],
) -> None:
    """Fill `merged`: the mean of T after the merge, if packets decode with these probabilities."""
    for i in range(heard.shape[0]):
        share = np.float32(probability[i])
        held = timestamp[i]
        sent = timestamp[heard[i]]
        row = merged[i]
        for k in range(heard.shape[0]):
            row[k] = held[k] + share * rise(sent[k], held[k])
