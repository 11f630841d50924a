"""Frames that repeat: who hears whom in them, and how old that keeps the team's information.

`mean_age` says what the age of a frame is, and `mean_ages` finds it for many frames at once. Index
order: `[s, i]` is robot `i` in slot `s` of the frame. Powers are in units of the noise.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, UInt64

from swarm_mj.protocol.timestamps import merge_timestamps, observe_own
from swarm_mj.radio.reception import add_to_air, decoded, incoming_at, silent_air
from swarm_mj.radio.spatial_reuse import NOISE
from swarm_mj.system.compiled import compiled

SLOTS_PER_ROOT = 3.2  # of the number of robots, chosen as the numbers of `Rule`
Heard = Int[np.ndarray, "F N"]  # the sender that j decodes in each slot; j itself: none
NOWHERE = -1  # the slot of a robot that does not transmit


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


class Frame(NamedTuple):
    """A frame as one robot believes it to be."""

    rule: Rule
    power: Float[np.ndarray, "N N"]  # of i's packets at j [noise]
    slot: Int[np.ndarray, "N"]  # in which each transmits, or `NOWHERE`
    heard: Heard  # by these slots


@compiled()
def empty_frame(power: Float[np.ndarray, "N N"], rule: Rule) -> Frame:
    """Return a frame in which nobody transmits."""
    num_robots = power.shape[0]
    heard = np.zeros((rule.num_slots, 1), dtype=np.int64) + np.arange(num_robots)
    return Frame(rule, power, np.full(num_robots, NOWHERE), heard)


@compiled()
def add(frame: Frame, s: int, k: int) -> None:
    """Let k transmit in a slot, and write whom everyone decodes there.

    Whom everyone decodes in the slot that k had before remains as it was.
    """
    frame.slot[k] = s
    _listen(frame, s)


@compiled()
def remove(frame: Frame, k: int) -> None:
    """Let k transmit no longer, and write whom everyone decodes in the slot that it had."""
    s = frame.slot[k]
    frame.slot[k] = NOWHERE
    _listen(frame, s)


@compiled()
def _listen(frame: Frame, s: int) -> None:
    """Write whom everyone decodes in a slot (Eqs. 3-4)."""
    rule = frame.rule
    num_robots = frame.slot.shape[0]
    air = silent_air(num_robots)
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
def mean_age(frame: Frame, tried: Heard, trial: int) -> float:
    """Return the mean age in the last frame if one slot of each is heard as tried [slots].

    All begin with information as old as `start_frames`, and merge what they hear slot by slot.
    """
    num_slots, num_robots = tried.shape
    last = (frame.rule.simulated_frames - 1) * num_slots  # the first slot of the last frame
    timestamp = np.full((num_robots, num_robots), -float(_start(frame)))
    total = 0.0
    for n in range(last + num_slots):
        s = n % num_slots
        heard = tried[s] if s == trial else frame.heard[s]
        observe_own(timestamp, n + 1.0)
        # In place: a robot that transmits decodes nothing, so its row is as it was sent.
        merge_timestamps(timestamp, heard, timestamp)
        if n >= last:
            for i in range(num_robots):
                total += n + 1 - np.sum(timestamp[i]) / num_robots
    return total / (num_slots * num_robots)


@compiled()
def _start(frame: Frame) -> int:
    """Return how old all information is when the first frame begins [slots]."""
    return int(frame.rule.start_frames * frame.rule.num_slots)


# The mean ages of all trials, one for each slot of the frame, take too long in the way above. They
# follow from less than all timestamps, since frames repeat. Each robot k transmits once in a frame
# of S slots. If i first learns in slot n what k's first packet said, then it learns in slot n + S
# what k said a frame later, and so on. So all that has to be found is this slot n, for each pair
# and trial, by spreading the news of the first frame: does i have it yet, or not?
#
# These are bits: of 64 subjects k at a time in a word, which a robot that hears another merges with
# a single `or`. Row i is what robot i knows, and column w S + t is what it knows of the w-th 64
# subjects in the trial of slot t. Subjects are the robots that transmit.
WORD = 64  # subjects in a word
KnownBits = UInt64[np.ndarray, "C"]  # of one robot
Words = UInt64[np.ndarray, "R C"]  # rows of them


@compiled()
def mean_ages(frame: Frame, tried: Heard, own: int) -> Float[np.ndarray, "F"]:
    """Return the mean age in the last frame if `own` is heard as `tried` in each slot [slots].

    The same as `mean_age` of each trial, to rounding. In the trial of slot t, `own` has slot t.
    """
    num_slots, num_robots = tried.shape
    start = _start(frame)
    num_subjects = np.sum(frame.slot != NOWHERE) + (frame.slot[own] == NOWHERE)
    num_columns = -(-num_subjects // WORD) * num_slots
    known = np.zeros((num_robots, num_columns), np.uint64)
    # What k's first packet makes T of k younger by, in binary: row p has the digits of 2 ** p.
    num_digits = int(math.log2(start + num_slots)) + 1
    younger = np.zeros((num_digits, num_columns), np.uint64)
    of_itself = np.zeros(num_slots)
    subject = -1
    for k in range(num_robots):
        if k != own and frame.slot[k] == NOWHERE:
            continue
        subject += 1
        bit = np.uint64(1) << np.uint64(subject % WORD)
        for t in range(num_slots):
            c = subject // WORD * num_slots + t
            slot = t if k == own else frame.slot[k]
            by = slot + 1 + start
            known[k, c] = bit
            of_itself[t] += num_slots * by
            for p in range(num_digits):
                if by >> p & 1:
                    younger[p, c] |= bit
    # Taken off again: a robot knows of itself what is of now, not what its last packet said.
    gained = _spread(frame, tried, known, younger).reshape(-1, num_slots).sum(axis=0) - of_itself
    # Where nobody hears of others, these remain as old as they are at the start.
    alone = start + num_slots * (frame.rule.simulated_frames - 0.5) + 0.5
    return alone * (num_robots - 1) / num_robots - gained / (num_slots * num_robots**2)


@compiled()
def _spread(frame: Frame, tried: Heard, known: Words, younger: Words) -> Int[np.ndarray, "C"]:
    """Return the rise of T, summed over the last frame, by all that robots learn in all trials.

    Let the last frame begin with slot L. What k's first packet said makes T younger in all slots of
    the last frame from n on, and what it said in later frames makes T younger by S each. Summed
    over the last frame, the latter is S (L - n) if n is before L, and nothing otherwise.
    """
    num_slots, num_robots = tried.shape
    num_columns = known.shape[1]
    last = (frame.rule.simulated_frames - 1) * num_slots  # L
    everyone = ~np.zeros((1, num_columns), np.uint64)  # the number 1 of each subject, in binary
    news = np.empty(num_columns, np.uint64)
    gained = np.zeros(num_columns, np.int64)
    learned_in = np.full(num_robots, -1)  # the last slot in which each learned anything
    for n in range(last + num_slots):
        s = n % num_slots
        if n < last:
            value = everyone
            times = num_slots * (last - n)
        else:
            # The slots of the last frame that have passed are taken off what is added for all of
            # them in the end.
            value = younger
            times = last - n
        for i in range(num_robots):
            # In place: a robot that transmits decodes nothing, so its row is as it was sent.
            j = frame.heard[s, i]
            k = tried[s, i]
            # Who learned nothing since this slot of the last frame tells nothing new.
            tells = j != i and learned_in[j] >= n - num_slots
            tells |= k != i and learned_in[k] >= n - num_slots
            if tells and _learn(known[i], known[j], known[k], s, num_slots, news):
                learned_in[i] = n
                _weigh(news, value, times, gained)
    for i in range(num_robots):
        _weigh(known[i], younger, num_slots, gained)
    return gained


@compiled()
def _learn(
    mine: KnownBits, sent: KnownBits, tried: KnownBits, s: int, num_slots: int, news: KnownBits
) -> bool:
    """Add what is heard in slot s, and `tried` in the trial of s; return whether any is `news`."""
    found = np.uint64(0)
    for c in range(mine.shape[0]):
        news[c] = sent[c] & ~mine[c]
        mine[c] |= news[c]
        found |= news[c]
    # The columns of one trial, which are done again: quicker than to ask of each which trial it is.
    for c in range(s, mine.shape[0], num_slots):
        mine[c] ^= news[c]  # as it was before, also in `tried` if that is the same row
        news[c] = tried[c] & ~mine[c]
        mine[c] |= news[c]
        found |= news[c]
    return bool(found != 0)


@compiled()
def _weigh(known: KnownBits, value: Words, times: int, gained: Int[np.ndarray, "C"]) -> None:
    """Add the values of all subjects known, in binary, times a number.

    Digit by digit: the sum is that of 2 ** p times how many of them have this digit.
    """
    for p in range(value.shape[0]):
        for c in range(known.shape[0]):
            gained[c] += (times << p) * _count(known[c] & value[p, c])


@compiled()
def _count(bits: np.uint64) -> np.int64:
    """Return how many bits are set, by sums of neighbouring bits, pairs and nibbles."""
    bits -= bits >> np.uint64(1) & np.uint64(0x5555555555555555)
    pairs = np.uint64(0x3333333333333333)
    bits = (bits & pairs) + (bits >> np.uint64(2) & pairs)
    bits = bits + (bits >> np.uint64(4)) & np.uint64(0x0F0F0F0F0F0F0F0F)
    return np.int64(bits * np.uint64(0x0101010101010101) >> np.uint64(56))
