"""The extended features: all that one robot can tell of each teammate.

From its own buffer, the packets it sent and decoded, its identity, the team's size and the clock.
"""

import math
from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Shaped

from swarm_mj.policies.gnn.features import Feature, dtype_of, features_of, names_of
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import (
    Memory,
    empty_memory,
    log_age,
    logarithm,
    remember,
    write_log_ages,
)
from swarm_mj.policies.gnn.scales import ADDRESS_RANGES, CROWD, FAR_RANGES, TEAM
from swarm_mj.policies.gnn.turns import (
    Beliefs,
    count_near,
    empty_beliefs,
    take_beliefs,
    write_turns,
)
from swarm_mj.protocol.buffers import NEVER
from swarm_mj.protocol.timestamps import rise
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.spatial_reuse import (
    Slot,
    ask_in_turn,
    empty_slot,
    write_joined,
)
from swarm_mj.system.compiled import compiled
from swarm_mj.system.decibels import from_db


class ExtendedNode:
    """A node's knowledge of a teammate, in the network's order.

    A node of the robot itself carries what concerns all of its neighbours.
    """

    is_oneself: Annotated[float, Feature("is oneself")]
    is_known: Annotated[float, Feature("is known")]
    timestamp_age: Annotated[float, Feature("age of T")]
    distance: Annotated[float, Feature("distance")]  # of `FAR_RANGES`
    is_near: Annotated[float, Feature("is in range")]
    # Of oneself: since it last spoke first.
    heard_age: Annotated[float, Feature("age of last packet heard")]
    attempt_age: Annotated[float, Feature("age of last attempt")]
    addressed_age: Annotated[float, Feature("age of last being addressed")]
    # Of oneself, these two are to all in range together.
    news: Annotated[float, Feature("news to it, by its last packet")]
    unsaid_news: Annotated[float, Feature("news to it, if it heard what was said last")]
    turn_rank: Annotated[float, Feature("rank of its turn", needs_turns=True)]
    has_turn_1_5: Annotated[float, Feature("has a turn, 1.5 ranges apart", needs_turns=True)]
    has_turn_2: Annotated[float, Feature("has a turn, 2 ranges apart", needs_turns=True)]
    has_turn_3: Annotated[float, Feature("has a turn, 3 ranges apart", needs_turns=True)]
    has_joined: Annotated[float, Feature("has a turn, by interference", needs_turns=True)]
    neighbours: Annotated[float, Feature("neighbours")]
    known_share: Annotated[float, Feature("share of the team known")]
    team_size: Annotated[float, Feature("size of the team")]


LOCAL_FEATURES = {field: f for field, f in features_of(ExtendedNode).items() if not f.needs_turns}
NODE = dtype_of(ExtendedNode)
LOCAL_NODE = np.dtype([(field, np.float32) for field in LOCAL_FEATURES])

Places = Float[np.ndarray, "B N N D"]
Flags = Bool[np.ndarray, "B N N"]
Nodes = Shaped[np.ndarray, "B N N"]  # of `NODE` or `LOCAL_NODE`
OwnNodes = Shaped[np.ndarray, "N"]  # those of one robot's graph
Timestamps = Float32[np.ndarray, "N"]
OfNodes = Float32[np.ndarray, "N"]  # a field of one robot's nodes


class ExtendedColumns(NamedTuple):
    """Room for what one robot knows of its teammates: loops over columns become vectors."""

    is_known: Bool[np.ndarray, "N"]
    ranges: Float[np.ndarray, "N"]  # how far off each of them is believed to be [ranges]
    timestamp_age: OfNodes
    heard_age: OfNodes
    attempt_age: OfNodes
    addressed_age: OfNodes
    neighbours: OfNodes
    near: Int[np.ndarray, "N"]  # those in range, one after the other
    beliefs: Beliefs


class Turns(NamedTuple):
    """Room for whose turn it is, by the beliefs of one robot."""

    asked: Int[np.ndarray, "N"]  # to join, one after the other
    rank: OfNodes
    has_turn_1_5: OfNodes
    has_turn_2: OfNodes
    has_turn_3: OfNodes
    has_joined: OfNodes
    slot: Slot


