"""The buffer features: the paper's information, T, M, P and L of a robot's own buffer, encoded.

Ages are on a logarithmic scale, positions are relative to the robot and in ranges. A robot is
staler than oneself if its T, the time of its last packet that anyone passed on, is from before
one's own last packet. Who has been silent for longest is thus known to all that hear of each other,
without a memory of packets, an order of identities or a clock.
"""

import math
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.policies.gnn.features import Feature, dtype_of, names_of
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import log_age
from swarm_mj.policies.gnn.scales import ADDRESS_RANGES, CROWD, FAR_RANGES, TEAM
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled


class BufferNode:
    """A node, in the network's order: T, M, P and L of one robot's buffer.

    The shares and the counts of staler robots are the same in all nodes of a graph.
    """

    is_oneself: Annotated[float, Feature("is oneself")]
    is_known: Annotated[float, Feature("is known")]
    timestamp_age: Annotated[float, Feature("age of T")]
    attempt_age: Annotated[float, Feature("age of L")]  # of oneself: since it last spoke first
    x: Annotated[float, Feature("x, in ranges")]
    y: Annotated[float, Feature("y, in ranges")]
    distance: Annotated[float, Feature("distance")]  # of `FAR_RANGES`
    is_near: Annotated[float, Feature("is in range")]
    is_direct: Annotated[float, Feature("P is oneself")]
    velocity_x: Annotated[float, Feature("v_x")]
    velocity_y: Annotated[float, Feature("v_y")]
    is_staler: Annotated[float, Feature("is staler")]  # its T is from before one's own last packet
    # 0: the stalest; of oneself by its own last packet
    rank: Annotated[float, Feature("rank by T")]
    known_share: Annotated[float, Feature("share of the team known")]
    neighbours: Annotated[float, Feature("neighbours")]
    team_size: Annotated[float, Feature("size of the team")]
    staler_025: Annotated[float, Feature("staler robots within 0.25 ranges")]
    staler_05: Annotated[float, Feature("staler robots within 0.5 ranges")]
    staler_1: Annotated[float, Feature("staler robots within 1 range")]
    staler_2: Annotated[float, Feature("staler robots within 2 ranges")]
    staler: Annotated[float, Feature("staler robots")]


NODE = dtype_of(BufferNode)
ADDRESS_DISTANCE = np.float32(ADDRESS_RANGES / FAR_RANGES)  # as precise as `distance`
LESS = 1.0 - 1e-15  # by more than a square root and `math.hypot` can differ
MORE = 1.0 + 1e-15

Nodes = Shaped[np.ndarray, "B N N"]  # of `NODE`
OwnNodes = Shaped[np.ndarray, "N"]  # those of one robot's graph


class OwnBuffer(NamedTuple):
    """One robot's buffer; k is a teammate, or the robot itself."""

    timestamp: Float[np.ndarray, "N"]  # T^k [windows]
    last_attempt: Float[np.ndarray, "N"]  # L^k [windows]
    position_m: Float[np.ndarray, "N 2"]  # M^k
    velocity_mps: Float[np.ndarray, "N 2"]  # M^k
    parent: Int[np.ndarray, "N"]  # P^k
    is_granted: bool  # whether it knew all states at t = 0
    spoke: float  # when it last addressed anyone [windows]


class Staleness(NamedTuple):
    """How stale each teammate of one robot is, and how near."""

    since: Float[np.ndarray, "N"]  # T, of oneself the last packet; inf if never heard of [windows]
    ranges: Float[np.ndarray, "N"]  # how far off it is, if it is staler, else inf [ranges]


class BufferFeatures(FeatureExtractor):
    """The paper's information, as a network can use it: the fields of `BufferNode`."""

    names: ClassVar[tuple[str, ...]] = names_of(BufferNode)

    def graphs(self, views: LocalViews) -> Graphs:
        """Return the buffers, encoded; teammates believed far out of range are not addressed."""
        buffers = views.buffers
        node = np.empty(buffers.timestamp.shape, dtype=NODE)
        may_address = np.empty(node.shape, dtype=np.bool_)
        _write_nodes(
            timestamp=buffers.timestamp,
            last_attempt=buffers.last_attempt,
            position_m=buffers.position_m,
            velocity_mps=buffers.velocity_mps,
            parent=buffers.parent,
            is_granted=buffers.is_granted,
            now=views.now,
            range_m=self._mission.range_m,
            max_mps=self._mission.max_velocity_mps,
            node=node,
            may_address=may_address,
        )
        num_missions, num_robots = buffers.shape
        rows = (num_missions * num_robots, num_robots)
        return Graphs(
            node=node.view(np.float32).reshape(*rows, len(self.names)),
            parent=buffers.parent.reshape(rows),
            may_address=may_address.reshape(rows),
            has_turn=np.zeros(rows[0], dtype=np.bool_),
        )


