"""How a robot chooses its slot, from where it believes all to be and to transmit."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.sotdma.periodic import NOWHERE, Periodic, best_slot, empty_frame, move
from swarm_mj.system.compiled import compiled


class Rule(NamedTuple):
    """What the choices of a team have in common."""

    threshold: float  # least SINR that decodes, linear [1]
    interference: float  # factor
    num_slots: int  # of a frame
    frames: int  # that are simulated
    start_age: float  # of all news when that begins [slots]
    least_gain: float  # of mean age [slots]


@compiled()
def first_slots(
    order: Int[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    power: Float[np.ndarray, "N N"],
    rule: Rule,
) -> Int[np.ndarray, "N"]:
    """Everyone's first slot: the first of the order have one each, the others choose in turn.

    Args:
        order: The robots, in the common order.
        is_known: Whom the robot that reckons knows; it does not work out slots for the others.
        power: Between robots it knows [noise].
        rule: Of the choices.

    Returns:
        The slot of each.
    """
    frame = _empty(power, rule)
    slots = np.zeros(order.shape[0], dtype=np.int64)
    is_marked = np.zeros(frame.transmits.shape, dtype=np.bool_)
    for place in range(order.shape[0]):
        k = order[place]
        slot = place % rule.num_slots
        slots[k] = slot
        if not is_known[k]:
            continue
        if place >= rule.num_slots:
            slot = best_slot(frame, k, 0, 0.0, is_marked)
        move(frame, k, NOWHERE, slot)
        slots[k] = slot
    return slots


@compiled()
def chosen(
    i: int,
    slots: Int[np.ndarray, "N"],
    announced: Int[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    is_marked: Bool[np.ndarray, "F N"],
    chose: Int[np.ndarray, "predicted 2"],
    power: Float[np.ndarray, "N N"],
    rule: Rule,
) -> int:
    """Return the slot that robot i chooses.

    Whoever chose lately and was not heard of since may have moved: i first predicts what it chose.

    Args:
        i: Who chooses.
        slots: Where it believes everyone to transmit; its own is its present one.
        announced: The slot of the mission, not of the frame, in which it last knows of each.
        is_known: Whom it knows.
        is_marked: Who does not decode i in which slot.
        chose: Who chose lately, and in which slot of the mission, the earliest first.
        power: Between robots it knows [noise].
        rule: Of the choices.

    Returns:
        The slot of the frame.
    """
    slots = slots.copy()
    frame = _empty(power, rule)
    for k in range(slots.shape[0]):
        if is_known[k] or k == i:
            move(frame, k, NOWHERE, slots[k])
    no_marks = np.zeros(is_marked.shape, dtype=np.bool_)
    for n in range(chose.shape[0]):
        k, slot = int(chose[n, 0]), int(chose[n, 1])
        if k != i and is_known[k] and announced[k] < slot:
            move(frame, k, slots[k], NOWHERE)
            slots[k] = best_slot(frame, k, slots[k], rule.least_gain, no_marks)
            move(frame, k, NOWHERE, slots[k])
    move(frame, i, slots[i], NOWHERE)
    return best_slot(frame, i, slots[i], rule.least_gain, is_marked)


@compiled()
def _empty(power: Float[np.ndarray, "N N"], rule: Rule) -> Periodic:
    return empty_frame(
        power, rule.threshold, rule.interference, rule.num_slots, rule.frames, rule.start_age
    )
