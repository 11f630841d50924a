"""What robots hear of slots: who transmits in which, and who missed their own packets.

A robot's T of a teammate says when that teammate last transmitted, and so which slot of the frame
it owns. A packet also says what its sender knows of the robot that decodes it: if T is as young as
that robot's last packet and P is the sender, then the sender decoded that packet itself. Index
order: row `[i]` is robot i's own memory; slots count from the start of the mission.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Int8, Int32

from swarm_mj.protocol.window import SLOTS_PER_WINDOW
from swarm_mj.system.compiled import compiled

LONG_AGO = -1_000_000
OF_NO_FRAME = -1  # the place of a slot that is left to whoever is in need
MOST_MISSED = 100  # that are counted
RECENT = 0.1  # the weight of the last packet in the share that were decoded


class Frames(NamedTuple):
    """How the mission's slots are divided into frames."""

    first_slot: int
    num_slots: int  # of a frame
    contention_every: int  # one of so many slots is no part of them


class Hearsay(NamedTuple):
    """What every robot remembers."""

    slots: Int[np.ndarray, "N N"]  # of the frame, in which it believes each to transmit
    announced: Int[np.ndarray, "N N"]  # when it last knows that each transmitted
    decoded: Int32[np.ndarray, "N N"]  # when it last decoded a packet of each
    got_through: Int32[np.ndarray, "N N"]  # its own last packet that such a packet knew of
    sent: Int[np.ndarray, "N"]  # when it last transmitted itself
    sent_place: Int[np.ndarray, "N"]  # and where in the frame
    share: Float[np.ndarray, "N"]  # of its packets, lately, that neighbours decoded
    judged: Int32[np.ndarray, "N N"]  # the last of its packets of which it learned whether
    missed: Int8[np.ndarray, "N F N"]  # how many of a slot, in a row, a neighbour did not decode
    missed_at: Int32[np.ndarray, "N F"]  # when it last learned so


@compiled()
def place_of(slot: int, frames: Frames) -> int:
    """Where in its frame a slot lies, or `OF_NO_FRAME`."""
    since = slot - frames.first_slot
    if since % frames.contention_every == frames.contention_every - 1:
        return OF_NO_FRAME
    return (since - since // frames.contention_every) % frames.num_slots


def nothing_heard(slots: Int[np.ndarray, "N N"], num_slots: int) -> Hearsay:
    """Robots that believe in these slots and remember nothing else."""
    num_robots, pairs = len(slots), slots.shape
    of_slots = (num_robots, num_slots, num_robots)
    return Hearsay(
        slots=slots,
        announced=np.full(pairs, LONG_AGO),
        decoded=np.full(pairs, LONG_AGO, dtype=np.int32),
        got_through=np.full(pairs, LONG_AGO, dtype=np.int32),
        sent=np.full(num_robots, LONG_AGO),
        sent_place=np.full(num_robots, OF_NO_FRAME),
        share=np.ones(num_robots),
        judged=np.full(pairs, LONG_AGO, dtype=np.int32),
        missed=np.zeros(of_slots, dtype=np.int8),
        missed_at=np.full((num_robots, num_slots), LONG_AGO, dtype=np.int32),
    )


@compiled()
def _slot_of(timestamp: float) -> int:
    """Return the slot in which a robot transmitted that was observed at that time [windows]."""
    return round(SLOTS_PER_WINDOW * timestamp) - 1


@compiled()
def read_slots(hearsay: Hearsay, timestamp: Float[np.ndarray, "N N"], frames: Frames) -> None:
    """Take over the slots that teammates announced by transmitting in them."""
    num_robots = timestamp.shape[0]
    for i in range(num_robots):
        for k in range(num_robots):
            slot = _slot_of(timestamp[i, k])
            if k != i and slot >= frames.first_slot and slot > hearsay.announced[i, k]:
                place = place_of(slot, frames)
                if place != OF_NO_FRAME:
                    hearsay.announced[i, k], hearsay.slots[i, k] = slot, place


@compiled()
def read_packets(
    hearsay: Hearsay,
    heard: Int[np.ndarray, "N"],
    timestamp: Float[np.ndarray, "N N"],
    parent: Int[np.ndarray, "N N"],
    slot: int,
    frames: Frames,
) -> None:
    """Take note of what the packets decoded in the last slot say of one's own.

    Args:
        hearsay: Written in place.
        heard: Whom each robot decoded; itself is nobody.
        timestamp: T of everyone; of a sender, what its packet said.
        parent: P, likewise.
        slot: That slot.
        frames: Of the mission.
    """
    for i in range(heard.shape[0]):
        j = heard[i]
        if j == i:
            continue
        known = _slot_of(timestamp[j, i])
        hearsay.decoded[i, j], hearsay.got_through[i, j] = slot, known
        sent, place = hearsay.sent[i], hearsay.sent_place[i]
        is_due = frames.first_slot <= sent < slot and hearsay.judged[i, j] < sent
        if place == OF_NO_FRAME or not is_due:
            continue
        hearsay.judged[i, j] = sent
        got_through = known >= sent and parent[j, i] == j
        hearsay.share[i] += RECENT * ((1.0 if got_through else 0.0) - hearsay.share[i])
        if got_through:
            hearsay.missed[i, place, j] = 0
        else:
            hearsay.missed[i, place, j] = min(hearsay.missed[i, place, j] + 1, MOST_MISSED)
            hearsay.missed_at[i, place] = slot


@compiled()
def write_marks(
    missed: Int8[np.ndarray, "F N"],
    missed_at: Int32[np.ndarray, "F"],
    share: float,
    least_doubt: float,
    since: int,
    is_marked: Bool[np.ndarray, "F N"],
) -> None:
    """Mark who does not decode a robot in which slot: who missed too many packets for chance.

    Args:
        missed: In a row, there.
        missed_at: When it was last learned, of each slot.
        share: Of the robot's packets that neighbours decode.
        least_doubt: Least probability of so many misses, for which they count as chance.
        since: Older marks are forgotten.
        is_marked: Overwritten.
    """
    chance = max(1.0 - share, 1e-3)
    enough = max(1, math.ceil(math.log(least_doubt) / math.log(min(chance, 0.9))))
    for s in range(missed.shape[0]):
        for j in range(missed.shape[1]):
            is_marked[s, j] = missed[s, j] >= enough and missed_at[s] >= since


@compiled()
def is_in_need(
    hearsay: Hearsay,
    i: int,
    timestamp: Float[np.ndarray, "N"],
    is_near: Bool[np.ndarray, "N"],
    slot: int,
    patience: float,
    resignation: float,
) -> bool:
    """Whether i has not heard of a neighbour for long, or hears one that has not heard of it.

    Args:
        hearsay: Of all robots.
        i: The robot.
        timestamp: Its T [windows].
        is_near: Whom it believes to be in range.
        slot: That begins.
        patience: How long is long [slots].
        resignation: After so long the neighbour counts as gone [slots].
    """
    for j in range(timestamp.shape[0]):
        if is_near[j] and j != i:
            if patience < slot - _slot_of(timestamp[j]) <= resignation:
                return True
            decoded = hearsay.decoded[i, j]
            if decoded > slot - patience and decoded - hearsay.got_through[i, j] > patience:
                return True
    return False
