"""The turn features: T, M, P and L of a robot's own buffer, and who is due to speak by these alone.

A robot is stale if its T, the time of its last packet that anyone passed on, is long ago. Among
robots that are some ranges apart, those who are stalest are due. So robots share the air without an
order of identities, a clock or a memory of packets. Nothing tells the size of the team.
"""

from typing import Annotated, ClassVar, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.mission.geometry import HEIGHT, PLANE
from swarm_mj.policies.gnn.features import Feature, dtype_of, names_of
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import log_age
from swarm_mj.policies.gnn.scales import ADDRESS_RANGES, CROWD, FAR_RANGES, TEAM
from swarm_mj.protocol.buffers import NEVER, NO_PARENT
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled

# How far apart robots are that are due at once, in `TurnNode`'s order [ranges]. The shortest are
# for ranges as wide as the area, where the nearest of many senders is decoded.
DISTANCES_APART = np.array([0.15, 0.25, 0.35, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0])
AT_015, AT_025, AT_035, AT_05, AT_07, AT_1, AT_15, AT_2, AT_3 = range(9)  # the place of each
MOST_HOPS = 10  # counted; parents of news from different times may lead in a circle
MANY_HOPS = 5.0  # that count as 1


class TurnNode:
    """A node, in the network's order: T, M, P and L of one robot's buffer, and who is due by T.

    From `unknown` on, numbers are the same in all nodes of a graph.
    """

    is_oneself: Annotated[float, Feature("is oneself")]
    is_known: Annotated[float, Feature("is known")]
    timestamp_age: Annotated[float, Feature("age of T")]
    attempt_age: Annotated[float, Feature("age of L")]  # of oneself: since it last spoke first
    x: Annotated[float, Feature("x, in ranges")]
    y: Annotated[float, Feature("y, in ranges")]
    distance: Annotated[float, Feature("distance")]  # of `FAR_RANGES`; 1 if unknown
    is_near: Annotated[float, Feature("is in range")]
    is_direct: Annotated[float, Feature("P is oneself")]
    velocity_x: Annotated[float, Feature("v_x")]
    velocity_y: Annotated[float, Feature("v_y")]
    nearness: Annotated[float, Feature("rank by distance")]  # 0: oneself
    is_staler: Annotated[float, Feature("is staler")]  # comes before oneself
    # 0: the stalest; of oneself by its own last packet
    rank: Annotated[float, Feature("rank by T")]
    is_answered: Annotated[float, Feature("T is not from before L")]  # heard of since addressed
    behind: Annotated[float, Feature("teammates behind it in the tree of P")]
    hops: Annotated[float, Feature("hops in the tree of P")]
    due_015: Annotated[float, Feature("is due within 0.15 ranges")]
    due_025: Annotated[float, Feature("is due within 0.25 ranges")]
    due_035: Annotated[float, Feature("is due within 0.35 ranges")]
    due_05: Annotated[float, Feature("is due within 0.5 ranges")]
    due_07: Annotated[float, Feature("is due within 0.7 ranges")]
    due_1: Annotated[float, Feature("is due within 1 range")]
    due_15: Annotated[float, Feature("is due within 1.5 ranges")]
    due_2: Annotated[float, Feature("is due within 2 ranges")]
    due_3: Annotated[float, Feature("is due within 3 ranges")]
    unknown: Annotated[float, Feature("teammates unknown")]
    neighbours: Annotated[float, Feature("neighbours")]
    staler_025: Annotated[float, Feature("staler robots within 0.25 ranges")]
    staler_05: Annotated[float, Feature("staler robots within 0.5 ranges")]
    staler_1: Annotated[float, Feature("staler robots within 1 range")]
    staler_2: Annotated[float, Feature("staler robots within 2 ranges")]
    staler: Annotated[float, Feature("staler robots")]
    # These know no range: how many share the air depends on how close they are.
    staler_of_3: Annotated[float, Feature("staler robots among the nearest 3")]
    staler_of_6: Annotated[float, Feature("staler robots among the nearest 6")]
    staler_of_12: Annotated[float, Feature("staler robots among the nearest 12")]
    staler_of_24: Annotated[float, Feature("staler robots among the nearest 24")]
    own_age: Annotated[float, Feature("since the robot last spoke first")]
    is_own_answered: Annotated[float, Feature("its last packet was answered")]
    oldest_age: Annotated[float, Feature("greatest age of T")]
    newest_age: Annotated[float, Feature("least age of T")]  # grows while nobody gets through
    own_due_015: Annotated[float, Feature("is itself due within 0.15 ranges")]
    own_due_025: Annotated[float, Feature("is itself due within 0.25 ranges")]
    own_due_035: Annotated[float, Feature("is itself due within 0.35 ranges")]
    own_due_05: Annotated[float, Feature("is itself due within 0.5 ranges")]
    own_due_07: Annotated[float, Feature("is itself due within 0.7 ranges")]
    own_due_1: Annotated[float, Feature("is itself due within 1 range")]
    own_due_15: Annotated[float, Feature("is itself due within 1.5 ranges")]
    own_due_2: Annotated[float, Feature("is itself due within 2 ranges")]
    own_due_3: Annotated[float, Feature("is itself due within 3 ranges")]


