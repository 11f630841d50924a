"""Decisions by features: when robots begin, who is silent, and what is too loud."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from swarm_mj.policies.index.table import Gain
from swarm_mj.policies.index.weights import Features, Weights
from swarm_mj.protocol.timestamps import SLOT_WINDOWS
from swarm_mj.system.compiled import compiled

MOST_SHIFT_DB = 8.0  # a channel louder than usual by more is busy in any case
MOST_SENSED_DB = 6.0  # that features may add to the usual shift, or take from it
# By which features may change the gain that a robot needs. Without a limit, teams unlike those that
# were trained on may never begin.
MOST_SILENCE = 2.0  # [octaves]
RECENT = 0.1  # share of the last slot in the shares of slots of late
TINY = 1e-9  # is added to what may be 0, which has no logarithm


class Record(NamedTuple):
    """The memory that every robot has of itself, in B missions."""

    since_sent: Float[np.ndarray, "B N"]  # since its last packet [windows]
    has_sent: Bool[np.ndarray, "B N"]  # ever
    sent_share: Float[np.ndarray, "B N"]  # of slots of late
    decoded_share: Float[np.ndarray, "B N"]  # of slots of late
    news: Float[np.ndarray, "B N"]  # rise of T since its last packet, sum over entries [windows]
    known: Float[np.ndarray, "B N"]  # T when it was last asked, sum over entries [windows]


def empty_record(num_missions: int, num_robots: int) -> Record:
    """Return the record of robots that have done nothing."""
    shape = num_missions, num_robots
    return Record(
        since_sent=np.zeros(shape),
        has_sent=np.zeros(shape, dtype=np.bool_),
        sent_share=np.zeros(shape),
        decoded_share=np.zeros(shape),
        news=np.zeros(shape),
        known=np.zeros(shape),
    )


@compiled()
def decide(
    record: Record,
    gain: Gain,
    weights: Weights,
    timestamp: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    has_sent: Bool[np.ndarray, "B N"],
    has_decoded: Bool[np.ndarray, "B N"],
    covered: Float[np.ndarray, "B N"],
    begin_draw: Float[np.ndarray, "B N"],
    silence_draw: Float[np.ndarray, "B N"],
    phase: int,
    share: Float[np.ndarray, "B N"],
    shift_db: Float[np.ndarray, "B N"],
) -> None:
    """Say when each robot begins in the next slot, and how loud its channel may be.

    Args:
        record: What the robots remember; the slot that has ended is added.
        gain: What their packets would bring.
        weights: The learned numbers of each mission.
        timestamp: T of the robots' buffers, [B N N], [windows].
        now: t, [B], [windows].
        has_sent: Who transmitted in the last slot, [B N].
        has_decoded: Who decoded a packet in it, [B N].
        covered: The share of each robot's range that the sender it decoded covers, [B N].
        begin_draw: Numbers from 0 to 1, [B N], by which robots of like gain begin apart.
        silence_draw: Numbers from 0 to 1, [B N], by which those of little gain are silent.
        phase: The slot's place among those with shifts of their own.
        share: After which share of all minislots each robot begins; infinite: it is silent.
            Written.
        shift_db: By how much the channel may be louder than usual [dB]; written.
    """
    num_missions, num_robots = has_sent.shape
    for b in range(num_missions):
        first = weights.first[b, 0]
        octaves = weights.octaves[b, 0]
        for i in range(num_robots):
            total = 0.0
            for k in range(num_robots):
                total += timestamp[b, i, k]
            _remember(record, b, i, total, has_sent[b, i], has_decoded[b, i], covered[b, i])
            features = _features(record, gain, b, i, now[b] - total / num_robots)
            pairs = num_robots * max(1.0, gain.neighbours[b, i])
            octave = np.log2(gain.total[b, i] / pairs + TINY)
            index = octave
            silence = 0.0
            sensing_db = 0.0
            for f in range(len(features)):
                index += weights.in_index[b, f] * features[f]
                silence += weights.in_silence[b, f] * features[f]
                sensing_db += weights.in_sensing_db[b, f] * features[f]

            place = (first - index) / octaves + weights.drawn[b, 0] * begin_draw[b, i]
            share[b, i] = min(max(place, 0.0), 1.0)
            silence = min(max(silence, -MOST_SILENCE), MOST_SILENCE)
            # A logistic draw: robots with a little too little transmit at times.
            odds = np.log(silence_draw[b, i] + TINY) - np.log(1.0 - silence_draw[b, i] + TINY)
            over = octave - weights.threshold[b, 0] + silence + weights.softness[b, 0] * odds
            if record.has_sent[b, i] and over <= 0.0:
                share[b, i] = np.inf

            sensing_db = min(max(sensing_db, -MOST_SENSED_DB), MOST_SENSED_DB)
            sensing_db += weights.shift_db[b, phase]
            shift_db[b, i] = min(max(sensing_db, 0.0), MOST_SHIFT_DB)


@compiled(makes_arrays=False)
def _remember(
    record: Record, b: int, i: int, known: float, has_sent: bool, has_decoded: bool, covered: float
) -> None:
    """Add the slot that has ended to what a robot remembers of itself."""
    record.since_sent[b, i] += SLOT_WINDOWS
    if has_sent:
        record.since_sent[b, i] = 0.0
        record.has_sent[b, i] = True
        record.news[b, i] = 0.0
    # What it learned from a sender nearby, most of its neighbours have learned, too.
    record.news[b, i] += (known - record.known[b, i]) * (1.0 - covered)
    record.known[b, i] = known
    sent = 1.0 if has_sent else 0.0
    decoded = 1.0 if has_decoded else 0.0
    record.sent_share[b, i] += RECENT * (sent - record.sent_share[b, i])
    record.decoded_share[b, i] += RECENT * (decoded - record.decoded_share[b, i])


@compiled(makes_arrays=False)
def _features(record: Record, gain: Gain, b: int, i: int, mean_age: float) -> Features:
    """Return what a robot sees of itself; the numbers make each about 0, and of the size 1."""
    num_robots = record.news.shape[1]
    neighbours = gain.neighbours[b, i]
    total = gain.total[b, i]
    counted = max(1.0, neighbours)
    return Features(
        neighbours=np.log2(neighbours + 1.0) - 3.0,
        since_sent=np.log2(1.0 + record.since_sent[b, i]) - 3.5,
        edge=gain.edge[b, i] - 0.5,
        age=np.log2(1.0 + max(0.0, mean_age)) - 4.0,
        sent=4.0 * record.sent_share[b, i] - 0.25,
        decoded=2.0 * record.decoded_share[b, i] - 0.7,
        team=np.log2(num_robots / 40.0),
        one_neighbour=np.log2((gain.largest[b, i] + 0.1) * counted / (total + 0.1)) - 1.0,
        crowd=4.0 * neighbours / num_robots - 0.7,
        news=np.log2((record.news[b, i] * counted + 1.0) / (total + 1.0)),
    )
