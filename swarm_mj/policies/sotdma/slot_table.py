"""The slot table of every robot: who transmits when, and who missed its own packets.

A robot's T of a teammate says when that teammate last transmitted, and so which slot of the frame
it owns. A packet also says what its sender knows of the robot that decodes it: if T is as young as
that robot's last packet and P is the sender, then the sender decoded that packet itself. Index
order: row `[i]` is robot i's own memory; slots count from the start of the first frame.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Int8, Int32

from swarm_mj.policies.sotdma.frame import Rule
from swarm_mj.system.compiled import compiled

LONG_AGO = -1_000_000  # before all slots; differences of 32 bits remain exact
NO_PLACE = -1  # the place of a slot that is left to robots in need
MAX_MISSED = 100  # that are counted, in 8 bits
# So that misses are never proof of a collision at once, and so that enough of them are in the end.
MIN_LOSS = 1e-3
MAX_LOSS = 0.9
RECENT_WEIGHT = 0.1  # of the last packet in the share that were decoded


class SlotTable(NamedTuple):
    """The memory of every robot."""

    # Of the frame, in which it believes each to transmit. Before anything is announced others have
    # first slots, which stand here once a choice needs them.
    slots: Int[np.ndarray, "N N"]
    announced: Int[np.ndarray, "N N"]  # when it last knows that each transmitted
    decoded: Int32[np.ndarray, "N N"]  # when it last decoded a packet of each
    got_through: Int32[np.ndarray, "N N"]  # its own last packet that such a packet knew of
    sent: Int[np.ndarray, "N"]  # when it last transmitted itself
    outbound_delivery_ratio: Float[np.ndarray, "N"]  # recent share of its packets that arrived
    judged: Int32[np.ndarray, "N N"]  # the last of its packets of which it learned whether
    missed: Int8[np.ndarray, "N F N"]  # how many of a slot, in a row, a neighbour did not decode
    missed_at: Int32[np.ndarray, "N F"]  # when it last learned so


def empty_table(own: Int[np.ndarray, "N"], num_slots: int) -> SlotTable:
    """Return the memory of robots that have these slots and remember nothing."""
    num_robots = len(own)
    pairs = (num_robots, num_robots)
    return SlotTable(
        slots=np.diag(own),
        announced=np.full(pairs, LONG_AGO),
        decoded=np.full(pairs, LONG_AGO, dtype=np.int32),
        got_through=np.full(pairs, LONG_AGO, dtype=np.int32),
        sent=np.full(num_robots, LONG_AGO),
        outbound_delivery_ratio=np.ones(num_robots),
        judged=np.full(pairs, LONG_AGO, dtype=np.int32),
        missed=np.zeros((num_robots, num_slots, num_robots), dtype=np.int8),
        missed_at=np.full((num_robots, num_slots), LONG_AGO, dtype=np.int32),
    )


@compiled()
def place_of(slot: int, rule: Rule) -> int:
    """Return where in its frame a slot lies, or `NO_PLACE`."""
    if slot % rule.contention_every == rule.contention_every - 1:
        return NO_PLACE
    return (slot - slot // rule.contention_every) % rule.num_slots


@compiled()
def read_slots(table: SlotTable, known: Int[np.ndarray, "N N"], rule: Rule) -> None:
    """Adopt the slots that teammates announced by transmitting in them, the last as i knows."""
    num_robots = known.shape[0]
    for i in range(num_robots):
        for k in range(num_robots):
            if k != i and known[i, k] >= 0 and known[i, k] > table.announced[i, k]:
                place = place_of(known[i, k], rule)
                if place != NO_PLACE:
                    table.announced[i, k] = known[i, k]
                    table.slots[i, k] = place


@compiled()
def read_packets(
    table: SlotTable,
    heard: Int[np.ndarray, "N"],
    known: Int[np.ndarray, "N N"],
    parent: Int[np.ndarray, "N N"],
    slot: int,
    rule: Rule,
) -> None:
    """Note what the packets decoded in this slot, the last, say of the receiver's own.

    T and P of a sender are still those in its packet: a robot that sends decodes nothing.
    """
    for i in range(heard.shape[0]):
        j = heard[i]
        if j == i:
            continue
        table.decoded[i, j] = slot
        table.got_through[i, j] = known[j, i]
        sent = table.sent[i]
        place = place_of(sent, rule)
        # A packet counts once per neighbour, however often that one repeats what it knows.
        is_due = 0 <= sent < slot and table.judged[i, j] < sent
        if place == NO_PLACE or not is_due:
            continue
        table.judged[i, j] = sent
        # T alone may have come through others; P says that j decoded the packet itself.
        got_through = known[j, i] >= sent and parent[j, i] == j
        news = (1.0 if got_through else 0.0) - table.outbound_delivery_ratio[i]
        table.outbound_delivery_ratio[i] += RECENT_WEIGHT * news
        if got_through:
            table.missed[i, place, j] = 0
        else:
            table.missed[i, place, j] = min(table.missed[i, place, j] + 1, MAX_MISSED)
            table.missed_at[i, place] = slot


def marks(table: SlotTable, i: int, slot: int, rule: Rule) -> Bool[np.ndarray, "F N"]:
    """Return who does not decode robot i in which slot of the frame, by what it learned lately.

    Misses in a row that are less probable than the least probability are no chance.
    """
    loss = min(max(1.0 - table.outbound_delivery_ratio[i], MIN_LOSS), MAX_LOSS)
    enough = math.ceil(math.log(rule.min_miss_probability) / math.log(loss))
    is_recent = table.missed_at[i] >= slot - rule.marked_slots
    return (table.missed[i] >= max(1, enough)) & is_recent[:, None]


def are_in_need(
    table: SlotTable,
    known: Int[np.ndarray, "N N"],
    is_near: Bool[np.ndarray, "N N"],
    slot: int,
    rule: Rule,
) -> Bool[np.ndarray, "N"]:
    """Return who lost a neighbour, or hears one that has lost it, by what it knows of the others.

    A neighbour that is silent for too long is gone.
    """
    patience = rule.num_slots * rule.need_frames
    resignation = rule.num_slots * rule.lost_frames
    silent = slot - known
    is_lost = (patience < silent) & (silent <= resignation)
    is_lost_to = table.decoded - table.got_through > patience
    # An older packet says nothing of now: its sender may have heard from the robot since.
    is_lost_to &= table.decoded > slot - patience
    return np.any(is_near & (is_lost | is_lost_to), axis=1)
