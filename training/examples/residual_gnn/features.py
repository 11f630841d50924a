"""What the network sees: of each robot that may decide, itself and the neighbours it believes in.

Index order: `[r, ·]` is a robot that decides, `[e, ·]` one of its neighbours.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int16, Int32

from residual_gnn.beliefs import Beliefs
from residual_gnn.proposals import FARTHEST, Proposal
from residual_gnn.reckoning import (
    NOBODY,
    Reckoned,
    decoded_by,
    reckon,
    room_for,
)
from swarm_mj.radio.kernels import is_received, sinr
from swarm_mj.radio.power_law import PowerLaw, write_powers
from swarm_mj.system.compiled import compiled

OLDEST = 400  # ages count no further [slots]
WORST, BEST = -2.0, 2.0  # margins, in decades of SINR

ROBOT_FEATURES = (
    "proposed",  # 1 if the rule says transmit, else -1
    "next_proposal",  # in how many slots it says so again, of `FARTHEST`
    "is_agreed",  # whether the rule's schedule is in force, rather than the turns of the start
    "margin",  # of the packet that it would hear
    "gain",  # what it would learn from it
    "since_sent",  # age of its own last packet
    "since_heard",  # and of the last it decoded
    "age",  # mean age of all it knows
    "degree",  # neighbours, in tens
    "rank",  # share of them that draw a higher number in this slot
    "hears",  # mean share of due packets that it decodes of them
    "heard_by",  # and they of its own
    "team",  # N, in forties
    "clock",  # how long the mission has lasted
    "from_afar",  # share of the packets it decoded from out of range
)
NEIGHBOUR_FEATURES = (
    "margin",  # of a lone packet to it
    "margin_now",  # of a packet to it beside those that are due
    "transmits",  # whether it is due itself
    "next_due",  # in how many slots it is
    "margin_of_other",  # of what it hears otherwise
    "is_jammed",  # whether it would lose that
    "news",  # what it would learn from this robot
    "news_of_other",  # and from the other
    "balance",  # what it would learn, less what it would lose
    "since_decoded",  # age of its last packet
    "age_of_us",  # of what it knows of this robot
    "hears",  # share of its due packets that this robot decodes
    "heard_by",  # and it of this robot's
    "draws_more",  # 1 if its number of this slot is the higher, else -1
)


class Seen(NamedTuple):
    """What robots that decide see; the first `count` rows of neighbours hold something."""

    robots: Float32[np.ndarray, "R F"]
    neighbours: Float32[np.ndarray, "E G"]
    owner: Int[np.ndarray, "E"]  # the row of the robot whose neighbour it is


def room_to_see(num_rows: int, num_robots: int) -> Seen:
    """Room for so many robots that decide, in teams of this size."""
    most = num_rows * (num_robots - 1)
    return Seen(
        robots=np.empty((num_rows, len(ROBOT_FEATURES)), dtype=np.float32),
        neighbours=np.empty((most, len(NEIGHBOUR_FEATURES)), dtype=np.float32),
        owner=np.empty(most, dtype=np.int64),
    )


class _Own(NamedTuple):
    """What one robot decides by, before a slot."""

    identity: int
    now: int  # the slot's tick
    place_m: Float[np.ndarray, "N 2"]  # where it believes everyone to be
    knows: Bool[np.ndarray, "N"]  # whom it has heard of
    known: Int32[np.ndarray, "N"]  # its T
    held: Int32[np.ndarray, "N N"]  # and its teammates', as it believes
    decoded: Int32[np.ndarray, "N"]  # when it last decoded a packet of each
    hears: Float32[np.ndarray, "N"]
    heard_by: Float32[np.ndarray, "N"]
    is_due: Bool[np.ndarray, "N"]
    due_in: Int16[np.ndarray, "N"]
    draw: Float[np.ndarray, "N"]


@compiled()
def see(
    rows: Int[np.ndarray, "R 2"],
    tick: Int[np.ndarray, "B"],
    beliefs: Beliefs,
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
        beliefs: Of all robots.
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
    reckoned, others = room_for(num_robots), np.zeros(num_robots, dtype=np.bool_)
    count = 0
    for r in range(rows.shape[0]):
        b, i = rows[r, 0], rows[r, 1]
        own = _Own(
            int(i),
            int(tick[b]),
            position_m[b, i],
            is_known[b, i],
            observed[b, i],
            beliefs.held[b, i],
            beliefs.decoded[b, i],
            beliefs.hears[b, i],
            beliefs.heard_by[b, i],
            proposal.is_due[b, i],
            proposal.due_in[b, i],
            draw[b],
        )
        for o in range(num_robots):
            others[o] = o != i and own.is_due[o] and own.knows[o]
        reckon(others, own.place_m, law, reckoned)
        write_powers(i, own.place_m, law, reckoned.power)
        first = count
        for j in range(num_robots):
            is_near = own.knows[j] and is_received(float(reckoned.power[j]), threshold)
            if j != i and is_near:
                seen.owner[count] = r
                _see_neighbour(j, own, others, reckoned, threshold, seen.neighbours[count])
                count += 1
        robot = seen.robots[r]
        _see_oneself(own, reckoned, threshold, seen.neighbours[first:count], robot)
        robot[2] = 1.0 if proposal.is_agreed[b, i] else 0.0
        robot[5] = _age(own.now - int(beliefs.sent[b, i]))
        robot[6] = _age(own.now - int(beliefs.heard[b, i]))
        robot[14] = beliefs.from_afar[b, i]
    return count


@compiled()
def _see_neighbour(
    j: int,
    own: _Own,
    others: Bool[np.ndarray, "N"],
    reckoned: Reckoned,
    threshold: float,
    edge: Float32[np.ndarray, "G"],
) -> None:
    """Fill in what a robot sees of neighbour j, in the order of `NEIGHBOUR_FEATURES`."""
    i, now, held = own.identity, own.now, own.held
    power, total = float(reckoned.power[j]), float(reckoned.total[j])
    strongest = float(reckoned.strongest[j])
    beside = sinr(power, total, 1.0)
    other = decoded_by(j, reckoned, 0.0, threshold)
    news, news_of_other = 0.0, 0.0
    if not others[j]:
        news = _news(i, own.known, j, held[j], now)
        if other != NOBODY:
            news_of_other = _news(other, held[other], j, held[j], now)
    is_jammed = other != NOBODY and decoded_by(j, reckoned, power, threshold) == NOBODY
    balance = news if is_received(beside, threshold) else 0.0
    if is_jammed:
        balance -= news_of_other
    edge[0] = _margin(power, threshold)
    edge[1] = _margin(beside, threshold)
    edge[2] = 1.0 if others[j] else 0.0
    edge[3] = min(own.due_in[j], FARTHEST) / FARTHEST
    edge[4] = _margin(sinr(strongest, total - strongest, 1.0), threshold)
    edge[5] = 1.0 if is_jammed else 0.0
    edge[6] = 0.5 * math.log1p(news)
    edge[7] = 0.5 * math.log1p(news_of_other)
    edge[8] = 0.05 * balance
    edge[9] = _age(now - int(own.decoded[j]))
    edge[10] = _age(now - int(held[j, i]))
    edge[11] = own.hears[j]
    edge[12] = own.heard_by[j]
    edge[13] = 1.0 if own.draw[j] > own.draw[i] else -1.0


@compiled()
def _see_oneself(
    own: _Own,
    reckoned: Reckoned,
    threshold: float,
    neighbours: Float32[np.ndarray, "D G"],
    robot: Float32[np.ndarray, "F"],
) -> None:
    """Fill in what a robot sees of itself, as far as it follows from these."""
    i, now, degree = own.identity, own.now, neighbours.shape[0]
    sender = decoded_by(i, reckoned, 0.0, threshold)
    gain = 0.0 if sender == NOBODY else _news(sender, own.held[sender], i, own.known, now)
    strongest = float(reckoned.strongest[i])
    above, hears, heard_by = 0, 0.0, 0.0
    for n in range(degree):
        above += neighbours[n, 13] > 0.0
        hears += neighbours[n, 11]
        heard_by += neighbours[n, 12]
    robot[0] = 1.0 if own.is_due[i] else -1.0
    robot[1] = min(own.due_in[i], FARTHEST) / FARTHEST
    robot[3] = _margin(sinr(strongest, float(reckoned.total[i]) - strongest, 1.0), threshold)
    robot[4] = 0.5 * math.log1p(gain)
    robot[7] = 0.3 * math.log1p(_mean_age(own.known, now))
    robot[8] = 0.1 * degree
    robot[9] = above / max(degree, 1)
    robot[10] = hears / max(degree, 1)
    robot[11] = heard_by / max(degree, 1)
    robot[12] = len(own.known) / 40.0
    robot[13] = 0.15 * math.log1p(now)


@compiled()
def _margin(ratio: float, threshold: float) -> float:
    """Decades by which an SINR is above the threshold, within limits."""
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
    told: Int32[np.ndarray, "N"],
    listener: int,
    held: Int32[np.ndarray, "N"],
    now: int,
) -> float:
    """By how much a packet would make a listener's knowledge younger: mean over robots [slots]."""
    total = 0
    for k in range(held.shape[0]):
        age = 0 if k == sender else now - told[k]
        if k != listener:
            total += max(min(now - held[k], OLDEST) - min(age, OLDEST), 0)
    return total / held.shape[0]
