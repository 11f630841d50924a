"""Which entries of a buffer are sent where a packet has no room for all (II-B)."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from swarm_mj.protocol.buffers import ABSENT, NEVER, Buffers
from swarm_mj.system.compiled import compiled

TIE_BREAK = 1e-9  # rises are halves of a window, so this decides between equal ones only


@dataclass(frozen=True, kw_only=True)
class PartialBuffers(Buffers):
    """Buffers of which only some entries fit into a packet."""

    num_entries: int
    last_sent: Float[np.ndarray, "B N N"]  # T^{i,j} as i last sent it [windows], or NEVER


def with_room(buffers: Buffers, num_entries: int) -> Buffers:
    """Return the same buffers with packets of at most this many entries."""
    if isinstance(buffers, PartialBuffers):
        return replace(buffers, num_entries=min(num_entries, buffers.shape[1]))
    if num_entries >= buffers.shape[1]:
        return buffers
    last_sent = np.full(buffers.timestamp.shape, NEVER)
    return PartialBuffers(**vars(buffers), num_entries=num_entries, last_sent=last_sent)


def entries_sent(buffers: Buffers, recipient: Int[np.ndarray, "B N"]) -> Float[np.ndarray, "B N N"]:
    """Choose the entries that everyone sends in this slot (II-B), and note them; return their T.

    A robot always sends its own entry, and then those whose T has risen most since it last sent
    them; ties go to the freshest. So every entry gets its turn. `ABSENT` at `[b, i, k]` where i's
    packet has no entry of k.
    """
    if not isinstance(buffers, PartialBuffers):
        return buffers.timestamp
    return choose_entries(buffers.timestamp, recipient, buffers.num_entries, buffers.last_sent)


@compiled()
def choose_entries(
    timestamp: Float[np.ndarray, "B N N"],
    recipient: Int[np.ndarray, "B N"],
    num_entries: int,
    last_sent: Float[np.ndarray, "B N N"],
) -> Float[np.ndarray, "B N N"]:
    """Return the entries that robots send, as `entries_sent` does, and note them in `last_sent`."""
    num_missions, num_robots = recipient.shape
    sent = np.full_like(timestamp, ABSENT)
    for b in range(num_missions):
        for i in range(num_robots):
            if recipient[b, i] == i:
                continue
            urgency = timestamp[b, i] - last_sent[b, i] + TIE_BREAK * timestamp[b, i]
            urgency[i] = np.inf
            for k in np.argsort(-urgency)[:num_entries]:
                if timestamp[b, i, k] > NEVER:
                    sent[b, i, k] = last_sent[b, i, k] = timestamp[b, i, k]
    return sent