@compiled()
def _write_nodes(
    timestamp: Float[np.ndarray, "B N N"],
    last_attempt: Float[np.ndarray, "B N N"],
    position_m: Float[np.ndarray, "B N N 2"],
    velocity_mps: Float[np.ndarray, "B N N 2"],
    parent: Int[np.ndarray, "B N N"],
    is_granted: Bool[np.ndarray, "B"],
    now: Float[np.ndarray, "B"],
    range_m: float,
    max_mps: float,
    node: Nodes,
    may_address: Bool[np.ndarray, "B N N"],
) -> None:
    """Write every robot's graph, and whom it may address."""
    num_missions, num_robots = timestamp.shape[:2]
    stale = Staleness(since=np.empty(num_robots), ranges=np.empty(num_robots))
    shares = np.empty(num_robots + 1)  # of all counts of robots: logarithms take long
    for count in range(num_robots + 1):
        shares[count] = share_of_team(count)
    for b in range(num_missions):
        for i in range(num_robots):
            # One robot's nodes after the other's: they fit into the processor's nearest memory.
            own = OwnBuffer(
                timestamp=timestamp[b, i],
                last_attempt=last_attempt[b, i],
                position_m=position_m[b, i],
                velocity_mps=velocity_mps[b, i],
                parent=parent[b, i],
                is_granted=is_granted[b],
                spoke=last_attempt[b, i].max(),
            )
            _write_teammates(
                own=own,
                i=i,
                now=now[b],
                per_m=1.0 / range_m,
                per_mps=1.0 / max_mps,
                its=node[b, i],
                may_address=may_address[b, i],
                stale=stale,
            )
            _write_counts(stale, shares, node[b, i])


@compiled(forceinline=True, makes_arrays=False)
def _write_teammates(
    own: OwnBuffer,
    i: int,
    now: float,
    per_m: float,
    per_mps: float,
    its: OwnNodes,
    may_address: Bool[np.ndarray, "N"],
    stale: Staleness,
) -> None:
    """Write ages, and states relative to robot i's own: zeros of who was never heard of."""
    x_m, y_m = own.position_m[i]
    x_mps, y_mps = own.velocity_mps[i]
    for k in range(len(its)):
        of_k: BufferNode = its[k]
        is_known = k == i or own.timestamp[k] > NEVER or own.is_granted
        is_teammate = is_known and k != i
        is_staler = is_teammate and own.timestamp[k] < own.spoke
        of_k.is_oneself = k == i
        of_k.is_known = is_known
        of_k.timestamp_age = log_age(now, own.timestamp[k], is_known)
        of_k.attempt_age = log_age(now, own.last_attempt[k])
        of_k.is_staler = is_staler
        of_k.is_direct = is_teammate and own.parent[k] == i

        per_m_known = per_m if is_known else 0.0
        x = (own.position_m[k, 0] - x_m) * per_m_known
        y = (own.position_m[k, 1] - y_m) * per_m_known
        ranges = length(x, y)
        of_k.x = max(-FAR_RANGES, min(FAR_RANGES, x))
        of_k.y = max(-FAR_RANGES, min(FAR_RANGES, y))
        of_k.distance = min(FAR_RANGES, ranges) / FAR_RANGES
        of_k.is_near = is_teammate and ranges <= 1.0
        per_mps_known = per_mps if is_known else 0.0
        of_k.velocity_x = (own.velocity_mps[k, 0] - x_mps) * per_mps_known
        of_k.velocity_y = (own.velocity_mps[k, 1] - y_mps) * per_mps_known

        may_address[k] = not is_known or of_k.distance <= ADDRESS_DISTANCE
        stale.since[k] = own.timestamp[k] if is_known else np.inf
        stale.ranges[k] = FAR_RANGES * of_k.distance if is_staler else np.inf
    of_itself: BufferNode = its[i]
    of_itself.attempt_age = log_age(now, own.spoke)
    stale.since[i] = own.spoke


@compiled(forceinline=True, makes_arrays=False)
def _write_counts(stale: Staleness, shares: Float[np.ndarray, "_"], its: OwnNodes) -> None:
    """Write ranks, and what is the same in all nodes: how many are known, near and staler."""
    num_robots = len(its)
    known = near = 0
    for k in range(num_robots):
        of_k: BufferNode = its[k]
        known += of_k.is_known > 0.0
        near += of_k.is_near > 0.0
    within_025 = within_05 = within_1 = within_2 = staler = 0
    for ranges in stale.ranges:
        within_025 += ranges <= 0.25
        within_05 += ranges <= 0.5
        within_1 += ranges <= 1.0
        within_2 += ranges <= 2.0
        staler += ranges < np.inf
    share_025 = shares[within_025]
    share_05 = shares[within_05]
    share_1 = shares[within_1]
    share_2 = shares[within_2]
    share = shares[staler]
    for k in range(num_robots):
        of_each: BufferNode = its[k]
        of_each.rank = shares[count_before(stale.since[k], stale.since)]
        of_each.known_share = known / num_robots
        of_each.neighbours = near / CROWD
        of_each.team_size = num_robots / TEAM
        of_each.staler_025 = share_025
        of_each.staler_05 = share_05
        of_each.staler_1 = share_1
        of_each.staler_2 = share_2
        of_each.staler = share


@compiled()
def count_before(time: float, times: Float[np.ndarray, "N"]) -> int:
    """Return how many times are before this one: its rank, which equal times share."""
    num_before = 0  # faster than to sort the times
    for j in range(len(times)):
        num_before += times[j] < time
    return num_before


@compiled()
def length(x: float, y: float) -> float:
    """Return a vector's length: in single precision that of `math.hypot`, but much faster."""
    root = math.sqrt(x * x + y * y)
    # Its last bits may be others, which matters only where single precision rounds up or down, and
    # at the range, to which lengths are compared before they are rounded.
    is_clear = np.float32(root * LESS) == np.float32(root * MORE)
    if is_clear and not LESS <= root <= MORE:
        return root
    return math.hypot(x, y)


@compiled()
def share_of_team(count: int) -> float:
    """Return a count of robots on a logarithmic scale, 1 at `TEAM`."""
    return math.log1p(count) / math.log1p(TEAM)
