"""The extended features: all that one robot can tell of each teammate.

From its own buffer, the packets it sent and decoded, its identity, the team's size and the clock.
"""

import math
from dataclasses import replace
from typing import ClassVar, no_type_check

import numpy as np
from jaxtyping import Bool, Float, Float32
from numba import njit

from swarm_mj.gnn.graphs import Graphs
from swarm_mj.gnn.packet_memory import Memory
from swarm_mj.gnn.turns import write_turns
from swarm_mj.mission import Mission
from swarm_mj.policies.spatial_tdma import write_joined
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.radio.free_space import from_db

TURN_RADII = (1.5, 2.0, 3.0)  # [ranges]
ADDRESS_RANGES = 1.2  # a teammate believed farther away is not worth addressing [ranges]
LONG_WINDOWS = 500.0  # ages count by their logarithm, up to 1 at this one [windows]
FAR_RANGES = 4.0  # distances count up to here [ranges]
CROWD = 10.0  # neighbours that count as 1
TEAM = 40.0  # robots that count as 1


class ExtendedObserver:
    """Features for learning in minutes; see `names`.

    A node of the robot itself carries what concerns all of its neighbours: the sums of what is news
    to them, and when it last spoke.
    """

    names: ClassVar[tuple[str, ...]] = (
        "is oneself",
        "is known",
        "age of T",
        "distance",
        "is in range",
        "age of last packet heard",  # of oneself: spoken first
        "age of last attempt",
        "age of last being addressed",
        "news to it, by its last packet",  # of oneself: to all in range together
        "news to it, if it heard what was said last",  # as above
        "rank of its turn",
        "has a turn, 1.5 ranges apart",
        "has a turn, 2 ranges apart",
        "has a turn, 3 ranges apart",
        "has a turn, by interference",
        "neighbours",
        "share of the team known",
        "size of the team",
    )

    def __init__(self, mission: Mission) -> None:
        """Takes the radio's range and threshold from the mission."""
        self._range_m = mission.range_m
        self._threshold = from_db(mission.sinr_threshold_db)
        self._radius_m = mission.range_m * np.array(TURN_RADII)

    def start(self, num_missions: int, num_robots: int) -> None:
        """Forgets the packets of earlier missions; arguments as in `Observer.start`."""
        self._memory = Memory(num_missions, num_robots)

    def graphs(self, views: LocalViews) -> Graphs:
        """What every robot's network sees now; must see every window."""
        self._memory.update(views)
        buffers, memory = views.buffers, self._memory
        num_missions, num_robots = buffers.shape
        node = np.empty(
            (num_missions, num_robots, num_robots, len(ExtendedObserver.names)), dtype=np.float32
        )
        may_address = np.empty((num_missions, num_robots, num_robots), dtype=np.bool_)
        _fill(
            buffers.timestamp,
            buffers.position_m,
            buffers.last_attempt,
            views.now,
            memory.heard,
            memory.addressed_by,
            memory.sent,
            memory.neighbour,
            memory.said,
            self._range_m,
            node,
            may_address,
        )
        has_joined = node[..., 14]  # by the rule of spatial TDMA
        is_known = buffers.is_known | np.eye(num_robots, dtype=np.bool_)
        write_turns(buffers.position_m, is_known, views.now, self._radius_m, node[..., 11:14])
        write_joined(
            buffers.position_m,
            is_known,
            views.now.astype(np.int64),
            self._range_m,
            self._threshold,
            has_joined,
        )
        rows = (num_missions * num_robots, num_robots)
        return Graphs(
            node=node.reshape(*rows, len(ExtendedObserver.names)),
            parent=buffers.parent.reshape(rows),
            may_address=may_address.reshape(rows),
            has_turn=np.diagonal(has_joined, axis1=1, axis2=2).reshape(-1) > 0.0,
        )


class LocalObserver(ExtendedObserver):
    """The extended features without whose turn it is: nothing that a common order grants."""

    names: ClassVar[tuple[str, ...]] = tuple(
        name for name in ExtendedObserver.names if "turn" not in name
    )

    def graphs(self, views: LocalViews) -> Graphs:
        """What every robot's network sees now; must see every window."""
        seen = super().graphs(views)
        is_kept = np.array([name in self.names for name in ExtendedObserver.names])
        return replace(seen, node=seen.node[:, :, is_kept], has_turn=np.zeros_like(seen.has_turn))


@njit(cache=True)
@no_type_check
def _log_age(now: float, then: float) -> float:
    """The age on a logarithmic scale: 0 is now, 1 is long ago or never."""
    if then <= NEVER:
        return 1.0
    return min(1.0, math.log1p(now - then) / math.log1p(LONG_WINDOWS))


@njit(cache=True)
@no_type_check
def _log_news(windows: float) -> float:
    """Summed rises of timestamps on the scale of ages."""
    return math.log1p(windows) / math.log1p(LONG_WINDOWS)


