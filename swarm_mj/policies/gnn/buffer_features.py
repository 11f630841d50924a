"""The buffer features: the paper's information, T, M, P and L of a robot's own buffer, encoded.

Ages are on a logarithmic scale, positions are relative to the robot and in ranges. A robot is
staler than oneself if its T, the time of its last packet that anyone passed on, is from before
one's own last packet. Who has been silent for longest is thus known to all that hear of each other,
without a memory of packets, an order of identities or a clock.
"""

import math
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Shaped

from swarm_mj.policies.gnn.features import Feature, dtype_of, names_of
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import log_age, write_log_ages
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


class BufferColumns(NamedTuple):
    """Room for what one robot knows of its teammates: loops over columns become vectors."""

    is_known: Bool[np.ndarray, "N"]
    timestamp_age: Float32[np.ndarray, "N"]
    attempt_age: Float32[np.ndarray, "N"]
    x: Float[np.ndarray, "N"]  # from the robot [ranges], 0 if unknown; so are the next two
    y: Float[np.ndarray, "N"]
    ranges: Float[np.ndarray, "N"]  # how far off it is
    distance: Float32[np.ndarray, "N"]  # the same, of `FAR_RANGES`
    since: Float[np.ndarray, "N"]  # T, of oneself the last packet; inf if never heard of [windows]
    stale_ranges: Float[np.ndarray, "N"]  # how far off it is, if it is staler, else inf [ranges]
    num_before: Float[np.ndarray, "N"]  # those that are staler than it


class Shares(NamedTuple):
    """Shares of the team, which are the same in all nodes of a graph."""

    known: float
    near: float
    staler_025: float
    staler_05: float
    staler_1: float
    staler_2: float
    staler: float


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
    columns = _empty_columns(num_robots)
    shares = np.empty(num_robots + 1)  # of all counts of robots: logarithms take long
    for count in range(num_robots + 1):
        shares[count] = share_of_team(count)
    for b in range(num_missions):
        for i in range(num_robots):
            # One robot's nodes after the other's: they fit into the processor's nearest memory.
            _write_graph(
                own=OwnBuffer(
                    timestamp=timestamp[b, i],
                    last_attempt=last_attempt[b, i],
                    position_m=position_m[b, i],
                    velocity_mps=velocity_mps[b, i],
                    parent=parent[b, i],
                    is_granted=is_granted[b],
                    spoke=last_attempt[b, i].max(),
                ),
                i=i,
                now=now[b],
                per_m=1.0 / range_m,
                per_mps=1.0 / max_mps,
                shares=shares,
                columns=columns,
                its=node[b, i],
                may_address=may_address[b, i],
            )


@compiled()
def _empty_columns(num_robots: int) -> BufferColumns:
    return BufferColumns(
        is_known=np.empty(num_robots, dtype=np.bool_),
        timestamp_age=np.empty(num_robots, dtype=np.float32),
        attempt_age=np.empty(num_robots, dtype=np.float32),
        x=np.empty(num_robots),
        y=np.empty(num_robots),
        ranges=np.empty(num_robots),
        distance=np.empty(num_robots, dtype=np.float32),
        since=np.empty(num_robots),
        stale_ranges=np.empty(num_robots),
        num_before=np.empty(num_robots),
    )


@compiled(makes_arrays=False)
def _write_graph(
    own: OwnBuffer,
    i: int,
    now: float,
    per_m: float,
    per_mps: float,
    shares: Float[np.ndarray, "_"],
    columns: BufferColumns,
    its: OwnNodes,
    may_address: Bool[np.ndarray, "N"],
) -> None:
    """Write the graph of robot i."""
    write_log_ages(now, own.timestamp, own.is_granted, columns.timestamp_age)
    write_log_ages(now, own.last_attempt, False, columns.attempt_age)
    columns.timestamp_age[i] = log_age(now, own.timestamp[i], True)
    columns.attempt_age[i] = log_age(now, own.spoke)
    _find_distances(own, i, per_m, columns)
    _find_staler(own, i, columns)
    team = _count(columns, shares)
    _write_teammates(own, i, per_mps, columns, shares, team, its, may_address)


@compiled(forceinline=True, makes_arrays=False)
def _find_distances(own: OwnBuffer, i: int, per_m: float, columns: BufferColumns) -> None:
    """Find who is known, and how far off each is believed to be."""
    x_m, y_m = own.position_m[i]
    for k in range(len(columns.x)):
        is_known = (own.timestamp[k] > NEVER) | own.is_granted | (k == i)
        per_m_known = per_m if is_known else 0.0
        columns.is_known[k] = is_known
        columns.x[k] = (own.position_m[k, 0] - x_m) * per_m_known
        columns.y[k] = (own.position_m[k, 1] - y_m) * per_m_known
    write_lengths(columns.x, columns.y, columns.ranges)
    for k in range(len(columns.x)):
        columns.distance[k] = min(FAR_RANGES, columns.ranges[k]) / FAR_RANGES


@compiled(forceinline=True, makes_arrays=False)
def _find_staler(own: OwnBuffer, i: int, columns: BufferColumns) -> None:
    """Find who is staler than robot i, and how many are staler than each."""
    since = columns.since
    for k in range(len(since)):
        is_staler = columns.is_known[k] & (own.timestamp[k] < own.spoke) & (k != i)
        since[k] = own.timestamp[k] if columns.is_known[k] else np.inf
        columns.stale_ranges[k] = FAR_RANGES * columns.distance[k] if is_staler else np.inf
    since[i] = own.spoke
    count_before(since, columns.num_before)