class ExtendedFeatures(FeatureExtractor):
    """Features for learning in minutes: the fields of `ExtendedNode`."""

    names: ClassVar[tuple[str, ...]] = names_of(ExtendedNode)
    uses: ClassVar[str] = (
        "its buffer, the packets it sent and received, the size of the team, and whose turn it is "
        "by the rule of spatial-tdma, in the order of identities and by the clock"
    )
    remembers_packets: ClassVar[bool] = True
    gives_turns: ClassVar[bool] = True
    node: ClassVar[np.dtype] = NODE

    def start(self, num_missions: int, num_robots: int) -> None:
        """Forget the packets of earlier missions."""
        self._memory = empty_memory(num_missions, num_robots)
        self._columns = _empty_columns(num_robots)
        self._turns: Turns | None = _empty_turns(num_robots)

    def graphs(self, views: LocalViews) -> Graphs:
        """Return what every robot's network sees now; must see every window."""
        remember(self._memory, views)
        buffers = views.buffers
        num_robots = views.num_robots
        node = np.empty(buffers.timestamp.shape, dtype=self.node)
        may_address = np.empty(node.shape, dtype=np.bool_)
        has_turn = np.zeros(buffers.shape, dtype=np.bool_)
        _write_nodes(
            memory=self._memory,
            last_attempt=buffers.last_attempt,
            is_granted=buffers.is_granted,
            believed_m=buffers.position_m,
            now=views.now,
            range_m=self._mission.range_m,
            threshold=from_db(self._mission.sinr_threshold_db),
            columns=self._columns,
            turns=self._turns,
            node=node,
            may_address=may_address,
            has_turn=has_turn,
        )
        rows = (len(node) * num_robots, num_robots)
        return Graphs(
            node=node.view(np.float32).reshape(*rows, -1),
            parent=buffers.parent.reshape(rows),
            may_address=may_address.reshape(rows),
            has_turn=has_turn.reshape(-1),
        )


class LocalFeatures(ExtendedFeatures):
    """The extended features without whose turn it is: nothing that a common order grants."""

    names: ClassVar[tuple[str, ...]] = tuple(feature.name for feature in LOCAL_FEATURES.values())
    uses: ClassVar[str] = "its buffer, and the packets it sent and received"
    gives_turns: ClassVar[bool] = False
    node: ClassVar[np.dtype] = LOCAL_NODE

    def start(self, num_missions: int, num_robots: int) -> None:
        """Forget the packets of earlier missions."""
        super().start(num_missions, num_robots)
        self._turns = None


@compiled()
def _empty_columns(num_robots: int) -> ExtendedColumns:
    return ExtendedColumns(
        is_known=np.empty(num_robots, dtype=np.bool_),
        ranges=np.empty(num_robots),
        timestamp_age=np.empty(num_robots, dtype=np.float32),
        heard_age=np.empty(num_robots, dtype=np.float32),
        attempt_age=np.empty(num_robots, dtype=np.float32),
        addressed_age=np.empty(num_robots, dtype=np.float32),
        neighbours=np.empty(num_robots, dtype=np.float32),
        near=np.empty(num_robots, dtype=np.int64),
        beliefs=empty_beliefs(num_robots),
    )


@compiled()
def _empty_turns(num_robots: int) -> Turns:
    return Turns(
        asked=np.empty(num_robots, dtype=np.int64),
        rank=np.empty(num_robots, dtype=np.float32),
        has_turn_1_5=np.empty(num_robots, dtype=np.float32),
        has_turn_2=np.empty(num_robots, dtype=np.float32),
        has_turn_3=np.empty(num_robots, dtype=np.float32),
        has_joined=np.empty(num_robots, dtype=np.float32),
        slot=empty_slot(num_robots),
    )


