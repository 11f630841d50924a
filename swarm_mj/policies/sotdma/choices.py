"""Choices of slots: the one in which a robot's packets keep the team's information youngest.

Index order: `[s, i]` is robot `i` in slot `s` of the frame. Powers are in units of the noise.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from swarm_mj.policies.sotdma.frame import (
    Frame,
    Rule,
    add,
    empty_frame,
    mean_age,
    mean_ages,
    remove,
)
from swarm_mj.system.compiled import compiled

Marks = Bool[np.ndarray, "F N"]  # who counts as deaf to one robot in each slot
TIE = 1e-8  # mean ages that differ by less are equal [slots]


@compiled()
def choices_before(slot: int, num_robots: int, rule: Rule) -> int:
    """Return how many choices come before a slot: everyone's in turn, as evenly as slots allow."""
    # Not in the first frame, before which nobody has heard how the first slots do.
    period = rule.frames_per_choice * rule.num_slots
    return -(-max(slot, rule.num_slots) * num_robots // period)


@compiled()
def best_slot(frame: Frame, k: int, own: int, min_gain: float, is_marked: Marks) -> int:
    """Return the slot in which k's packets keep the team's information youngest.

    The frame is that of all others, and remains so. The robot keeps its own slot unless another is
    better by the least gain [slots]. A marked robot does not decode k in that slot.
    """
    # k moves from slot to slot, and leaves behind in each whom everyone decodes with k in it.
    trials = Frame(frame.rule, frame.power, frame.slot.copy(), frame.heard.copy())
    tried = trials.heard
    for s in range(tried.shape[0]):
        add(trials, s, k)
        for j in range(tried.shape[1]):
            if tried[s, j] == k and is_marked[s, j]:
                tried[s, j] = j
    ages = mean_ages(frame, tried, k)
    # A move makes teammates' beliefs wrong until they hear of it, so small gains do not count.
    ages[own] -= min_gain
    is_best = ages <= np.min(ages) + TIE
    # Between equals, rounding decides: that of `mean_age`, by which they are still in some order.
    if np.sum(is_best) > 1:
        for s in range(ages.shape[0]):
            if is_best[s]:
                ages[s] = mean_age(frame, tried, s)
                if s == own:
                    ages[s] -= min_gain
    return int(np.argmin(ages))


@compiled()
def work_out_slots(
    slots: Int[np.ndarray, "N"],
    done: int,
    num: int,
    order: Int[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    power: Float[np.ndarray, "N N"],
    rule: Rule,
) -> None:
    """Fill in the first slots of the first `num` of the order, of whom `done` have theirs.

    The first of the order have one slot each, the others choose in turn. A robot that works this
    out does not choose for robots that it does not know.
    """
    frame = empty_frame(power, rule)
    for place in range(done):
        k = order[place]
        if is_known[k]:
            add(frame, int(slots[k]), k)
    no_marks = np.zeros(frame.heard.shape, dtype=np.bool_)
    for place in range(done, num):
        k = order[place]
        slots[k] = place % rule.num_slots
        if is_known[k]:
            if place >= rule.num_slots:
                slots[k] = best_slot(frame, k, int(slots[k]), 0.0, no_marks)
            add(frame, int(slots[k]), k)


@compiled()
def chosen(
    i: int,
    slots: Int[np.ndarray, "N"],
    announced: Int[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    is_marked: Marks,
    order: Int[np.ndarray, "N"],
    slot: int,
    power: Float[np.ndarray, "N N"],
    rule: Rule,
) -> int:
    """Return the slot of the frame that robot i chooses, who believes the others in these slots.

    Robots that chose lately, before this slot of the mission, and did not announce one since may
    have moved: i first predicts their choices.
    """
    num_robots = slots.shape[0]
    slots = slots.copy()  # those of others change as their choices are predicted
    frame = empty_frame(power, rule)
    for k in range(num_robots):
        if is_known[k] or k == i:
            add(frame, slots[k], k)
    no_marks = np.zeros(is_marked.shape, dtype=np.bool_)
    lately = choices_before(slot - rule.predicted_slots, num_robots, rule)
    for n in range(lately, choices_before(slot, num_robots, rule)):
        k = int(order[n % num_robots])
        chose = n * rule.frames_per_choice * rule.num_slots // num_robots
        if k != i and is_known[k] and announced[k] < chose:
            # Marks are private, so a prediction has to do without those of k.
            remove(frame, k)
            slots[k] = best_slot(frame, k, slots[k], rule.min_gain, no_marks)
            add(frame, slots[k], k)
    remove(frame, i)
    return best_slot(frame, i, slots[i], rule.min_gain, is_marked)