NODE = dtype_of(TurnNode)

Nodes = Shaped[np.ndarray, "B N N"]  # of `NODE`
OwnNodes = Shaped[np.ndarray, "N"]  # those of one robot's graph


class OwnBuffer(NamedTuple):
    """One robot's buffer; k is a teammate, or the robot itself."""

    timestamp: Float[np.ndarray, "N"]  # T^k [windows]
    last_attempt: Float[np.ndarray, "N"]  # L^k [windows]
    position_m: Float[np.ndarray, "N D"]  # M^k
    velocity_mps: Float[np.ndarray, "N D"]  # M^k
    parent: Int[np.ndarray, "N"]  # P^k
    is_granted: bool  # whether it knew all states at t = 0
    spoke: float  # when it last addressed anyone [windows]


class Known(NamedTuple):
    """The robots that one robot knows, itself included, the stalest first; room for all N.

    Who is equally stale comes by its believed x: all that hear of both agree on that.
    """

    robot: Int[np.ndarray, "N"]  # who it is
    x: Float[np.ndarray, "N"]  # where it is believed to be, from oneself [ranges]
    y: Float[np.ndarray, "N"]
    since_of: Float[np.ndarray, "N"]  # T of robot k; of oneself its last packet [windows]
    x_of: Float[np.ndarray, "N"]  # x of robot k
    y_of: Float[np.ndarray, "N"]
    nearer: Int[np.ndarray, "N"]  # how many of them are nearer
    gap: Float[np.ndarray, "N"]  # to the nearest that is due, squared; room for `_write_due`
    by_distance: Int[np.ndarray, "N"]  # room for `_rank_by_distance`


class Tree(NamedTuple):
    """The tree that the parents P make of one robot's news, itself at the root."""

    behind: Int[np.ndarray, "N"]  # how many teammates' news came through k
    hops: Int[np.ndarray, "N"]  # from k to the robot; 0 of who was never heard of by radio


