"""Timestamps T alone (II-B): Eqs. 5 and 8 for whoever plans, replays or remembers windows.

Index order: `[i, k]` is when robot `k` observed what robot `i` knows of it.
"""

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.system.compiled import compiled


@compiled()
def is_newer(sent: float, held: float) -> bool:
    """Whether what a packet says replaces what its receiver holds: the condition of Eq. 8."""
    return held < sent


@compiled(fastmath={"nnan", "nsz"})
def rise(sent: np.floating, held: np.floating) -> np.floating:
    """By how much a receiver's timestamp rises when it decodes a packet."""
    return max(sent - held, np.float32(0.0))


@compiled()
def observe_own(timestamp: Float[np.ndarray, "N N"], now: float) -> None:
    """Everyone observes itself, as Eq. 5 has it."""
    for i in range(timestamp.shape[0]):
        timestamp[i, i] = now


@compiled()
def merge_timestamps(
    packet: Float[np.ndarray, "N N"],
    heard: Int[np.ndarray, "N"],
    timestamp: Float[np.ndarray, "N N"],
) -> float:
    """Merge what everyone decoded, as Eq. 8 has it; returns by how much T rises in sum.

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
    """Fill `merged`: T as Eq. 8 leaves it on average.

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