@njit(cache=True, fastmath=True)
@no_type_check
def _news(
    own: Float32[np.ndarray, "N"],
    neighbour: Float32[np.ndarray, "N"],
    said: Float32[np.ndarray, "N"],
) -> tuple[float, float]:
    """Mean rise of a neighbour's T if it heard all: by its packet, or also by one's own."""
    by_packet, by_both = np.float32(0.0), np.float32(0.0)
    zero = np.float32(0.0)
    for j in range(own.shape[0]):
        by_packet += max(own[j] - neighbour[j], zero)
        by_both += max(own[j] - max(neighbour[j], said[j]), zero)
    return by_packet / own.shape[0], by_both / own.shape[0]


@njit(cache=True)
@no_type_check
def _fill(
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N 2"],
    last_attempt: Float[np.ndarray, "B N N"],
    now: Float[np.ndarray, "B"],
    heard: Float32[np.ndarray, "B N N"],
    addressed_by: Float32[np.ndarray, "B N N"],
    sent: Float32[np.ndarray, "B N"],
    neighbour: Float32[np.ndarray, "B N N N"],
    said: Float32[np.ndarray, "B N N"],
    range_m: float,
    node: Float32[np.ndarray, "B N N F"],
    may_address: Bool[np.ndarray, "B N N"],
) -> None:
    num_missions, num_robots = now.shape[0], timestamp.shape[1]
    for b in range(num_missions):
        for i in range(num_robots):
            is_known = timestamp[b, i] > NEVER
            is_known[i] = True
            _fill_teammates(
                b, i, timestamp, position_m, is_known, last_attempt, now[b], heard, addressed_by,
                neighbour, said, range_m, node[b, i], may_address[b, i],
            )  # fmt: skip
            _fill_oneself(i, _log_age(now[b], sent[b, i]), node[b, i])
            may_address[b, i, i] = True


@njit(cache=True)
@no_type_check
def _fill_teammates(
    b: int,
    i: int,
    timestamp: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N 2"],
    is_known: Bool[np.ndarray, "N"],
    last_attempt: Float[np.ndarray, "B N N"],
    now: float,
    heard: Float32[np.ndarray, "B N N"],
    addressed_by: Float32[np.ndarray, "B N N"],
    neighbour: Float32[np.ndarray, "B N N N"],
    said: Float32[np.ndarray, "B N N"],
    range_m: float,
    node: Float32[np.ndarray, "N F"],
    may_address: Bool[np.ndarray, "N"],
) -> None:
    """The features of every teammate that concern it alone."""
    num_robots = is_known.shape[0]
    own = timestamp[b, i].astype(np.float32)
    known_share = is_known.sum() / num_robots
    for k in range(num_robots):
        dx = position_m[b, i, k, 0] - position_m[b, i, i, 0]
        dy = position_m[b, i, k, 1] - position_m[b, i, i, 1]
        ranges = math.sqrt(dx * dx + dy * dy) / range_m
        is_near = is_known[k] and k != i and ranges <= 1.0
        node[k, 0] = k == i
        node[k, 1] = is_known[k]
        node[k, 2] = _log_age(now, timestamp[b, i, k])
        node[k, 3] = min(ranges, FAR_RANGES) / FAR_RANGES if is_known[k] else 0.0
        node[k, 4] = is_near
        node[k, 5] = _log_age(now, heard[b, i, k])
        node[k, 6] = _log_age(now, last_attempt[b, i, k])
        node[k, 7] = _log_age(now, addressed_by[b, i, k])
        node[k, 8], node[k, 9] = 0.0, 0.0
        if is_near:
            node[k, 8], node[k, 9] = _news(own, neighbour[b, i, k], said[b, i])
        node[k, 10] = ((k - int(now)) % num_robots) / num_robots
        node[k, 15] = _count_near(position_m[b, i], is_known, k, range_m) / CROWD
        node[k, 16] = known_share
        node[k, 17] = num_robots / TEAM
        may_address[k] = not is_known[k] or ranges <= ADDRESS_RANGES


@njit(cache=True)
@no_type_check
def _fill_oneself(i: int, spoken_log_age: float, node: Float32[np.ndarray, "N F"]) -> None:
    """What concerns all neighbours together; the news of each then goes to its logarithm."""
    total_8, total_9 = 0.0, 0.0
    for k in range(node.shape[0]):
        total_8 += node[k, 8]
        total_9 += node[k, 9]
        node[k, 8], node[k, 9] = _log_news(node[k, 8]), _log_news(node[k, 9])
    node[i, 5] = spoken_log_age
    node[i, 8], node[i, 9] = _log_news(total_8), _log_news(total_9)


@njit(cache=True)
@no_type_check
def _count_near(
    believed_m: Float[np.ndarray, "N 2"], is_known: Bool[np.ndarray, "N"], k: int, range_m: float
) -> int:
    """How many known robots are within range of robot k, by belief; none if k is unknown."""
    count = 0
    if is_known[k]:
        for j in range(is_known.shape[0]):
            if is_known[j] and j != k:
                dx = believed_m[j, 0] - believed_m[k, 0]
                dy = believed_m[j, 1] - believed_m[k, 1]
                count += dx * dx + dy * dy <= range_m * range_m
    return count