class TurnFeatures(FeatureExtractor):
    """The paper's information, with whose turn it is by staleness: the fields of `TurnNode`."""

    names: ClassVar[tuple[str, ...]] = names_of(TurnNode)
    uses: ClassVar[str] = "its buffer, the radio's range and V_max"

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
    position_m: Float[np.ndarray, "B N N D"],
    velocity_mps: Float[np.ndarray, "B N N D"],
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
    known = Known(
        robot=np.empty(num_robots, np.int64),
        x=np.empty(num_robots),
        y=np.empty(num_robots),
        since_of=np.empty(num_robots),
        x_of=np.empty(num_robots),
        y_of=np.empty(num_robots),
        nearer=np.empty(num_robots, np.int64),
        gap=np.empty(num_robots),
        by_distance=np.empty(num_robots, np.int64),
    )
    tree = Tree(behind=np.empty(num_robots, np.int64), hops=np.empty(num_robots, np.int64))
    is_due = np.empty((len(DISTANCES_APART), num_robots), np.bool_)
    shares = np.log1p(np.arange(num_robots + 1)) / np.log1p(TEAM)  # of all counts of robots
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
                spoke=_last_spoken(last_attempt[b, i], i),
            )
            num_known = _sort_known(own, i, 1.0 / range_m, known)
            _rank_by_distance(known, num_known)
            for level in range(len(DISTANCES_APART)):
                _write_due(known, num_known, DISTANCES_APART[level], is_due[level])
            _follow_parents(own, i, tree)
            its = node[b, i]
            _write_teammates(own, i, now[b], 1.0 / range_m, 1.0 / max_mps, its, may_address[b, i])
            _write_counts(own, i, now[b], known, num_known, shares, its)
            for k in range(num_robots):
                _write_place(k, i, tree, shares, is_due, its[k])


@compiled(forceinline=True, makes_arrays=False)
def _last_spoken(last_attempt: Float[np.ndarray, "N"], i: int) -> float:
    """Return when robot i last addressed a teammate, or NEVER: silence may be noted as well."""
    spoke = NEVER
    for k in range(len(last_attempt)):
        if k != i:
            spoke = max(spoke, last_attempt[k])
    return spoke


@compiled(forceinline=True, makes_arrays=False)
def _sort_known(own: OwnBuffer, i: int, per_m: float, known: Known) -> int:
    """Sort the robots that are known by their staleness; return how many there are."""
    num_known = 0
    for k in range(len(own.timestamp)):
        if not is_known(own, i, k):
            continue
        known.since_of[k] = own.spoke if k == i else own.timestamp[k]
        known.x_of[k] = (own.position_m[k, 0] - own.position_m[i, 0]) * per_m
        known.y_of[k] = (own.position_m[k, 1] - own.position_m[i, 1]) * per_m
        place = num_known  # an insertion sort: robots are few
        while place > 0 and _is_before(k, known.robot[place - 1], known):
            known.robot[place] = known.robot[place - 1]
            place -= 1
        known.robot[place] = k
        num_known += 1
    for place in range(num_known):
        known.x[place] = known.x_of[known.robot[place]]
        known.y[place] = known.y_of[known.robot[place]]
    return num_known


@compiled(forceinline=True, makes_arrays=False)
def _rank_by_distance(known: Known, num_known: int) -> None:
    """Write how many of the robots that are known are nearer than each, the staler if as near."""
    apart = known.gap
    for place in range(num_known):
        apart[place] = known.x[place] ** 2 + known.y[place] ** 2
        rank = place  # an insertion sort, again
        while rank > 0 and apart[place] < apart[known.by_distance[rank - 1]]:
            known.by_distance[rank] = known.by_distance[rank - 1]
            rank -= 1
        known.by_distance[rank] = place
    for rank in range(num_known):
        known.nearer[known.by_distance[rank]] = rank


@compiled(makes_arrays=False)
def _write_due(
    known: Known, num_known: int, apart_ranges: float, is_due: Bool[np.ndarray, "N"]
) -> None:
    """Write who is due: the stalest, and then each that is far enough from all who are."""
    x, y, gap = known.x, known.y, known.gap
    is_due[:] = False
    gap[:num_known] = np.inf
    for place in range(num_known):
        if gap[place] < apart_ranges * apart_ranges:
            continue
        is_due[known.robot[place]] = True
        # Over all of them, and written each time: the loop becomes vectors.
        for j in range(num_known):
            dx = x[j] - x[place]
            dy = y[j] - y[place]
            apart = dx * dx + dy * dy
            gap[j] = apart if apart < gap[j] else gap[j]


