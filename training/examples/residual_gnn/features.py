"""What the network sees: of each robot that may decide, itself and the neighbours it believes in.

Index order: `[r, ·]` is a robot that decides, `[e, ·]` one of its neighbours.
"""

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int16, Int32

from residual_gnn.memory import Memory
from residual_gnn.receptions import (
    NOBODY,
    PredictedReceptions,
    decoded_by,
    empty_receptions,
    predict_receptions,
)
from residual_gnn.rule import FARTHEST, Proposal
from swarm_mj.radio.power_law import PowerLaw, write_powers
from swarm_mj.radio.reception import is_received, sinr
from swarm_mj.system.compiled import compiled

OLDEST = 400  # ages count no further [slots]
# Margins, in decades of SINR.
WORST = -2.0
BEST = 2.0


class Own(IntEnum):
    """Columns of what a robot sees of itself."""

    PROPOSED = 0  # 1 if the rule says transmit, else -1
    NEXT_PROPOSAL = 1  # in how many slots it says so again, of `FARTHEST`
    IS_AGREED = 2  # whether the rule's schedule is in force, rather than the turns of the start
    MARGIN = 3  # of the packet that it would hear
    GAIN = 4  # what it would learn from it
    SINCE_SENT = 5  # age of its own last packet
    SINCE_HEARD = 6  # and of the last it decoded
    AGE = 7  # mean age of all it knows
    DEGREE = 8  # neighbours, in tens
    RANK = 9  # share of them that draw a higher number in this slot
    INBOUND_RATIO = 10  # mean share of due packets that it decodes of them
    OUTBOUND_RATIO = 11  # and they of its own
    TEAM = 12  # N, in forties
    CLOCK = 13  # how long the mission has lasted
    OUT_OF_RANGE = 14  # share of the packets it decoded from out of range


class Neighbour(IntEnum):
    """Columns of what a robot sees of one neighbour."""

    MARGIN = 0  # of a lone packet to it
    MARGIN_NOW = 1  # of a packet to it beside those that are due
    TRANSMITS = 2  # whether it is due itself
    NEXT_DUE = 3  # in how many slots it is
    MARGIN_OF_OTHER = 4  # of what it receives otherwise
    IS_JAMMED = 5  # whether it would lose that
    NEWS = 6  # what it would learn from this robot
    NEWS_OF_OTHER = 7  # and from the other
    BALANCE = 8  # what it would learn, less what it would lose
    SINCE_DECODED = 9  # age of its last packet
    AGE_OF_US = 10  # of what it knows of this robot
    INBOUND_RATIO = 11  # share of its due packets that this robot decodes
    OUTBOUND_RATIO = 12  # and it of this robot's
    DRAWS_MORE = 13  # 1 if its number of this slot is the higher, else -1


class Seen(NamedTuple):
    """The inputs of robots that decide; the first `count` rows of neighbours are in use."""

    robots: Float32[np.ndarray, "R F"]
    neighbours: Float32[np.ndarray, "E G"]
    owner: Int[np.ndarray, "E"]  # the row of the robot whose neighbour it is


def room_to_see(num_rows: int, num_robots: int) -> Seen:
    """Return room for a number of robots that decide, in teams of this size."""
    most = num_rows * (num_robots - 1)
    return Seen(
        robots=np.empty((num_rows, len(Own)), dtype=np.float32),
        neighbours=np.empty((most, len(Neighbour)), dtype=np.float32),
        owner=np.empty(most, dtype=np.int64),
    )


class _Knowledge(NamedTuple):
    """The knowledge by which one robot decides, before a slot."""

    identity: int
    now: int  # the slot's tick
    place_m: Float[np.ndarray, "N 2"]  # where it believes everyone to be
    knows: Bool[np.ndarray, "N"]  # whom it has heard of
    known: Int32[np.ndarray, "N"]  # its T
    held: Int32[np.ndarray, "N N"]  # and its teammates', as it believes
    decoded: Int32[np.ndarray, "N"]  # when it last decoded a packet of each
    inbound_ratio: Float32[np.ndarray, "N"]
    outbound_ratio: Float32[np.ndarray, "N"]
    is_due: Bool[np.ndarray, "N"]
    due_in: Int16[np.ndarray, "N"]
    draw: Float[np.ndarray, "N"]


