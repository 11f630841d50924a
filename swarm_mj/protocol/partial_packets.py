"""Packets that do not hold the whole buffer: the choice of entries (II-B, with a bit rate).

A robot always sends its own entry, and then those whose T has risen most since it last sent them;
ties go to the freshest. So every entry gets its turn. An entry keeps its parent if the parent's own
entry is in the packet, and otherwise names the sender: so buffers remain trees, although some
robots on the way are left out.
"""

from dataclasses import dataclass, fields, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.protocol.buffers import NEVER, Buffers
from swarm_mj.system.compiled import compiled

TIE_BREAK = 1e-9


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
    whole = {spec.name: getattr(buffers, spec.name) for spec in fields(Buffers)}
    last_sent = np.full(buffers.timestamp.shape, NEVER)
    return PartialBuffers(**whole, num_entries=num_entries, last_sent=last_sent)


def entries_sent(
    buffers: Buffers, recipient: Int[np.ndarray, "B N"]
) -> Bool[np.ndarray, "B N N"] | None:
    """Choose the entries that everyone sends in this slot, and note them; None is all.

    Returns:
        `[b, i, k]`: whether i's packet has an entry of k.
    """
    if not isinstance(buffers, PartialBuffers):
        return None
    is_sent = np.zeros(buffers.timestamp.shape, dtype=np.bool_)
    _choose(buffers.timestamp, recipient, buffers.num_entries, buffers.last_sent, is_sent)
    return is_sent


@compiled()
def _choose(
    timestamp: Float[np.ndarray, "B N N"],
    recipient: Int[np.ndarray, "B N"],
    num_entries: int,
    last_sent: Float[np.ndarray, "B N N"],
    is_sent: Bool[np.ndarray, "B N N"],
) -> None:
    num_missions, num_robots = recipient.shape
    for b in range(num_missions):
        for i in range(num_robots):
            if recipient[b, i] == i:
                continue
            # Rises are halves of a window: the added term decides between equal ones only.
            urgency = timestamp[b, i] - last_sent[b, i] + TIE_BREAK * timestamp[b, i]
            urgency[i] = np.inf
            for k in np.argsort(-urgency)[:num_entries]:
                if timestamp[b, i, k] > NEVER:
                    is_sent[b, i, k] = True
                    last_sent[b, i, k] = timestamp[b, i, k]