@compiled(forceinline=True, makes_arrays=False)
def _follow_parents(own: OwnBuffer, i: int, tree: Tree) -> None:
    """Follow each teammate's news to the robot, from parent to parent."""
    tree.behind[:] = 0
    tree.hops[:] = 0
    for k in range(len(own.parent)):
        above = own.parent[k]
        if k == i or above == NO_PARENT:
            continue
        hops = 1
        while above != i and above != NO_PARENT and hops < MOST_HOPS:
            tree.behind[above] += 1
            above = own.parent[above]
            hops += 1
        tree.hops[k] = hops


@compiled(forceinline=True, makes_arrays=False)
def _write_teammates(
    own: OwnBuffer,
    i: int,
    now: float,
    per_m: float,
    per_mps: float,
    its: OwnNodes,
    may_address: Bool[np.ndarray, "N"],
) -> None:
    """Write ages, and states relative to robot i's own: those of who was never heard of are far."""
    for k in range(len(its)):
        of_k: TurnNode = its[k]
        is_heard_of = is_known(own, i, k)
        attempt = own.last_attempt[k]
        of_k.is_oneself = k == i
        of_k.is_known = is_heard_of
        of_k.timestamp_age = log_age(now, own.timestamp[k], is_heard_of)
        of_k.attempt_age = log_age(now, own.spoke if k == i else attempt)
        of_k.is_answered = k != i and NEVER < attempt <= own.timestamp[k]
        of_k.is_direct = k != i and own.parent[k] == i
        x = y = x_mps = y_mps = 0.0
        ranges = FAR_RANGES
        if is_heard_of:
            x = (own.position_m[k, 0] - own.position_m[i, 0]) * per_m
            y = (own.position_m[k, 1] - own.position_m[i, 1]) * per_m
            x_mps = own.velocity_mps[k, 0] - own.velocity_mps[i, 0]
            y_mps = own.velocity_mps[k, 1] - own.velocity_mps[i, 1]
            squared = x * x + y * y
            if own.position_m.shape[1] > PLANE:  # ranks and turns below are by places in the plane
                squared += ((own.position_m[k, HEIGHT] - own.position_m[i, HEIGHT]) * per_m) ** 2
            ranges = np.sqrt(squared)
        of_k.x = max(-FAR_RANGES, min(FAR_RANGES, x))
        of_k.y = max(-FAR_RANGES, min(FAR_RANGES, y))
        of_k.distance = min(FAR_RANGES, ranges) / FAR_RANGES
        of_k.is_near = k != i and ranges <= 1.0
        of_k.velocity_x = x_mps * per_mps
        of_k.velocity_y = y_mps * per_mps
        may_address[k] = not is_heard_of or ranges <= ADDRESS_RANGES


