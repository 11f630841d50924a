"""The fates of packets, counted in each window (Alg. 1, IV-C)."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, Shaped

from swarm_mj.protocol.window import Phase
from swarm_mj.system.compiled import compiled


class Packets(NamedTuple):
    """The fates of one window's packets in every mission [packets].

    Addressed packets (Alg. 1) are delivered or lost. A broadcast (IV-C) has no addressee: it is
    heard or not. Counts of the other kind are nan.
    """

    sent: Float[np.ndarray, "B"]  # requests or broadcasts, no responses
    transmitted: Float[np.ndarray, "B"]  # all that were on the air, responses too

    attempted: Float[np.ndarray, "B"]  # requests, each to one recipient
    delivered: Float[np.ndarray, "B"]  # of these, decoded by the recipient
    lost: Float[np.ndarray, "B"]  # and of these, not
    overheard: Float[np.ndarray, "B"]  # receptions of requests and responses meant for another
    answered: Float[np.ndarray, "B"]  # responses that the first sender decoded

    heard: Float[np.ndarray, "B"]  # broadcasts that at least one robot decoded
    receptions: Float[np.ndarray, "B"]  # times that a robot decoded a broadcast


def arrived(
    delivered: Float[np.ndarray, "B"], heard: Float[np.ndarray, "B"]
) -> Float[np.ndarray, "B"]:
    """Return how many packets came to whom they were for; broadcasts are for anyone in range.

    Args:
        delivered: Addressed packets that their recipient decoded; nan of broadcasts.
        heard: Broadcasts that at least one robot decoded; nan of addressed packets.
    """
    return np.where(np.isnan(delivered), heard, delivered)


class SlotCounts(NamedTuple):
    """Counts of the packets of one slot in one mission, before they have fates."""

    sent: int
    delivered: int  # decoded by their recipient
    overheard: int  # times that a robot decoded what was meant for another
    heard: int  # packets that at least one robot decoded
    receptions: int  # times that a robot decoded a packet


PACKET_COUNTS = Packets._fields  # the names of all counts

# `Packets` as one array, whose elements have its fields: nine arrays would take as long to make and
# to pass to compiled code as all costs of a single mission take to measure.
COUNTS = np.dtype([(name, np.float64) for name in PACKET_COUNTS])


def no_packets(num_missions: int) -> Shaped[np.ndarray, "B"]:
    """Return the counts of a window of Alg. 1 in which nobody transmits."""
    counts = np.zeros(num_missions, COUNTS)
    counts["heard"] = np.nan
    counts["receptions"] = np.nan
    return counts


@compiled()
def count_addressed(request: Phase, response: Phase, counts: Shaped[np.ndarray, "B"]) -> None:
    """Fill in the fates of requests and of the responses to them, as in Alg. 1."""
    for b in range(counts.shape[0]):
        asked = _count_slot(request.recipient[b], request.heard[b])
        replied = _count_slot(response.recipient[b], response.heard[b])
        counts[b].sent = asked.sent
        counts[b].transmitted = asked.sent + replied.sent
        counts[b].attempted = asked.sent
        counts[b].delivered = asked.delivered
        counts[b].lost = asked.sent - asked.delivered
        counts[b].overheard = asked.overheard + replied.overheard
        counts[b].answered = replied.delivered
        counts[b].heard = np.nan
        counts[b].receptions = np.nan


@compiled()
def count_broadcasts(first: Phase, second: Phase, counts: Shaped[np.ndarray, "B"]) -> None:
    """Fill in the fates of the broadcasts of two slots (IV-C)."""
    for b in range(counts.shape[0]):
        one = _count_slot(first.recipient[b], first.heard[b])
        other = _count_slot(second.recipient[b], second.heard[b])
        counts[b].sent = one.sent + other.sent
        counts[b].transmitted = one.sent + other.sent
        counts[b].attempted = np.nan
        counts[b].delivered = np.nan
        counts[b].lost = np.nan
        counts[b].overheard = np.nan
        counts[b].answered = np.nan
        counts[b].heard = one.heard + other.heard
        counts[b].receptions = one.receptions + other.receptions


@compiled()
def _count_slot(recipient: Int[np.ndarray, "N"], heard: Int[np.ndarray, "N"]) -> SlotCounts:
    """Count the packets of one slot in one mission."""
    sent = 0
    delivered = 0
    overheard = 0
    num_heard = 0
    receptions = 0
    is_heard = np.zeros(recipient.shape[0], dtype=np.bool_)
    for i in range(recipient.shape[0]):
        sent += recipient[i] != i
        sender = heard[i]
        if sender == i:
            continue
        is_meant = recipient[sender] == i
        delivered += is_meant
        overheard += not is_meant
        num_heard += not is_heard[sender]
        receptions += 1
        is_heard[sender] = True
    return SlotCounts(
        sent=sent,
        delivered=delivered,
        overheard=overheard,
        heard=num_heard,
        receptions=receptions,
    )
