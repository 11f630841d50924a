"""Frames that repeat: choosing slots by how old the team's information would become.

Index order: `[s, i]` is robot `i` in slot `s` of the frame. Powers are in units of the noise.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, UInt64

from swarm_mj.protocol.timestamps import merge_timestamps, observe_own
from swarm_mj.radio.reception import add_to_air, decoded, incoming_at, silent_air
from swarm_mj.radio.spatial_reuse import NOISE
from swarm_mj.system.compiled import compiled

SLOTS_PER_ROOT = 3.2  # of the number of robots, chosen as the numbers of `Rule`
Known = UInt64[np.ndarray, "C"]  # a bit for each robot of a word, in the trial of each slot
Words = UInt64[np.ndarray, "R C"]  # rows of them
Heard = Int[np.ndarray, "F N"]  # the sender that j decodes in each slot; j itself: none
Marks = Bool[np.ndarray, "F N"]  # who counts as deaf to one robot in each slot
NOWHERE = -1  # the slot of a robot that does not transmit
TIE = 1e-8  # mean ages that differ by less are equal [slots]
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
    num_robots = frame.slot.shape[0]
    rule = frame.rule
    air = silent_air(num_robots)
    frame.slot[k] = NOWHERE if frame.slot[k] == s else s
    for i in range(num_robots):
        if frame.slot[i] != s:
            continue
        for j in range(num_robots):
            # A robot that transmits in the slot decodes nothing.
            signal = 0.0 if frame.slot[j] == s else frame.power[i, j]
            add_to_air(air, i, j, signal, frame.power[i, j])
    for j in range(num_robots):
        incoming = incoming_at(air, j)
        frame.heard[s, j] = decoded(incoming, j, NOISE, rule.threshold, rule.interference)


@compiled()
def _count(bits: np.uint64) -> np.int64:
    """Return how many bits are set, by sums of neighbouring bits, pairs and nibbles."""
    bits -= bits >> np.uint64(1) & np.uint64(0x5555555555555555)
    pairs = np.uint64(0x3333333333333333)
    bits = (bits & pairs) + (bits >> np.uint64(2) & pairs)
    bits = bits + (bits >> np.uint64(4)) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64(bits * np.uint64(0x0101010101010101) >> np.uint64(56))


@compiled()
def _learn(mine: Known, sent: Known, tried: Known, s: int, num_slots: int, news: Known) -> bool:
    """Add what is heard in slot s, and `tried` in the trial of s; return whether any is `news`."""
    found = np.uint64(0)
    for c in range(mine.shape[0]):
        news[c] = sent[c] & ~mine[c]
        mine[c] |= news[c]
        found |= news[c]
    for c in range(s, mine.shape[0], num_slots):
        mine[c] ^= news[c]  # as it was before, also in `tried` if that is the same row
        news[c] = tried[c] & ~mine[c]
        mine[c] |= news[c]
        found |= news[c]
    return bool(found != 0)


@compiled()
def _weigh(known: Known, value: Words, times: int, gained: Int[np.ndarray, "C"]) -> None:
    """Add the value of all robots known, of which row p has the bits of 2 ** p, times a number."""
    for p in range(value.shape[0]):
        for c in range(known.shape[0]):
            gained[c] += (times << p) * _count(known[c] & value[p, c])


@compiled()
def _spread(frame: Frame, tried: Heard, known: Words, younger: Words) -> Int[np.ndarray, "C"]:
    """Return the rise of T, summed over the last frame, by all that robots learn in all trials.

    Frames repeat, so the news of the first spreads as that of any other: a robot that knows it in a
    slot knows a later frame's in the same slot of the last one. So what it knows in a slot makes T
    a frame younger in the last frame, and in that frame itself younger than the start.
    """
    num_slots, num_robots = tried.shape
    num_columns = known.shape[1]
    last = (frame.rule.simulated_frames - 1) * num_slots  # the first slot of the last frame
    news = np.empty(num_columns, np.uint64)
    each = ~np.zeros((1, num_columns), np.uint64)
    gained = np.zeros(num_columns, np.int64)
    for n in range(last + num_slots):
        s = n % num_slots
        # Before the last frame, news makes all of that frame younger, no matter of whom. Within it,
        # the slots that have passed are taken off what is added for the whole frame in the end.
        if n < last:
            value = each
            times = num_slots * (last - n)
        else:
            value = younger
            times = last - n
        for i in range(num_robots):
            # In place: a robot that transmits decodes nothing, so its row is as it was sent.
            j = frame.heard[s, i]
            k = tried[s, i]
            if (j != i or k != i) and _learn(known[i], known[j], known[k], s, num_slots, news):
                _weigh(news, value, times, gained)
    for i in range(num_robots):
        _weigh(known[i], younger, num_slots, gained)
    return gained


@compiled()
def mean_ages(frame: Frame, tried: Heard, own: int) -> Float[np.ndarray, "F"]:
    """Return the mean age in the last frame if `own` is heard as `tried` in each slot [slots]."""
    num_slots, num_robots = tried.shape
    start = int(frame.rule.start_frames * num_slots)
    num_columns = -(-num_robots // WORD) * num_slots
    known = np.zeros((num_robots, num_columns), np.uint64)
    rest = np.zeros(num_slots)
    younger = np.zeros((int(math.log2(start + num_slots)) + 1, num_columns), np.uint64)
    for i in range(num_robots):
        if i != own and frame.slot[i] == NOWHERE:
            continue
        for t in range(num_slots):
            c = i // WORD * num_slots + t
            bit = np.uint64(i % WORD)
            by = (t if i == own else frame.slot[i]) + 1 + start
            known[i, c] = np.uint64(1) << bit
            rest[t] += num_slots * by  # of oneself, who is of now anyway
            for p in range(younger.shape[0]):
                younger[p, c] |= np.uint64(by >> p & 1) << bit
    gained = _spread(frame, tried, known, younger).reshape(-1, num_slots).sum(axis=0) - rest
    # Where nobody hears of others, these remain as old as they are at the start.
    alone = start + num_slots * (frame.rule.simulated_frames - 0.5) + 0.5
    return alone * (num_robots - 1) / num_robots - gained / (num_slots * num_robots**2)


@compiled()
def _rounded_age(frame: Frame, tried: Heard, trial: int) -> float:
    """Return the mean age of a trial as `mean_ages` does, but summed up robot by robot."""
    num_slots, num_robots = tried.shape
    total = 0.0
    last = (frame.rule.simulated_frames - 1) * num_slots
    timestamp = np.full((num_robots, num_robots), -float(int(frame.rule.start_frames * num_slots)))
    for n in range(last + num_slots):
        s = n % num_slots
        observe_own(timestamp, n + 1.0)
        merge_timestamps(timestamp, tried[s] if s == trial else frame.heard[s], timestamp)
        if n >= last:
            for i in range(num_robots):
                total += n + 1 - np.sum(timestamp[i]) / num_robots
    return total / (num_slots * num_robots)


@compiled()
def best_slot(frame: Frame, k: int, own: int, min_gain: float, is_marked: Marks) -> int:
    """Return the slot in which k's packets keep the team's information youngest.

    The frame is that of all others, and remains so. The robot keeps its own slot unless another is
    better by the least gain [slots]. A marked robot does not decode k in that slot.
    """
    trials = Frame(frame.rule, frame.power, frame.slot.copy(), frame.heard.copy())
    tried = trials.heard
    for s in range(tried.shape[0]):
        switch(trials, s, k)
        for j in range(tried.shape[1]):
            is_deaf = tried[s, j] == k and is_marked[s, j]
            tried[s, j] = j if is_deaf else tried[s, j]
    ages = mean_ages(frame, tried, k)
    # A move makes teammates' beliefs wrong until they hear of it, so small gains do not count.
    ages[own] -= min_gain
    is_best = ages <= np.min(ages) + TIE
    # Between equals, rounding decides: that of the sum over all robots, one after the other.
    if np.sum(is_best) > 1:
        for s in range(ages.shape[0]):
            if is_best[s]:
                ages[s] = _rounded_age(frame, tried, s)
                if s == own:
                    ages[s] -= min_gain
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
    slots = slots.copy()
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
