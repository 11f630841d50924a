"""Timestamps T alone (II-B): Eqs. 5 and 8 for planning, replaying and remembering windows.

Index order: `[i, k]` is when robot `k` observed what robot `i` knows of it.
"""

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.system.compiled import compiled


@compiled()
def is_newer(sent: float, held: float) -> bool:
    """Return whether a packet's entry replaces what its receiver holds: the condition of Eq. 8."""
    return held < sent


@compiled(fastmath={"nnan", "nsz"})
def rise(sent: np.floating, held: np.floating) -> np.floating:
    """Return the rise of a receiver's timestamp when it decodes a packet."""
    return max(sent - held, np.float32(0.0))


@compiled()
def observe_own(timestamp: Float[np.ndarray, "N N"], now: float) -> None:
    """Let everyone observe itself, as in Eq. 5."""
    for i in range(timestamp.shape[0]):
        timestamp[i, i] = now


@compiled()
def merge_timestamps(
    packet: Float[np.ndarray, "N N"],
    heard: Int[np.ndarray, "N"],
    timestamp: Float[np.ndarray, "N N"],
) -> float:
    """Merge what everyone decoded, as in Eq. 8, and return the sum of the rises of T.

    Args:
        packet: T of every sender before the slot.
        heard: The sender that each robot decoded; itself is nobody.
        timestamp: T of every receiver, written in place.
    """
    total = 0.0
    for i in range(heard.shape[0]):
        j = heard[i]
        if j != i:
            for k in range(heard.shape[0]):
                if is_newer(packet[j, k], timestamp[i, k]):
                    total += packet[j, k] - timestamp[i, k]
                    timestamp[i, k] = packet[j, k]
    return total


@compiled(fastmath={"nnan", "nsz"})
def merge_expected(
    timestamp: Float[np.ndarray, "N N"],
    heard: Int[np.ndarray, "N"],
    probability: Float[np.ndarray, "N"],
    merged: Float[np.ndarray, "N N"],
) -> None:
    """Fill `merged`: the mean of T after Eq. 8.

    Args:
        timestamp: T before the slot.
        heard: The sender that each robot may decode; itself is nobody.
        probability: That it does.
        merged: T after the slot; overwritten.
    """
    for i in range(heard.shape[0]):
        share = np.float32(probability[i])
        held, sent, row = timestamp[i], timestamp[heard[i]], merged[i]
        for k in range(heard.shape[0]):
            row[k] = held[k] + share * rise(sent[k], held[k])
