"""The slot table of every robot: who transmits when, and who missed its own packets.

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

LONG_AGO = -1_000_000  # before all slots; differences of 32 bits remain exact
NO_PLACE = -1  # the place of a slot that is left to robots in need
MAX_MISSED = 100  # that are counted, in 8 bits
RECENT_WEIGHT = 0.1  # of the last packet in the share that were decoded


class Frames(NamedTuple):
    """How the mission's slots are divided into frames."""

    first_slot: int
    num_slots: int  # of a frame
    contention_every: int  # the last of this many slots is no part of them


class SlotTable(NamedTuple):
    """The memory of every robot."""

    slots: Int[np.ndarray, "N N"]  # of the frame, in which it believes each to transmit
    announced: Int[np.ndarray, "N N"]  # when it last knows that each transmitted
    decoded: Int32[np.ndarray, "N N"]  # when it last decoded a packet of each
    got_through: Int32[np.ndarray, "N N"]  # its own last packet that such a packet knew of
    sent: Int[np.ndarray, "N"]  # when it last transmitted itself
    sent_place: Int[np.ndarray, "N"]  # and where in the frame
    outbound_delivery_ratio: Float[np.ndarray, "N"]  # recent share of its packets that arrived
    judged: Int32[np.ndarray, "N N"]  # the last of its packets of which it learned whether
    missed: Int8[np.ndarray, "N F N"]  # how many of a slot, in a row, a neighbour did not decode
    missed_at: Int32[np.ndarray, "N F"]  # when it last learned so


@compiled()
def place_of(slot: int, frames: Frames) -> int:
    """Return where in its frame a slot lies, or `NO_PLACE`."""
    since = slot - frames.first_slot
    if since % frames.contention_every == frames.contention_every - 1:
        return NO_PLACE
    return (since - since // frames.contention_every) % frames.num_slots


def slot_table(slots: Int[np.ndarray, "N N"], num_slots: int) -> SlotTable:
    """Return the memory of robots that believe in these slots and remember nothing else."""
    num_robots, pairs = len(slots), slots.shape
    return SlotTable(
        slots=slots,
        announced=np.full(pairs, LONG_AGO),
        decoded=np.full(pairs, LONG_AGO, dtype=np.int32),
        got_through=np.full(pairs, LONG_AGO, dtype=np.int32),
        sent=np.full(num_robots, LONG_AGO),
        sent_place=np.full(num_robots, NO_PLACE),
        outbound_delivery_ratio=np.ones(num_robots),
        judged=np.full(pairs, LONG_AGO, dtype=np.int32),
        missed=np.zeros((num_robots, num_slots, num_robots), dtype=np.int8),
        missed_at=np.full((num_robots, num_slots), LONG_AGO, dtype=np.int32),
    )


@compiled()
def _slot_of(timestamp: float) -> int:
    """Return the slot in which a robot transmitted that was observed at that time [windows]."""
    return round(SLOTS_PER_WINDOW * timestamp) - 1


@compiled()
def read_slots(table: SlotTable, timestamp: Float[np.ndarray, "N N"], frames: Frames) -> None:
    """Adopt the slots that teammates announced by transmitting in them."""
    num_robots = timestamp.shape[0]
    for i in range(num_robots):
        for k in range(num_robots):
            slot = _slot_of(timestamp[i, k])
            if k != i and slot >= frames.first_slot and slot > table.announced[i, k]:
                place = place_of(slot, frames)
                if place != NO_PLACE:
                    table.announced[i, k], table.slots[i, k] = slot, place


@compiled()
def read_packets(
    table: SlotTable,
    heard: Int[np.ndarray, "N"],
    timestamp: Float[np.ndarray, "N N"],
    parent: Int[np.ndarray, "N N"],
    slot: int,
    frames: Frames,
) -> None:
    """Note what the packets decoded in the last slot say of the receiver's own.

    T and P of a sender are still those in its packet: a robot that sends decodes nothing.
    """
    for i in range(heard.shape[0]):
        j = heard[i]
        if j == i:
            continue
        known = _slot_of(timestamp[j, i])
        table.decoded[i, j], table.got_through[i, j] = slot, known
        sent, place = table.sent[i], table.sent_place[i]
        # A packet counts once per neighbour, however often that one repeats what it knows.
        is_due = frames.first_slot <= sent < slot and table.judged[i, j] < sent
        if place == NO_PLACE or not is_due:
            continue
        table.judged[i, j] = sent
        # T alone may have come through others; P says that j decoded the packet itself.
        got_through = known >= sent and parent[j, i] == j
        news = (1.0 if got_through else 0.0) - table.outbound_delivery_ratio[i]
        table.outbound_delivery_ratio[i] += RECENT_WEIGHT * news
        if got_through:
            table.missed[i, place, j] = 0
        else:
            table.missed[i, place, j] = min(table.missed[i, place, j] + 1, MAX_MISSED)
            table.missed_at[i, place] = slot


def marks(table: SlotTable, i: int, min_probability: float, since: int) -> Bool[np.ndarray, "F N"]:
    """Return who does not decode robot i in which slot, by what was learned since a slot.

    Misses in a row that are less probable than the given probability are no chance.
    """
    loss = max(1.0 - table.outbound_delivery_ratio[i], 1e-3)
    enough = max(1, math.ceil(math.log(min_probability) / math.log(min(loss, 0.9))))
    return (table.missed[i] >= enough) & (table.missed_at[i] >= since)[:, None]


@compiled()
def is_in_need(
    table: SlotTable,
    i: int,
    timestamp: Float[np.ndarray, "N"],
    is_near: Bool[np.ndarray, "N"],
    slot: int,
    patience: float,
    resignation: float,
) -> bool:
    """Return whether i lost a neighbour, or hears one that has lost i, by its own T [windows].

    After the patience a neighbour is lost, after the resignation it counts as gone [slots].
    """
    for j in range(timestamp.shape[0]):
        if is_near[j] and j != i:
            if patience < slot - _slot_of(timestamp[j]) <= resignation:
                return True
            decoded = table.decoded[i, j]
            if decoded > slot - patience and decoded - table.got_through[i, j] > patience:
                return True
    return False
