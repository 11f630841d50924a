"""Spatial reuse (Nelson and Kleinrock 1985) by interference (Grönkvist, Hansson 2001).

The common rule: in each slot the owner of the turn broadcasts. Beginning half a round away in the
order, one robot after the other joins if by Eqs. 1-4 nobody who decodes a packet so far would lose
it, the robot itself included, and somebody would gain one. Noise is the unit of power, and powers
are mean ones: those of free space, or by a law.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from swarm_mj.mission.geometry import squared_distance
from swarm_mj.radio.power_law import MeanPowers, compute_powers, place_robots
from swarm_mj.radio.reception import MIN_DISTANCE_M, NOBODY, is_received, received_power, sinr
from swarm_mj.system.compiled import compiled

NOISE = 1.0
MARGIN = 1e-9  # of powers, far more than they are rounded by
FREE_SPACE = np.zeros((0, 0))  # in place of powers


class _Belief(NamedTuple):
    """The powers in which one robot believes, apart from `Slot`: loops then copy fewer arrays.

    In free space there is no table of powers: nearly all robots are refused after a few of them, so
    that tables, which hold whole rows, would take ten times as long.
    """

    believed_m: Float[np.ndarray, "N D"]
    at_1_m: float  # in free space
    power: Float[np.ndarray, "N N"]  # by a law, rows as far as they are computed
    threshold: float


class Slot(NamedTuple):
    """The senders of a slot so far, and the packets that stand.

    No `Air`: a packet that decodes keeps its receiver, whatever comes later, and its SINR is judged
    against the total before its own power is added, which rounds differently.
    """

    is_sender: Bool[np.ndarray, "N"]
    signal: Float[np.ndarray, "N"]  # of the packet that each robot decodes; 0 is none
    total: Float[np.ndarray, "N"]  # of all packets in the air
    near_m2: Float[np.ndarray, "N"]  # in free space, closer senders cost it that packet
    power: Float[np.ndarray, "N"]  # of the sender that joins, at each robot


@compiled()
def empty_slot(num_robots: int) -> Slot:
    """Return room for a slot by one robot's beliefs, and then by the next one's."""
    return Slot(
        is_sender=np.empty(num_robots, dtype=np.bool_),
        signal=np.empty(num_robots),
        total=np.empty(num_robots),
        near_m2=np.empty(num_robots),
        power=np.empty(num_robots),
    )


@compiled(makes_arrays=False)
def write_joined(
    believed_m: Float[np.ndarray, "N D"],
    is_known: Bool[np.ndarray, "N"],
    turn: int,
    asked: Int[np.ndarray, "N"],
    range_m: float,
    threshold: float,
    slot: Slot,
    has_joined: Float32[np.ndarray, "N"],
) -> None:
    """Write who sends in free space by the rule, in the order of identities, as one robot believes.

    `has_joined` is 1 where robot k sends, else 0. After the first robot that is asked and unknown
    nobody joins. Those asked are of `ask_in_turn`, the slot is written; other arguments are as of
    `keep_joined`.
    """
    num_robots = is_known.shape[0]
    owner = turn % num_robots
    has_joined[:] = 0.0
    if is_known[owner]:
        belief = _Belief(
            believed_m=believed_m,
            at_1_m=threshold * range_m * range_m,
            power=FREE_SPACE,
            threshold=threshold,
        )
        num_asked = 0
        while num_asked < num_robots and is_known[asked[num_asked]]:
            num_asked += 1
        _write_senders(owner, asked[:num_asked], NOBODY, belief, None, 0, slot)
        for k in range(num_robots):
            has_joined[k] = slot.is_sender[k]


@compiled()
def keep_joined(
    believed_m: Float[np.ndarray, "B N N D"],
    order: Int[np.ndarray, "B N"],
    turn: Int[np.ndarray, "B"],
    range_m: float,
    threshold: float,
    is_sending: Bool[np.ndarray, "B N"],
    powers: MeanPowers | None = None,
) -> None:
    """Leave those among the senders who send by the rule and their own beliefs.

    Robots take turns in this order, whose place `turn` (mod N) owns the slot, and sends in any
    case. Robot i believes the others to be in places [b, i]. A lone transmission just decodes at
    the range, with an SINR of the threshold, linear [1]. Powers are those that the robot asked last
    believes in, by the law that all believe in [noise], and written in place; None is free space.
    """
    num_missions, num_robots = order.shape
    at_1_m = threshold * range_m * range_m
    slot = empty_slot(num_robots)
    for b in range(num_missions):
        owner = order[b, turn[b] % num_robots]
        asked = ask_in_turn(order[b], turn[b])
        for i in range(num_robots):
            if i != owner and is_sending[b, i]:
                power = FREE_SPACE
                if powers is not None:
                    place_robots(powers, b, believed_m[b, i])
                    power = powers.power[b]
                belief = _Belief(
                    believed_m=believed_m[b, i], at_1_m=at_1_m, power=power, threshold=threshold
                )
                _write_senders(owner, asked, i, belief, powers, b, slot)
                is_sending[b, i] = slot.is_sender[i]
        is_sending[b, owner] = True


@compiled()
def ask_in_turn(order: Int[np.ndarray, "N"], turn: int) -> Int[np.ndarray, "N"]:
    """Return who is asked to join, one after the other."""
    return np.roll(order, -(turn + order.shape[0] // 2))


@compiled(makes_arrays=False)
def _write_senders(
    owner: int,
    asked: Int[np.ndarray, "A"],
    last: int,
    belief: _Belief,
    powers: MeanPowers | None,
    b: int,
    slot: Slot,
) -> None:
    """Write who sends: the owner of the turn, and who joins it up to the `last` that is asked."""
    near_m2 = slot.near_m2
    slot.is_sender[:] = False
    slot.signal[:] = 0.0
    slot.total[:] = 0.0
    near_m2[:] = 0.0
    if powers is not None:
        compute_powers(powers, b, owner)
        compute_powers(powers, b, last)
    _join(owner, belief, slot)
    # A robot that may not join the owner alone may not join it with others either.
    if last != NOBODY and _refuser(last, owner, belief, slot) != NOBODY:
        return
    refuser = owner
    for k in asked:
        # A sender that is asked again may not join either: nobody would gain by it.
        if powers is not None and slot.signal[k] == 0.0:
            compute_powers(powers, b, k)
        is_near = squared_distance(belief.believed_m, k, refuser) < near_m2[refuser]
        found = refuser if is_near else _refuser(k, refuser, belief, slot)
        if found == NOBODY:
            _join(k, belief, slot)
        elif found != k:
            refuser = found
        if k == last:
            break


@compiled(makes_arrays=False)
def _refuser(k: int, first: int, belief: _Belief, slot: Slot) -> int:
    """Return who would lose a packet if k sent, too; k itself if nobody would gain one; or NOBODY.

    The `first` is looked at first: who is in the way of one robot is likely to be in the way of
    the next, and nearly all robots are refused.
    """
    is_sender = slot.is_sender
    signal = slot.signal
    total = slot.total
    if signal[k] > 0.0:
        return k
    is_of_use = False
    for n in range(-1, signal.shape[0]):
        j = first if n < 0 else n
        if j != k and not is_sender[j]:
            if signal[j] > 0.0:
                power = _power(k, j, belief)
                if power > signal[j]:
                    return j
                interference = total[j] - signal[j] + power
                if not is_received(sinr(signal[j], interference, NOISE), belief.threshold):
                    return j
            elif not is_of_use:
                power = _power(k, j, belief)
                is_of_use = _decodes(power, total[j], belief.threshold)
    return NOBODY if is_of_use else k


@compiled(makes_arrays=False)
def _join(k: int, belief: _Belief, slot: Slot) -> None:
    """Make k a sender: mark whom it reaches, and add its packet to the air."""
    is_sender = slot.is_sender
    signal = slot.signal
    total = slot.total
    near_m2 = slot.near_m2
    is_sender[k] = True
    for j in range(signal.shape[0]):  # by itself, so that it is compiled to vectors
        slot.power[j] = _power(k, j, belief)
    for j in range(signal.shape[0]):
        if j != k:
            power = slot.power[j]
            is_free = not is_sender[j] and signal[j] == 0.0
            if is_free and _decodes(power, total[j], belief.threshold):
                signal[j] = power
                if belief.power.shape[0] == 0:  # later interference only adds to this
                    most = (1.0 + MARGIN) * power / belief.threshold - NOISE - total[j]
                    # Within the least distance powers do not grow: there, none exceeds its bound.
                    near_m2[j] = belief.at_1_m / min(power, most) - MIN_DISTANCE_M**2
            total[j] += power


@compiled(makes_arrays=False)
def _decodes(power: float, interference: float, threshold: float) -> bool:
    """Return whether a packet decodes; most are too weak without interference, which is quicker."""
    return power >= threshold * NOISE and is_received(sinr(power, interference, NOISE), threshold)


@compiled(makes_arrays=False)
def _power(k: int, j: int, belief: _Belief) -> float:
    """Return the power of k's packets at j."""
    if belief.power.shape[0] == 0:
        return received_power(belief.at_1_m, squared_distance(belief.believed_m, k, j))
    return belief.power[k, j]