@compiled()
def _write_nodes(
    memory: Memory,
    last_attempt: Float[np.ndarray, "B N N"],
    is_granted: Bool[np.ndarray, "B"],
    believed_m: Places,
    now: Float[np.ndarray, "B"],
    range_m: float,
    threshold: float,
    columns: ExtendedColumns,
    turns: Turns | None,
    node: Nodes,
    may_address: Flags,
    has_turn: Bool[np.ndarray, "B N"],
) -> None:
    """Write every robot's graph, whom it may address, and its turn unless `turns` is None."""
    num_missions, num_robots = node.shape[:2]
    robots = np.arange(num_robots)
    for b in range(num_missions):
        window = int(now[b])
        if turns is not None:
            turns.asked[:] = ask_in_turn(robots, window)
            turns.rank[:] = (robots - window) % num_robots / num_robots
        _write_team(
            memory=memory,
            last_attempt=last_attempt[b],
            is_granted=is_granted[b],
            believed_m=believed_m[b],
            b=b,
            now=now[b],
            range_m=range_m,
            threshold=threshold,
            columns=columns,
            turns=turns,
            node=node[b],
            may_address=may_address[b],
            has_turn=has_turn[b],
        )


@compiled(makes_arrays=False)
def _write_team(
    memory: Memory,
    last_attempt: Float[np.ndarray, "N N"],
    is_granted: bool,
    believed_m: Float[np.ndarray, "N N D"],
    b: int,
    now: float,
    range_m: float,
    threshold: float,
    columns: ExtendedColumns,
    turns: Turns | None,
    node: Shaped[np.ndarray, "N N"],
    may_address: Bool[np.ndarray, "N N"],
    has_turn: Bool[np.ndarray, "N"],
) -> None:
    """Write the graphs of the robots of mission b."""
    # One robot's nodes after the other's: they fit into the processor's nearest memory.
    for i in range(len(node)):
        write_log_ages(now, memory.timestamp[b, i], is_granted, columns.timestamp_age)
        write_log_ages(now, memory.heard[b, i], False, columns.heard_age)
        write_log_ages(now, last_attempt[i], False, columns.attempt_age)
        write_log_ages(now, memory.addressed_by[b, i], False, columns.addressed_age)
        columns.heard_age[i] = log_age(now, memory.sent[b, i])
        for k in range(len(node)):
            columns.is_known[k] = (memory.timestamp[b, i, k] > NEVER) | is_granted | (k == i)
        is_new = take_beliefs(believed_m[i], columns.is_known, columns.beliefs)
        # Of a team at rest most robots believe the same: no need to count all of it again.
        if is_new or i == 0:
            _find_neighbours(columns, range_m)
            if turns is not None:
                _find_turns(
                    believed_m=believed_m[i],
                    beliefs=columns.beliefs,
                    window=int(now),
                    range_m=range_m,
                    threshold=threshold,
                    turns=turns,
                )
        num_near = _write_teammates(
            i=i,
            range_m=range_m,
            columns=columns,
            turns=turns,
            its=node[i],
            may_address=may_address[i],
        )
        if turns is not None:
            has_turn[i] = turns.has_joined[i] > 0.0
        _write_news(memory, b, i, columns.near[:num_near], node[i])


@compiled(forceinline=True, makes_arrays=False)
def _write_teammates(
    i: int,
    range_m: float,
    columns: ExtendedColumns,
    turns: Turns | None,
    its: OwnNodes,
    may_address: Bool[np.ndarray, "N"],
) -> int:
    """Write all but news, which are 0 so far; return how many are near, of whom `near` tells."""
    num_robots = len(its)
    is_known = columns.is_known
    x_m = columns.beliefs.x_m
    y_m = columns.beliefs.y_m
    for k in range(num_robots):
        dx = x_m[k] - x_m[i]
        dy = y_m[k] - y_m[i]
        columns.ranges[k] = math.sqrt(dx * dx + dy * dy) / range_m
    num_known = 0
    for k in range(num_robots):
        num_known += is_known[k]
    num_near = 0
    # All in one loop: of a loop for a few fields vectors would be made, which are slow to scatter.
    for k in range(num_robots):
        of_k: ExtendedNode = its[k]
        ranges = columns.ranges[k]
        is_near = is_known[k] and k != i and ranges <= 1.0
        # One of unknown position may be near, so it may be addressed.
        may_address[k] = not is_known[k] or ranges <= ADDRESS_RANGES
        of_k.is_oneself = 0.0
        of_k.is_known = is_known[k]
        of_k.timestamp_age = columns.timestamp_age[k]
        of_k.distance = min(ranges, FAR_RANGES) / FAR_RANGES if is_known[k] else 0.0
        of_k.is_near = is_near
        of_k.heard_age = columns.heard_age[k]
        of_k.attempt_age = columns.attempt_age[k]
        of_k.addressed_age = columns.addressed_age[k]
        of_k.news = 0.0
        of_k.unsaid_news = 0.0
        if turns is not None:
            of_k.turn_rank = turns.rank[k]
            of_k.has_turn_1_5 = turns.has_turn_1_5[k]
            of_k.has_turn_2 = turns.has_turn_2[k]
            of_k.has_turn_3 = turns.has_turn_3[k]
            of_k.has_joined = turns.has_joined[k]
        of_k.neighbours = columns.neighbours[k]
        of_k.known_share = num_known / num_robots
        of_k.team_size = num_robots / TEAM
        columns.near[num_near] = k
        num_near += is_near
    of_itself: ExtendedNode = its[i]
    of_itself.is_oneself = 1.0
    return num_near


