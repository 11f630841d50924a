"""Frames that repeat: choosing slots by how old the team's information would become.

Index order: `[s, i]` is robot `i` in slot `s` of the frame. Powers are in units of the noise.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Int32, UInt64

from swarm_mj.radio.reception import Incoming, add_packet, decoded
from swarm_mj.radio.spatial_reuse import NOISE
from swarm_mj.system.compiled import compiled

SLOTS_PER_ROOT = 3.2  # of the number of robots, chosen as the numbers of `Rule`
Known = UInt64[np.ndarray, "F"]  # a bit for each robot of a word, in the trial of each slot
NOWHERE = -1  # the slot of a robot that does not transmit
WORD = 64  # robots whose news spreads together, a bit each


class Rule(NamedTuple):
    """The common rule of a team's choices: all numbers, most of them chosen by trial.

    Each is the best of a few that were tried on 8 to 12 missions of 300 windows with seeds from
    1000, mostly of 40 robots, at rest and walking (`training/RESULTS.md`). A round is N slots.
    """

    threshold: float  # least SINR that decodes, linear [1]
    num_slots: int  # of a frame
    first_rounds: int = 3  # of spatial TDMA, before the first frame [rounds]
    frames_per_choice: int = 4  # in which everyone chooses anew once [frames]
    simulated_frames: int = 4  # in a choice; the last one counts [frames]
    start_frames: float = 6.0  # age of all information when that begins [frames]
    min_gain: float = 0.2  # of mean age, that a new slot must be better by [slots]
    interference: float = 1.2  # times what robots believe of it: choices at the edge fail
    predicted_slots: int = 48  # for which choices of unheard robots are predicted [slots]
    marked_slots: int = 200  # for which a slot that a neighbour missed is marked [slots]
    min_miss_probability: float = 0.1  # a miss that is rarer was no chance, and marks its slot
    contention_every: int = 16  # the last of this many slots is no part of the frames [slots]
    contention_probability: float = 0.4  # that a robot in need transmits in it [1]
    need_frames: float = 3.0  # a neighbour not heard for longer is lost [frames]
    lost_frames: float = 12.0  # and one not heard for even longer is gone [frames]


def frame_slots(num_robots: int) -> int:
    """Return how many slots a team's frames have."""
    return max(2, min(num_robots, round(SLOTS_PER_ROOT * math.sqrt(num_robots))))


