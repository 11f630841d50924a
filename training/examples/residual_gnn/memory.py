"""What every robot remembers of the others: what they know, and how well it receives them.

A robot that decodes a packet knows all that its sender knew. What the sender learns afterwards can
be predicted from who is believed to transmit. Index order: `[b, i, j]` is what robot `i` of
mission `b` believes of robot `j`. Times are ticks: a slot's tick is its number, counted from 1.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32

from residual_gnn.receptions import (
    NOBODY,
    PredictedReceptions,
    decoded_by,
    empty_receptions,
    predict_receptions,
)
from swarm_mj.radio.power_law import PowerLaw, write_powers
from swarm_mj.system.compiled import compiled

RECENT = 0.15  # the weight of the last packet in a share of packets
FIRST_SHARE = 0.8  # before there was one


class Memory(NamedTuple):
    """The memories of all robots of B missions."""

    held: Int32[np.ndarray, "B N N N"]  # [b, i, j, k]: when k observed what j knows of k, or 0
    decoded: Int32[np.ndarray, "B N N"]  # when i last decoded a packet of j, or 0
    sent: Int32[np.ndarray, "B N"]  # when i last transmitted, or 0
    heard: Int32[np.ndarray, "B N"]  # when i last decoded anything, or 0
    inbound_ratio: Float32[np.ndarray, "B N N"]  # recent share of j's due packets that i decoded
    outbound_ratio: Float32[np.ndarray, "B N N"]  # and of i's that j knew of when i heard it next
    out_of_range: Float32[np.ndarray, "B N"]  # recent share of decoded packets from out of range


def empty_memory(num_missions: int, num_robots: int) -> Memory:
    """Return the memories of robots that have heard nothing."""
    pairs = (num_missions, num_robots, num_robots)
    return Memory(
        held=np.zeros((*pairs, num_robots), dtype=np.int32),
        decoded=np.zeros(pairs, dtype=np.int32),
        sent=np.zeros(pairs[:2], dtype=np.int32),
        heard=np.zeros(pairs[:2], dtype=np.int32),
        inbound_ratio=np.full(pairs, FIRST_SHARE, dtype=np.float32),
        outbound_ratio=np.full(pairs, FIRST_SHARE, dtype=np.float32),
        out_of_range=np.zeros(pairs[:2], dtype=np.float32),
    )


@compiled()
def note_slot(
    memory: Memory,
    tick: Int[np.ndarray, "B"],
    observed: Int32[np.ndarray, "B N N"],
    is_known: Bool[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N 2"],
    is_due: Bool[np.ndarray, "B N N"],
    transmitted: Bool[np.ndarray, "B N"],
    heard: Int[np.ndarray, "B N"],
    law: PowerLaw,
    threshold: float,
) -> None:
    """Update the memories with a slot that has passed.

    Args:
        memory: Written in place.
        tick: The slot's.
        observed: T of everyone after it, in ticks; of a sender, what its packet said.
        is_known: Whom each robot has heard of.
        position_m: Where each robot believes the others to be [m].
        is_due: Who each robot believed would transmit in it, by the rule.
        transmitted: Who did.
        heard: Whom each robot decoded; itself is nobody.
        law: Of the powers that are believed in [noise].
        threshold: Least SINR that decodes, linear [1].
    """
    num_missions, num_robots = transmitted.shape
    predicted, believed = empty_receptions(num_robots), np.zeros(num_robots, dtype=np.bool_)
    for b in range(num_missions):
        for i in range(num_robots):
            sender = int(heard[b, i]) if heard[b, i] != i else NOBODY
            for o in range(num_robots):
                believed[o] = o != i and is_due[b, i, o] and is_known[b, i, o]
            if not transmitted[b, i]:
                predict_receptions(believed, position_m[b, i], law, predicted)
                _judge(memory.inbound_ratio[b, i], decoded_by(i, predicted, 0.0, threshold), sender)
            if sender != NOBODY:
                _read_packet(memory, b, i, sender, int(tick[b]), observed[b, sender])
                believed[sender] = True
            believed[i] = transmitted[b, i]
            predict_receptions(believed, position_m[b, i], law, predicted)
            write_powers(i, position_m[b, i], law, predicted.power)
            _pass_on(
                i,
                sender,
                memory.held[b, i],
                observed[b, i],
                is_known[b, i],
                believed,
                threshold,
                predicted,
            )
            if sender != NOBODY:  # links are alike in both directions, as far as i knows
                is_far = is_known[b, i, sender] and predicted.power[sender] < threshold
                _count(memory.out_of_range[b], i, is_far)
            if transmitted[b, i]:
                memory.sent[b, i] = tick[b]


@compiled()
def _count(share: Float32[np.ndarray, "N"], place: int, is_so: bool) -> None:
    """Move a share towards the last outcome."""
    share[place] += RECENT * ((1.0 if is_so else 0.0) - share[place])


@compiled()
def _judge(share: Float32[np.ndarray, "N"], due: int, sender: int) -> None:
    """Count whether the packet was decoded that should have been, if any."""
    if due != NOBODY:
        _count(share, due, sender == due)


@compiled()
def _read_packet(
    memory: Memory, b: int, i: int, sender: int, now: int, sent: Int32[np.ndarray, "N"]
) -> None:
    """Take over what i decoded: all that the sender knows, and whether it had i's last packet."""
    last = memory.sent[b, i]
    if last > 0 and memory.decoded[b, i, sender] < last:
        _count(memory.outbound_ratio[b, i], sender, sent[i] >= last)
    memory.held[b, i, sender] = sent
    memory.decoded[b, i, sender], memory.heard[b, i] = now, now


@compiled()
def _pass_on(
    i: int,
    sender: int,
    held: Int32[np.ndarray, "N N"],
    observed: Int32[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    transmits: Bool[np.ndarray, "N"],
    threshold: float,
    predicted: PredictedReceptions,
) -> None:
    """Let neighbours that should have decoded a packet know what its sender is believed to know.

    Of a sender that i did not decode itself, that is what i last believed: not that it has just
    observed itself.
    """
    for j in range(held.shape[0]):
        is_near = is_known[j] and predicted.power[j] >= threshold
        if transmits[j] or not is_near or j in (i, sender):
            continue
        o = decoded_by(j, predicted, 0.0, threshold)
        if o == NOBODY:
            continue
        sent = observed if o == i else held[o]
        for k in range(held.shape[1]):
            held[j, k] = max(held[j, k], sent[k])