@compiled()
def see(
    rows: Int[np.ndarray, "R 2"],
    tick: Int[np.ndarray, "B"],
    memory: Memory,
    observed: Int32[np.ndarray, "B N N"],
    is_known: Bool[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N 2"],
    proposal: Proposal,
    draw: Float[np.ndarray, "B N"],
    law: PowerLaw,
    threshold: float,
    seen: Seen,
) -> int:
    """Fill in what robots see before a slot.

    Args:
        rows: Mission and identity of each robot that decides.
        tick: The slot's.
        memory: Of all robots.
        observed: Their T, in ticks.
        is_known: Whom each has heard of.
        position_m: Where it believes the others to be [m].
        proposal: What the rule says.
        draw: A common random number of each robot in this slot.
        law: Of the powers that are believed in [noise].
        threshold: Least SINR that decodes, linear [1].
        seen: Written in place.

    Returns:
        How many neighbours there are in all.
    """
    num_robots = observed.shape[1]
    predicted = empty_receptions(num_robots)
    others = np.zeros(num_robots, dtype=np.bool_)
    count = 0
    for r in range(rows.shape[0]):
        b = rows[r, 0]
        i = rows[r, 1]
        own = _Knowledge(
            int(i),
            int(tick[b]),
            position_m[b, i],
            is_known[b, i],
            observed[b, i],
            memory.held[b, i],
            memory.decoded[b, i],
            memory.inbound_ratio[b, i],
            memory.outbound_ratio[b, i],
            proposal.is_due[b, i],
            proposal.due_in[b, i],
            draw[b],
        )
        for o in range(num_robots):
            others[o] = o != i and own.is_due[o] and own.knows[o]
        predict_receptions(others, own.place_m, law, predicted)
        write_powers(i, own.place_m, law, predicted.power)
        first = count
        for j in range(num_robots):
            is_near = own.knows[j] and is_received(float(predicted.power[j]), threshold)
            if j != i and is_near:
                seen.owner[count] = r
                _see_neighbour(j, own, others, predicted, threshold, seen.neighbours[count])
                count += 1
        robot = seen.robots[r]
        _see_oneself(own, predicted, threshold, seen.neighbours[first:count], robot)
        robot[Own.IS_AGREED] = 1.0 if proposal.is_agreed[b, i] else 0.0
        robot[Own.SINCE_SENT] = _age(own.now - int(memory.sent[b, i]))
        robot[Own.SINCE_HEARD] = _age(own.now - int(memory.heard[b, i]))
        robot[Own.OUT_OF_RANGE] = memory.out_of_range[b, i]
    return count


@compiled()
def _see_neighbour(
    j: int,
    own: _Knowledge,
    others: Bool[np.ndarray, "N"],
    predicted: PredictedReceptions,
    threshold: float,
    edge: Float32[np.ndarray, "G"],
) -> None:
    """Fill in what a robot sees of neighbour j, in the order of `Neighbour`."""
    i = own.identity
    now = own.now
    held = own.held
    power = float(predicted.power[j])
    total = float(predicted.total[j])
    strongest = float(predicted.strongest[j])
    beside = sinr(power, total, 1.0)
    other = decoded_by(j, predicted, 0.0, threshold)
    news = 0.0
    news_of_other = 0.0
    if not others[j]:
        news = _news(i, own.known, j, held[j], now)
        if other != NOBODY:
            news_of_other = _news(other, held[other], j, held[j], now)
    is_jammed = other != NOBODY and decoded_by(j, predicted, power, threshold) == NOBODY
    balance = news if is_received(beside, threshold) else 0.0
    if is_jammed:
        balance -= news_of_other
    edge[Neighbour.MARGIN] = _margin(power, threshold)
    edge[Neighbour.MARGIN_NOW] = _margin(beside, threshold)
    edge[Neighbour.TRANSMITS] = 1.0 if others[j] else 0.0
    edge[Neighbour.NEXT_DUE] = min(own.due_in[j], FARTHEST) / FARTHEST
    edge[Neighbour.MARGIN_OF_OTHER] = _margin(sinr(strongest, total - strongest, 1.0), threshold)
    edge[Neighbour.IS_JAMMED] = 1.0 if is_jammed else 0.0
    edge[Neighbour.NEWS] = 0.5 * math.log1p(news)
    edge[Neighbour.NEWS_OF_OTHER] = 0.5 * math.log1p(news_of_other)
    edge[Neighbour.BALANCE] = 0.05 * balance
    edge[Neighbour.SINCE_DECODED] = _age(now - int(own.decoded[j]))
    edge[Neighbour.AGE_OF_US] = _age(now - int(held[j, i]))
    edge[Neighbour.INBOUND_RATIO] = own.inbound_ratio[j]
    edge[Neighbour.OUTBOUND_RATIO] = own.outbound_ratio[j]
    edge[Neighbour.DRAWS_MORE] = 1.0 if own.draw[j] > own.draw[i] else -1.0


@compiled()
def _see_oneself(
    own: _Knowledge,
    predicted: PredictedReceptions,
    threshold: float,
    neighbours: Float32[np.ndarray, "D G"],
    robot: Float32[np.ndarray, "F"],
) -> None:
    """Fill in what a robot sees of itself, as far as it follows from these."""
    i = own.identity
    now = own.now
    degree = neighbours.shape[0]
    sender = decoded_by(i, predicted, 0.0, threshold)
    gain = 0.0 if sender == NOBODY else _news(sender, own.held[sender], i, own.known, now)
    strongest = float(predicted.strongest[i])
    above = 0
    inbound_ratio = 0.0
    outbound_ratio = 0.0
    for n in range(degree):
        above += neighbours[n, Neighbour.DRAWS_MORE] > 0.0
        inbound_ratio += neighbours[n, Neighbour.INBOUND_RATIO]
        outbound_ratio += neighbours[n, Neighbour.OUTBOUND_RATIO]
    robot[Own.PROPOSED] = 1.0 if own.is_due[i] else -1.0
    robot[Own.NEXT_PROPOSAL] = min(own.due_in[i], FARTHEST) / FARTHEST
    robot[Own.MARGIN] = _margin(
        sinr(strongest, float(predicted.total[i]) - strongest, 1.0), threshold
    )
    robot[Own.GAIN] = 0.5 * math.log1p(gain)
    robot[Own.AGE] = 0.3 * math.log1p(_mean_age(own.known, now))
    robot[Own.DEGREE] = 0.1 * degree
    robot[Own.RANK] = above / max(degree, 1)
    robot[Own.INBOUND_RATIO] = inbound_ratio / max(degree, 1)
    robot[Own.OUTBOUND_RATIO] = outbound_ratio / max(degree, 1)
    robot[Own.TEAM] = len(own.known) / 40.0
    robot[Own.CLOCK] = 0.15 * math.log1p(now)


@compiled()
def _margin(ratio: float, threshold: float) -> float:
    """Return by how many decades an SINR is above the threshold, within limits."""
    return min(max(math.log10(max(ratio, 1e-12) / threshold), WORST), BEST)


@compiled()
def _age(slots: int) -> float:
    """Return an age as the network gets it."""
    return 0.3 * math.log1p(min(slots, OLDEST))


@compiled()
def _mean_age(known: Int32[np.ndarray, "N"], now: int) -> float:
    total = 0
    for k in range(known.shape[0]):
        total += min(now - known[k], OLDEST)
    return total / known.shape[0]


@compiled()
def _news(
    sender: int,
    sent: Int32[np.ndarray, "N"],
    listener: int,
    held: Int32[np.ndarray, "N"],
    now: int,
) -> float:
    """Return by how much a packet would lower a listener's ages, mean over robots [slots]."""
    total = 0
    for k in range(held.shape[0]):
        age = 0 if k == sender else now - sent[k]
        if k != listener:
            total += max(min(now - held[k], OLDEST) - min(age, OLDEST), 0)
    return total / held.shape[0]