@compiled(forceinline=True, makes_arrays=False)
def _write_news(memory: Memory, b: int, i: int, near: Int[np.ndarray, "_"], its: OwnNodes) -> None:
    """Write what a robot's packet would tell its neighbours; its own news is to all of them.

    Who is out of range cannot be reached, so there is no news to it.
    """
    own = memory.timestamp[b, i]
    said = memory.said[b, i]
    for n in range(len(near)):
        k = int(near[n])
        packet = memory.packet[b, k, memory.decoded[b, i, k]]
        of_k: ExtendedNode = its[k]
        of_k.news, of_k.unsaid_news = _rises(own, packet, said)
    # Sums first and logarithms then: what is said to all adds up in windows. And apart from the
    # loop above, in which the processor can then fetch several packets from memory at once.
    news = 0.0
    unsaid_news = 0.0
    for n in range(len(near)):
        of_near: ExtendedNode = its[int(near[n])]
        news += of_near.news
        unsaid_news += of_near.unsaid_news
        of_near.news = logarithm(of_near.news)
        of_near.unsaid_news = logarithm(of_near.unsaid_news)
    of_itself: ExtendedNode = its[i]
    of_itself.news = logarithm(news)
    of_itself.unsaid_news = logarithm(unsaid_news)


@compiled(fastmath=True, makes_arrays=False)
def _rises(own: Timestamps, neighbour: Timestamps, said: Timestamps) -> tuple[float, float]:
    """Mean rise of a neighbour's T if it heard all: by its packet, or also by one's own."""
    zero = np.float32(0.0)
    by_packet = zero
    by_both = zero
    for j in range(own.shape[0]):
        by_packet += rise(own[j], neighbour[j])
        by_both += rise(own[j], max(neighbour[j], said[j]))
    return by_packet / own.shape[0], by_both / own.shape[0]


@compiled(makes_arrays=False)
def _find_neighbours(columns: ExtendedColumns, range_m: float) -> None:
    """Find how many neighbours each robot has, by one robot's beliefs."""
    num_near = columns.beliefs.num_near
    count_near(columns.beliefs, range_m)
    for k in range(len(num_near)):
        # It finds itself, too; who is unknown finds nobody.
        columns.neighbours[k] = max(0.0, num_near[k] - 1.0) / CROWD


@compiled(makes_arrays=False)
def _find_turns(
    believed_m: Float[np.ndarray, "N D"],
    beliefs: Beliefs,
    window: int,
    range_m: float,
    threshold: float,
    turns: Turns,
) -> None:
    """Find whose turn it is, which follows from positions and the clock alone."""
    write_turns(beliefs, window, 1.5 * range_m, turns.has_turn_1_5)
    write_turns(beliefs, window, 2.0 * range_m, turns.has_turn_2)
    write_turns(beliefs, window, 3.0 * range_m, turns.has_turn_3)
    write_joined(
        believed_m=believed_m,
        is_known=beliefs.is_known,
        turn=window,
        asked=turns.asked,
        range_m=range_m,
        threshold=threshold,
        slot=turns.slot,
        has_joined=turns.has_joined,
    )
