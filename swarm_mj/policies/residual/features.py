"""What the network sees: of each robot that may decide, itself and the neighbours it believes in.

Index order: `[r, ·]` is a robot that decides, `[e, ·]` one of its neighbours.
"""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Int32

from swarm_mj.compiled import compiled
from swarm_mj.policies.residual.beliefs import Beliefs
from swarm_mj.policies.residual.proposals import Proposal
from swarm_mj.policies.residual.reckoning import NOBODY, decoded_by, reckon, room_for
from swarm_mj.radio.kernels import is_received, sinr
from swarm_mj.radio.power_law import PowerLaw, write_powers

OLDEST = 400  # ages count no further [slots]
FARTHEST = 40  # nor do times until somebody is due [slots]
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
    "clock",  # how long the mission lasts
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
    """Fills in what robots see before a slot.

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
        now, place_m, knows = tick[b], position_m[b, i], is_known[b, i]
        is_due, due_in = proposal.is_due[b, i], proposal.due_in[b, i]
        known, held, own = observed[b, i], beliefs.held[b, i], seen.robots[r]
        for o in range(num_robots):
            others[o] = o != i and is_due[o] and knows[o]
        reckon(others, place_m, law, reckoned)
        write_powers(i, place_m, law, reckoned.power)
        degree, above, hears, heard_by = 0, 0, 0.0, 0.0
        for j in range(num_robots):
            power = reckoned.power[j]
            if j == i or not knows[j] or not is_received(power, threshold):
                continue
            seen.owner[count] = r
            edge = seen.neighbours[count]
            count += 1
            degree += 1
            above += draw[b, j] > draw[b, i]
            hears += beliefs.hears[b, i, j]
            heard_by += beliefs.heard_by[b, i, j]
            beside = sinr(power, reckoned.total[j], 1.0)
            other = decoded_by(j, reckoned, 0.0, threshold)
            news, news_of_other = 0.0, 0.0
            if not others[j]:
                news = _news(i, known, j, held[j], now)
                if other != NOBODY:
                    news_of_other = _news(other, held[other], j, held[j], now)
            is_jammed = other != NOBODY and decoded_by(j, reckoned, power, threshold) == NOBODY
            balance = news if is_received(beside, threshold) else 0.0
            if is_jammed:
                balance -= news_of_other
            strongest = reckoned.strongest[j]
            edge[0] = _margin(power, threshold)
            edge[1] = _margin(beside, threshold)
            edge[2] = 1.0 if others[j] else 0.0
            edge[3] = min(due_in[j], FARTHEST) / FARTHEST
            edge[4] = _margin(sinr(strongest, reckoned.total[j] - strongest, 1.0), threshold)
            edge[5] = 1.0 if is_jammed else 0.0
            edge[6] = 0.5 * math.log1p(news)
            edge[7] = 0.5 * math.log1p(news_of_other)
            edge[8] = 0.05 * balance
            edge[9] = _age(now - beliefs.decoded[b, i, j])
            edge[10] = _age(now - held[j, i])
            edge[11] = beliefs.hears[b, i, j]
            edge[12] = beliefs.heard_by[b, i, j]
            edge[13] = 1.0 if draw[b, j] > draw[b, i] else -1.0
        sender = decoded_by(i, reckoned, 0.0, threshold)
        gain = 0.0 if sender == NOBODY else _news(sender, held[sender], i, known, now)
        strongest = reckoned.strongest[i]
        own[0] = 1.0 if is_due[i] else -1.0
        own[1] = min(due_in[i], FARTHEST) / FARTHEST
        own[2] = 1.0 if proposal.is_agreed[b, i] else 0.0
        own[3] = _margin(sinr(strongest, reckoned.total[i] - strongest, 1.0), threshold)
        own[4] = 0.5 * math.log1p(gain)
        own[5] = _age(now - beliefs.sent[b, i])
        own[6] = _age(now - beliefs.heard[b, i])
        own[7] = 0.3 * math.log1p(_mean_age(known, now))
        own[8] = 0.1 * degree
        own[9] = above / max(degree, 1)
        own[10] = hears / max(degree, 1)
        own[11] = heard_by / max(degree, 1)
        own[12] = num_robots / 40.0
        own[13] = 0.15 * math.log1p(now)
        own[14] = beliefs.from_afar[b, i]
    return count


@compiled()
def _margin(ratio: float, threshold: float) -> float:
    """Decades by which an SINR is above the threshold, within limits."""
    return min(max(math.log10(max(ratio, 1e-12) / threshold), WORST), BEST)


@compiled()
def _age(slots: int) -> float:
    """An age as the network gets it."""
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