@compiled(forceinline=True, makes_arrays=False)
def _count(columns: BufferColumns, shares: Float[np.ndarray, "_"]) -> Shares:
    """Count how many are known, near and staler."""
    num_robots = len(columns.is_known)
    known = near = within_025 = within_05 = within_1 = within_2 = staler = 0
    for k in range(num_robots):
        known += columns.is_known[k]
        near += columns.is_known[k] & (columns.ranges[k] <= 1.0)
        within_025 += columns.stale_ranges[k] <= 0.25
        within_05 += columns.stale_ranges[k] <= 0.5
        within_1 += columns.stale_ranges[k] <= 1.0
        within_2 += columns.stale_ranges[k] <= 2.0
        staler += columns.stale_ranges[k] < np.inf
    return Shares(
        known=known / num_robots,
        near=(near - 1) / CROWD,  # without oneself
        staler_025=shares[within_025],
        staler_05=shares[within_05],
        staler_1=shares[within_1],
        staler_2=shares[within_2],
        staler=shares[staler],
    )


@compiled(forceinline=True, makes_arrays=False)
def _write_teammates(
    own: OwnBuffer,
    i: int,
    per_mps: float,
    columns: BufferColumns,
    shares: Float[np.ndarray, "_"],
    team: Shares,
    its: OwnNodes,
    may_address: Bool[np.ndarray, "N"],
) -> None:
    """Write what was found, and velocities and parents: zeros of who was never heard of."""
    x_mps, y_mps = own.velocity_mps[i]
    # All in one loop: of a loop for a few fields vectors would be made, which are slow to scatter.
    for k in range(len(its)):
        of_k: BufferNode = its[k]
        is_known = columns.is_known[k]
        per_mps_known = per_mps if is_known else 0.0
        of_k.is_oneself = 0.0
        of_k.is_known = is_known
        of_k.timestamp_age = columns.timestamp_age[k]
        of_k.attempt_age = columns.attempt_age[k]
        of_k.x = max(-FAR_RANGES, min(FAR_RANGES, columns.x[k]))
        of_k.y = max(-FAR_RANGES, min(FAR_RANGES, columns.y[k]))
        of_k.distance = columns.distance[k]
        of_k.is_near = is_known & (columns.ranges[k] <= 1.0)
        of_k.is_direct = is_known & (own.parent[k] == i)
        of_k.velocity_x = (own.velocity_mps[k, 0] - x_mps) * per_mps_known
        of_k.velocity_y = (own.velocity_mps[k, 1] - y_mps) * per_mps_known
        of_k.is_staler = columns.stale_ranges[k] < np.inf
        of_k.rank = shares[int(columns.num_before[k])]
        of_k.known_share = team.known
        of_k.neighbours = team.near
        of_k.team_size = len(its) / TEAM
        of_k.staler_025 = team.staler_025
        of_k.staler_05 = team.staler_05
        of_k.staler_1 = team.staler_1
        of_k.staler_2 = team.staler_2
        of_k.staler = team.staler
        may_address[k] = not is_known or columns.distance[k] <= ADDRESS_DISTANCE
    of_itself: BufferNode = its[i]
    of_itself.is_oneself = 1.0
    of_itself.is_near = 0.0
    of_itself.is_direct = 0.0


@compiled(makes_arrays=False)
def count_before(times: Float[np.ndarray, "N"], num_before: Float[np.ndarray, "N"]) -> None:
    """Count for each time how many are before it: its rank, which equal times share."""
    num_before[:] = 0.0
    for j in range(len(times)):  # faster than to sort the times
        # Added up as numbers of one kind: a count in whole numbers takes longer.
        for k in range(len(times)):
            num_before[k] += 1.0 if times[j] < times[k] else 0.0


@compiled(makes_arrays=False)
def write_lengths(
    x: Float[np.ndarray, "N"], y: Float[np.ndarray, "N"], lengths: Float[np.ndarray, "N"]
) -> None:
    """Write N vectors' lengths, each as `length` returns it."""
    num_unclear = 0
    for k in range(len(lengths)):
        root = math.sqrt(x[k] * x[k] + y[k] * y[k])
        lengths[k] = root
        num_unclear += not _is_clear(root)
    if num_unclear > 0:
        for k in range(len(lengths)):
            lengths[k] = length(x[k], y[k])


@compiled(makes_arrays=False)
def length(x: float, y: float) -> float:
    """Return a vector's length: in single precision that of `math.hypot`, but much faster."""
    root = math.sqrt(x * x + y * y)
    return root if _is_clear(root) else math.hypot(x, y)


@compiled(makes_arrays=False)
def _is_clear(root: float) -> bool:
    """Return whether the last bits of a square root do not matter."""
    # They do only where single precision rounds up or down, and at the range, to which lengths are
    # compared before they are rounded.
    is_clear = np.float32(root * LESS) == np.float32(root * MORE)
    return is_clear & ((root < LESS) | (root > MORE))


@compiled()
def share_of_team(count: int) -> float:
    """Return a count of robots on a logarithmic scale, 1 at `TEAM`."""
    return math.log1p(count) / math.log1p(TEAM)
