"""Frames that repeat: choosing slots by how old the team's information would become.

Index order: `[s, i]` is robot `i` in slot `s` of the frame. Powers are in units of the noise.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.radio.reception import Incoming, add_packet, decoded
from swarm_mj.radio.spatial_reuse import NOISE
from swarm_mj.system.compiled import compiled

SLOTS_PER_ROOT = 3.2  # of the number of robots, chosen as the numbers of `Rule`


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


class Choices(NamedTuple):
    """Choices that robots made, the earliest first."""

    robot: Int[np.ndarray, "C"]
    slot: Int[np.ndarray, "C"]  # of the mission, in which it chose


def frame_slots(num_robots: int) -> int:
    """Return how many slots a team's frames have."""
    return max(2, min(num_robots, round(SLOTS_PER_ROOT * math.sqrt(num_robots))))


class Frame(NamedTuple):
    """A frame as one robot believes it to be, with room to simulate it."""

    rule: Rule
    power: Float[np.ndarray, "N N"]  # of i's packets at j [noise]
    transmits: Bool[np.ndarray, "F N"]
    heard: Int[np.ndarray, "F N"]  # the sender that j decodes; j itself: none
    timestamp: Float32[np.ndarray, "N N"]  # T in the simulation [slots]


@compiled()
def empty_frame(power: Float[np.ndarray, "N N"], rule: Rule) -> Frame:
    """Return a frame in which nobody transmits."""
    num_robots = power.shape[0]
    heard = np.empty((rule.num_slots, num_robots), dtype=np.int64)
    for s in range(rule.num_slots):
        for j in range(num_robots):
            heard[s, j] = j
    transmits = np.zeros(heard.shape, dtype=np.bool_)
    return Frame(rule, power, transmits, heard, np.empty(power.shape, dtype=np.float32))


@compiled()
def switch(frame: Frame, s: int, k: int) -> None:
    """Let k transmit in a slot, or no longer, and write what sender each decodes (Eqs. 3-4)."""
    power, heard = frame.power, frame.heard[s]
    frame.transmits[s, k] = not frame.transmits[s, k]
    for j in range(power.shape[0]):
        incoming = Incoming(0.0, 0.0, j)
        for i in range(power.shape[0]):
            if frame.transmits[s, i] and i != j:
                incoming = add_packet(incoming, i, power[i, j], power[i, j])
        heard[j] = decoded(incoming, j, NOISE, frame.rule.threshold, factor=frame.rule.interference)
        if frame.transmits[s, j]:
            heard[j] = j


# Maxima and sums in any order let the compiler use its vectors; whole slots add up exactly.
@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _merge(held: Float32[np.ndarray, "N"], sent: Float32[np.ndarray, "N"]) -> None:
    for k in range(held.shape[0]):
        held[k] = max(held[k], sent[k])


@compiled(fastmath={"reassoc", "nnan", "nsz"})
def _sum(row: Float32[np.ndarray, "N"]) -> np.floating:
    total = np.float32(0.0)
    for k in range(row.shape[0]):
        total += row[k]
    return total


@compiled()
def mean_age(frame: Frame) -> float:
    """Return the mean age of information in the last of the frames simulated [slots]."""
    heard, timestamp = frame.heard, frame.timestamp
    num_slots, num_robots = heard.shape
    timestamp[...] = -frame.rule.start_frames * num_slots
    now, age = np.float32(0.0), 0.0
    for n in range(frame.rule.simulated_frames * num_slots):
        now += np.float32(1.0)
        for i in range(num_robots):
            timestamp[i, i] = now
        for j in range(num_robots):
            sender = heard[n % num_slots, j]
            # In place: a robot that transmits decodes nothing, so its row is as it was sent.
            if sender != j:
                _merge(timestamp[j], timestamp[sender])
        if n >= (frame.rule.simulated_frames - 1) * num_slots:
            for i in range(num_robots):
                age += now - _sum(timestamp[i]) / num_robots
    return age / (num_slots * num_robots)


@compiled()
def best_slot(
    frame: Frame, k: int, own: int, min_gain: float, is_marked: Bool[np.ndarray, "F N"]
) -> int:
    """Return the slot in which k's packets keep the team's information youngest.

    The frame is that of all others, and remains so. The robot keeps its own slot unless another is
    better by the least gain [slots]. A marked robot does not decode k in that slot.
    """
    num_slots, num_robots = frame.heard.shape
    before = np.empty(num_robots, dtype=np.int64)
    best, least = own, np.inf
    for s in range(num_slots):
        for j in range(num_robots):
            before[j] = frame.heard[s, j]
        switch(frame, s, k)
        for j in range(num_robots):
            if frame.heard[s, j] == k and is_marked[s, j]:
                frame.heard[s, j] = j
        # A move makes teammates' beliefs wrong until they hear of it, so small gains do not count.
        age = mean_age(frame) - (min_gain if s == own else 0.0)
        if age < least:
            best, least = s, age
        # Restored rather than received anew, which would cost as much as the trial.
        frame.transmits[s, k] = False
        for j in range(num_robots):
            frame.heard[s, j] = before[j]
    return best


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
    no_marks = np.zeros(frame.transmits.shape, dtype=np.bool_)
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
    chose: Choices,
    power: Float[np.ndarray, "N N"],
    rule: Rule,
) -> int:
    """Return the slot of the frame that robot i chooses, who believes the others in these slots.

    Robots that chose lately (in which slot of the mission, the earliest first) and did not announce
    a slot since may have moved: i first predicts their choices.
    """
    slots = slots.copy()
    frame = empty_frame(power, rule)
    for k in range(slots.shape[0]):
        if is_known[k] or k == i:
            switch(frame, slots[k], k)
    no_marks = np.zeros(is_marked.shape, dtype=np.bool_)
    for n in range(len(chose.robot)):
        k = int(chose.robot[n])
        if k != i and is_known[k] and announced[k] < chose.slot[n]:
            # Marks are private, so a prediction has to do without those of k.
            switch(frame, slots[k], k)
            slots[k] = best_slot(frame, k, slots[k], rule.min_gain, no_marks)
            switch(frame, slots[k], k)
    switch(frame, slots[i], i)
    return best_slot(frame, i, slots[i], rule.min_gain, is_marked)
