"""TDMA with spatial reuse (Nelson and Kleinrock 1985), by interference (Grönkvist, Hansson 2001).

Each robot reckons whom its teammates would decode, from where it believes them to be.
"""

from collections.abc import Sequence
from typing import no_type_check

import numpy as np
from jaxtyping import Bool, Float, Float32, Int
from numba import njit

from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.tdma import draw_order, slot_of
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.radio.free_space import MIN_DISTANCE_M


class SpatialTdma(BroadcastPolicy):
    """TDMA in which robots far enough from the one whose turn it is broadcast beside it.

    The common rule: in each slot the owner of the turn broadcasts, as in `Tdma`. Beginning
    half a round away in the order, one robot after the other joins if by Eqs. 1-4 nobody who
    decodes a packet so far would lose it, the robot itself included, and somebody would gain one.

    Each robot applies the rule to its own buffer, alone, and robots that believe the same decide
    the same. Until a robot has heard of everyone it speaks in its own turn only: so the team begins
    as `Tdma` does, and no robot that joins overlooks a listener of the owner's. Uses the robot's
    own buffer, identity, the team's size, the order, the clock and the radio's range and threshold.
    """

    def __init__(self, *, range_m: float, threshold: float) -> None:
        """Prepares the policy.

        Args:
            range_m: Distance at which a lone transmission just decodes [m].
            threshold: Least SINR that decodes, linear [1].
        """
        self._range_m = range_m
        self._threshold = threshold

    def start(self, num_robots: int, rngs: Sequence[np.random.Generator]) -> None:
        """Draws every mission's order; arguments as in `Policy.start`."""
        self._order = draw_order(num_robots, rngs)

    def transmits(self, views: LocalViews) -> Bool[np.ndarray, "B N"]:
        """Each robot whose turn it is or that may join."""
        is_oneself = np.eye(views.num_robots, dtype=np.bool_)
        is_sending = np.all(views.buffers.is_known | is_oneself, axis=2)
        _apply_rule(
            views.buffers.position_m,
            self._order,
            slot_of(views.now),
            self._range_m,
            self._threshold,
            is_sending,
        )
        return is_sending