@compiled(forceinline=True, makes_arrays=False)
def _write_counts(
    own: OwnBuffer,
    i: int,
    now: float,
    known: Known,
    num_known: int,
    shares: Float[np.ndarray, "_"],
    its: OwnNodes,
) -> None:
    """Write ranks, and what is the same in all nodes but for turns."""
    num_robots = len(its)
    for k in range(num_robots):
        of_any: TurnNode = its[k]
        of_any.is_staler = 0.0
        of_any.rank = shares[num_known]  # last, and together; those of known ones follow
        of_any.nearness = shares[num_known]
    within_025 = within_05 = within_1 = within_2 = near = 0
    of_3 = of_6 = of_12 = of_24 = 0
    staler = num_known
    oldest = now
    newest = NEVER
    for place in range(num_known):
        k = int(known.robot[place])
        of_k: TurnNode = its[k]
        of_k.rank = shares[place]
        of_k.nearness = shares[int(known.nearer[place])]
        if k == i:
            staler = place
            continue
        near += of_k.is_near > 0.0
        oldest = min(oldest, known.since_of[k])
        newest = max(newest, known.since_of[k])
        if place < staler:
            of_k.is_staler = 1.0
            ranges = np.sqrt(known.x[place] ** 2 + known.y[place] ** 2)
            within_025 += ranges <= 0.25
            within_05 += ranges <= 0.5
            within_1 += ranges <= 1.0
            within_2 += ranges <= 2.0
            of_3 += known.nearer[place] <= 3
            of_6 += known.nearer[place] <= 6
            of_12 += known.nearer[place] <= 12
            of_24 += known.nearer[place] <= 24
    is_answered = False
    for k in range(num_robots):
        is_last = own.spoke > NEVER and own.last_attempt[k] == own.spoke
        is_answered |= is_last and k != i and own.timestamp[k] >= own.spoke
    own_age = log_age(now, own.spoke)
    oldest_age = log_age(now, oldest, True)
    newest_age = log_age(now, newest)
    for k in range(num_robots):
        of_each: TurnNode = its[k]
        of_each.unknown = shares[num_robots - num_known]
        of_each.neighbours = near / CROWD
        of_each.staler_025 = shares[within_025]
        of_each.staler_05 = shares[within_05]
        of_each.staler_1 = shares[within_1]
        of_each.staler_2 = shares[within_2]
        of_each.staler = shares[staler]
        of_each.staler_of_3 = shares[of_3]
        of_each.staler_of_6 = shares[of_6]
        of_each.staler_of_12 = shares[of_12]
        of_each.staler_of_24 = shares[of_24]
        of_each.own_age = own_age
        of_each.is_own_answered = is_answered
        of_each.oldest_age = oldest_age
        of_each.newest_age = newest_age


@compiled(forceinline=True, makes_arrays=False)
def _write_place(
    k: int,
    i: int,
    tree: Tree,
    shares: Float[np.ndarray, "_"],
    is_due: Bool[np.ndarray, "D N"],
    node: TurnNode,
) -> None:
    """Write where k stands in the tree of P, and in the turns; and the robot's own turns."""
    node.behind = shares[int(tree.behind[k])]
    node.hops = tree.hops[k] / MANY_HOPS
    node.due_015 = is_due[AT_015, k]
    node.own_due_015 = is_due[AT_015, i]
    node.due_025 = is_due[AT_025, k]
    node.own_due_025 = is_due[AT_025, i]
    node.due_035 = is_due[AT_035, k]
    node.own_due_035 = is_due[AT_035, i]
    node.due_05 = is_due[AT_05, k]
    node.own_due_05 = is_due[AT_05, i]
    node.due_07 = is_due[AT_07, k]
    node.own_due_07 = is_due[AT_07, i]
    node.due_1 = is_due[AT_1, k]
    node.own_due_1 = is_due[AT_1, i]
    node.due_15 = is_due[AT_15, k]
    node.own_due_15 = is_due[AT_15, i]
    node.due_2 = is_due[AT_2, k]
    node.own_due_2 = is_due[AT_2, i]
    node.due_3 = is_due[AT_3, k]
    node.own_due_3 = is_due[AT_3, i]


@compiled(forceinline=True, makes_arrays=False)
def is_known(own: OwnBuffer, i: int, k: int) -> bool:
    """Return whether robot i, whose buffer it is, knows of k."""
    return k == i or own.timestamp[k] > NEVER or own.is_granted


@compiled(forceinline=True, makes_arrays=False)
def _is_before(k: int, j: int, known: Known) -> bool:
    """Return whether robot k is staler than j, or as stale and farther to the left."""
    if known.since_of[k] != known.since_of[j]:
        return known.since_of[k] < known.since_of[j]
    if known.x_of[k] != known.x_of[j]:
        return known.x_of[k] < known.x_of[j]
    return known.y_of[k] < known.y_of[j]