@compiled()
def choices_before(slot: int, num_robots: int, rule: Rule) -> int:
    """Return how many choices come before a slot: everyone's in turn, as evenly as slots allow."""
    # Not in the first frame, before which nobody has heard how the first slots do.
    period = rule.frames_per_choice * rule.num_slots
    return -(-max(slot, rule.num_slots) * num_robots // period)


class Frame(NamedTuple):
    """A frame as one robot believes it to be."""

    rule: Rule
    power: Float[np.ndarray, "N N"]  # of i's packets at j [noise]
    slot: Int[np.ndarray, "N"]  # in which each transmits, or `NOWHERE`
    heard: Int[np.ndarray, "F N"]  # the sender that j decodes; j itself: none


@compiled()
def empty_frame(power: Float[np.ndarray, "N N"], rule: Rule) -> Frame:
    """Return a frame in which nobody transmits."""
    num_robots = power.shape[0]
    heard = np.zeros((rule.num_slots, 1), dtype=np.int64) + np.arange(num_robots)
    return Frame(rule, power, np.full(num_robots, NOWHERE), heard)


@compiled()
def switch(frame: Frame, s: int, k: int) -> None:
    """Let k transmit in a slot, or no longer, and write what sender each decodes (Eqs. 3-4)."""
    power, heard = frame.power, frame.heard[s]
    frame.slot[k] = NOWHERE if frame.slot[k] == s else s
    senders = np.flatnonzero(frame.slot == s)
    for j in range(power.shape[0]):
        incoming = Incoming(0.0, 0.0, j)
        for i in senders:
            incoming = add_packet(incoming, int(i), power[i, j], power[i, j])
        heard[j] = decoded(incoming, j, NOISE, frame.rule.threshold, factor=frame.rule.interference)
    heard[senders] = senders


@compiled()
def _count(bits: np.uint64) -> np.int64:
    """Return how many bits are set, by sums of neighbouring bits, pairs and nibbles."""
    bits -= bits >> np.uint64(1) & np.uint64(0x5555555555555555)
    pairs = np.uint64(0x3333333333333333)
    bits = (bits & pairs) + (bits >> np.uint64(2) & pairs)
    bits = bits + (bits >> np.uint64(4)) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64(bits * np.uint64(0x0101010101010101) >> np.uint64(56))


@compiled()
def _learn(mine: Known, sent: Known, tried: Known, s: int) -> bool:
    """Add what is heard in slot s, and `tried` in the trial of s; return whether any is news."""
    in_trial = mine[s] | tried[s]
    news = in_trial ^ mine[s]
    for t in range(mine.shape[0]):
        news |= sent[t] & ~mine[t]
        mine[t] |= sent[t]
    mine[s] = in_trial
    return bool(news != 0)


@compiled()
def _weigh(known: Known, weights: Int[np.ndarray, "W F"], weight: Int32[np.ndarray, "F"]) -> None:
    """Fill in the weight of all robots known; a single row of weights is that of each."""
    num_weights = weights.shape[0]
    for t in range(weight.shape[0]):
        weight[t] = weights[0, t] * _count(known[t]) if num_weights == 1 else 0
    for k in range(num_weights if num_weights > 1 else 0):
        for t in range(weight.shape[0]):
            weight[t] += weights[k, t] * np.int64(known[t] >> np.uint64(k) & np.uint64(1))


@compiled()
def _spread(
    frame: Frame,
    tried: Int[np.ndarray, "F N"],
    known: UInt64[np.ndarray, "N F"],
    younger: Int[np.ndarray, "W F"],
    total: Int32[np.ndarray, "F N F"],
) -> None:
    """Add to T in the last frame what robots learn of a word of others, in all trials.

    Frames repeat, so the news of the first spreads as that of any other: a robot that knows it in a
    slot knows a later frame's in the same slot of the last one. So what it knows in a slot makes T
    a frame younger in the last frame, and in that frame itself younger than the start.
    """
    num_slots, num_robots = tried.shape
    last = (frame.rule.simulated_frames - 1) * num_slots
    weight = np.empty(known.shape, dtype=np.int32)
    weights = np.full((1, num_slots), num_slots)
    for n in range(last + num_slots):
        s, weights = n % num_slots, younger if n >= last else weights
        for i in range(num_robots):
            # In place: a robot that transmits decodes nothing, so its row is as it was sent.
            j, k = frame.heard[s, i], tried[s, i]
            is_news = (j != i or k != i) and _learn(known[i], known[j], known[k], s)
            if is_news or n in (0, last):
                _weigh(known[i], weights, weight[i])
            for t in range(num_slots):
                total[s, i, t] += weight[i, t]


@compiled()
def mean_ages(
    frame: Frame, tried: Int[np.ndarray, "F N"], slots: Int[np.ndarray, "N F"]
) -> Float[np.ndarray, "F"]:
    """Return the mean age in the last of the frames simulated, in the trial of each slot [slots].

    Robots transmit in these `slots` of all trials, and decode whom they do in `tried` in its slot.
    """
    (num_slots, num_robots), rule = tried.shape, frame.rule
    last, start = (rule.simulated_frames - 1) * num_slots, int(rule.start_frames * num_slots)
    total = np.zeros((num_slots, num_robots, num_slots), dtype=np.int32)
    for first in range(0, num_robots, WORD):
        known = np.zeros(slots.shape, dtype=np.uint64)
        for i in range(first, min(first + WORD, num_robots)):
            for t in range(num_slots):
                known[i, t] = np.uint64(slots[i, t] != NOWHERE) << np.uint64(i - first)
        _spread(frame, tried, known, slots[first : first + WORD] + (1 + start), total)
    # A robot observes itself all the time, and all others at the start.
    rest = (slots == NOWHERE) * (last + start) - slots - num_robots * start
    ages = np.zeros(num_slots)
    for s in range(num_slots):
        for i in range(num_robots):
            for t in range(num_slots):
                ages[t] += last + s + 1 - (total[s, i, t] + rest[i, t] + s) / num_robots
    return ages / (num_slots * num_robots)


@compiled()
def best_slot(
    frame: Frame, k: int, own: int, min_gain: float, is_marked: Bool[np.ndarray, "F N"]
) -> int:
    """Return the slot in which k's packets keep the team's information youngest.

    The frame is that of all others, and remains so. The robot keeps its own slot unless another is
    better by the least gain [slots]. A marked robot does not decode k in that slot.
    """
    tried, slots = np.empty_like(frame.heard), np.empty(frame.heard.shape[::-1], dtype=np.int64)
    for s in range(tried.shape[0]):
        switch(frame, s, k)
        slots[:, s] = frame.slot
        for j in range(tried.shape[1]):
            is_deaf = frame.heard[s, j] == k and is_marked[s, j]
            tried[s, j] = j if is_deaf else frame.heard[s, j]
        switch(frame, s, k)
    ages = mean_ages(frame, tried, slots)
    # A move makes teammates' beliefs wrong until they hear of it, so small gains do not count.
    ages[own] -= min_gain
    return int(np.argmin(ages))


@compiled()
def first_slots(
    order: Int[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    power: Float[np.ndarray, "N N"],
    rule: Rule,
) -> Int[np.ndarray, "N"]:
    """Return all first slots: the first of the order have one each, the others choose in turn.

    A robot that works this out does not choose for robots that it does not know.
    """
    frame = empty_frame(power, rule)
    slots = np.zeros(order.shape[0], dtype=np.int64)
    no_marks = np.zeros(frame.heard.shape, dtype=np.bool_)
    for place in range(order.shape[0]):
        k = order[place]
        slots[k] = place % rule.num_slots
        if is_known[k]:
            if place >= rule.num_slots:
                slots[k] = best_slot(frame, k, int(slots[k]), 0.0, no_marks)
            switch(frame, int(slots[k]), k)
    return slots


@compiled()
def chosen(
    i: int,
    slots: Int[np.ndarray, "N"],
    announced: Int[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    is_marked: Bool[np.ndarray, "F N"],
    order: Int[np.ndarray, "N"],
    slot: int,
    power: Float[np.ndarray, "N N"],
    rule: Rule,
) -> int:
    """Return the slot of the frame that robot i chooses, who believes the others in these slots.

    Robots that chose lately, before this slot of the mission, and did not announce one since may
    have moved: i first predicts their choices.
    """
    num_robots, slots = slots.shape[0], slots.copy()
    frame = empty_frame(power, rule)
    for k in range(num_robots):
        if is_known[k] or k == i:
            switch(frame, slots[k], k)
    no_marks = np.zeros(is_marked.shape, dtype=np.bool_)
    lately = choices_before(slot - rule.predicted_slots, num_robots, rule)
    for n in range(lately, choices_before(slot, num_robots, rule)):
        k = int(order[n % num_robots])
        chose = n * rule.frames_per_choice * rule.num_slots // num_robots
        if k != i and is_known[k] and announced[k] < chose:
            # Marks are private, so a prediction has to do without those of k.
            switch(frame, slots[k], k)
            slots[k] = best_slot(frame, k, slots[k], rule.min_gain, no_marks)
            switch(frame, slots[k], k)
    switch(frame, slots[i], i)
    return best_slot(frame, i, slots[i], rule.min_gain, is_marked)