@njit(cache=True)
@no_type_check
def write_joined(
    believed_m: Float[np.ndarray, "B N N 2"],
    is_known: Bool[np.ndarray, "B N N"],
    turn: Int[np.ndarray, "B"],
    range_m: float,
    threshold: float,
    has_joined: Float32[np.ndarray, "B N N"],
) -> None:
    """Writes who sends by the rule, in the order of identities and by each robot's own beliefs.

    Args:
        believed_m: Where robot i believes the others to be [m].
        is_known: Whom it knows; after the first unknown robot that is asked nobody joins.
        turn: Whose turn it is, mod N.
        range_m: Distance at which a lone transmission just decodes [m].
        threshold: Least SINR that decodes, linear [1].
        has_joined: 1 where robot k sends, by robot i's beliefs, else 0; overwritten.
    """
    num_missions, num_robots = is_known.shape[:2]
    has_joined[...] = 0.0
    for b in range(num_missions):
        owner = turn[b] % num_robots
        for i in range(num_robots):
            is_sender = np.zeros(num_robots, dtype=np.bool_)
            signal, total = np.zeros(num_robots), np.zeros(num_robots)
            if is_known[b, i, owner]:
                has_joined[b, i, owner] = 1.0
                _join(owner, believed_m[b, i], range_m, threshold, is_sender, signal, total)
            for place in range(num_robots):
                k = (turn[b] + num_robots // 2 + place) % num_robots
                if not (is_known[b, i, owner] and is_known[b, i, k]):
                    break
                if _may_join(k, believed_m[b, i], range_m, threshold, is_sender, signal, total):
                    has_joined[b, i, k] = 1.0
                    _join(k, believed_m[b, i], range_m, threshold, is_sender, signal, total)


@njit(cache=True)
@no_type_check
def _apply_rule(
    believed_m: Float[np.ndarray, "B N N 2"],
    order: Int[np.ndarray, "B N"],
    turn: Int[np.ndarray, "B"],
    range_m: float,
    threshold: float,
    is_sending: Bool[np.ndarray, "B N"],
) -> None:
    """Writes who sends over `is_sending`, who may; noise is the unit of power."""
    num_missions, num_robots = order.shape
    asked = np.empty(num_robots, dtype=np.int64)  # whether they join, one after the other
    for b in range(num_missions):
        owner = order[b, turn[b] % num_robots]
        half_round = turn[b] + num_robots // 2
        for place in range(num_robots):
            asked[place] = order[b, (half_round + place) % num_robots]
        for i in range(num_robots):
            is_sending[b, i] = i == owner or (
                is_sending[b, i] and _joins(i, owner, asked, believed_m[b, i], range_m, threshold)
            )


@njit(cache=True)
@no_type_check
def _joins(
    i: int,
    owner: int,
    asked: Int[np.ndarray, "N"],
    believed_m: Float[np.ndarray, "N 2"],
    range_m: float,
    threshold: float,
) -> bool:
    """Whether robot i joins the owner of the turn, by the rule and its own beliefs."""
    num_robots = asked.shape[0]
    is_sender = np.zeros(num_robots, dtype=np.bool_)
    signal = np.zeros(num_robots)  # of the packet that each robot decodes; 0 is none
    total = np.zeros(num_robots)  # of all packets in the air, at each robot
    _join(owner, believed_m, range_m, threshold, is_sender, signal, total)
    # A robot that may not join the owner alone may not join it with others either.
    if not _may_join(i, believed_m, range_m, threshold, is_sender, signal, total):
        return False
    # A sender that is asked again may not join either: nobody would gain by it.
    for k in asked:
        if _may_join(k, believed_m, range_m, threshold, is_sender, signal, total):
            _join(k, believed_m, range_m, threshold, is_sender, signal, total)
        if k == i:
            break
    return is_sender[i]


@njit(cache=True)
@no_type_check
def _may_join(
    k: int,
    believed_m: Float[np.ndarray, "N 2"],
    range_m: float,
    threshold: float,
    is_sender: Bool[np.ndarray, "N"],
    signal: Float[np.ndarray, "N"],
    total: Float[np.ndarray, "N"],
) -> bool:
    """Whether nobody would lose a packet and somebody would gain one if k were a sender too."""
    if signal[k] > 0.0:
        return False
    is_of_use = False
    for j in range(signal.shape[0]):
        if j != k and not is_sender[j]:
            received = _received(believed_m, k, j, range_m, threshold)
            if signal[j] > 0.0:
                interference = total[j] - signal[j] + received
                if received > signal[j] or signal[j] < threshold * (1.0 + interference):
                    return False
            elif received >= threshold * (1.0 + total[j]):
                is_of_use = True
    return is_of_use


@njit(cache=True)
@no_type_check
def _join(
    k: int,
    believed_m: Float[np.ndarray, "N 2"],
    range_m: float,
    threshold: float,
    is_sender: Bool[np.ndarray, "N"],
    signal: Float[np.ndarray, "N"],
    total: Float[np.ndarray, "N"],
) -> None:
    """Makes k a sender: whom everyone decodes, and what is in the air."""
    is_sender[k] = True
    for j in range(signal.shape[0]):
        if j != k:
            received = _received(believed_m, k, j, range_m, threshold)
            is_free = not is_sender[j] and signal[j] == 0.0
            if is_free and received >= threshold * (1.0 + total[j]):
                signal[j] = received
            total[j] += received


@njit(cache=True)
@no_type_check
def _received(
    believed_m: Float[np.ndarray, "N 2"], i: int, j: int, range_m: float, threshold: float
) -> float:
    """Power of i's packet at j over the noise: the threshold at the range (Eqs. 1-2)."""
    dx = believed_m[i, 0] - believed_m[j, 0]
    dy = believed_m[i, 1] - believed_m[j, 1]
    squared_m2 = max(dx * dx + dy * dy, MIN_DISTANCE_M * MIN_DISTANCE_M)
    return threshold * range_m * range_m / squared_m2
