"""The extended features: all that one robot can tell of each teammate.

From its own buffer, the packets it sent and decoded, its identity, the team's size and the clock.
"""

import math
from dataclasses import replace
from itertools import compress
from typing import Annotated, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Float32, Shaped

from swarm_mj.mission.geometry import squared_distance
from swarm_mj.policies.gnn.features import Feature, dtype_of, features_of, names_of
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import Memory, empty_memory, log_age, logarithm, remember
from swarm_mj.policies.gnn.scales import ADDRESS_RANGES, CROWD, FAR_RANGES, TEAM
from swarm_mj.policies.gnn.turns import (
    Beliefs,
    count_near,
    empty_beliefs,
    take_beliefs,
    write_turns,
)
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.spatial_reuse import (
    ask_in_turn,
    believes_as_the_last,
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


NODE = dtype_of(ExtendedNode)
IS_LOCAL = tuple(not feature.needs_turns for feature in features_of(ExtendedNode).values())

Places = Float[np.ndarray, "B N N 2"]
Flags = Bool[np.ndarray, "B N N"]
Nodes = Shaped[np.ndarray, "B N N"]  # of `NODE`
OwnNodes = Shaped[np.ndarray, "N"]  # those of one robot's graph
Timestamps = Float32[np.ndarray, "N"]


class ExtendedFeatures(FeatureExtractor):
    """Features for learning in minutes: the fields of `ExtendedNode`."""

    names: ClassVar[tuple[str, ...]] = names_of(ExtendedNode)
    uses: ClassVar[str] = (
        "its buffer, the packets it sent and received, the size of the team, and whose turn it is "
        "by the rule of spatial-tdma, in the order of identities and by the clock"
    )
    remembers_packets: ClassVar[bool] = True

    def start(self, num_missions: int, num_robots: int) -> None:
        """Forget the packets of earlier missions."""
        self._memory = empty_memory(num_missions, num_robots)

    def graphs(self, views: LocalViews) -> Graphs:
        """Return what every robot's network sees now; must see every window."""
        remember(self._memory, views)
        buffers = views.buffers
        range_m = self._mission.range_m
        num_robots = views.num_robots
        node = np.empty(buffers.timestamp.shape, dtype=NODE)
        may_address = np.empty(node.shape, dtype=np.bool_)
        is_observed = buffers.is_known
        is_known = is_observed | np.eye(num_robots, dtype=np.bool_)
        _write_nodes(
            memory=self._memory,
            last_attempt=buffers.last_attempt,
            is_observed=is_observed,
            is_known=is_known,
            believed_m=buffers.position_m,
            now=views.now,
            range_m=range_m,
            threshold=from_db(self._mission.sinr_threshold_db),
            node=node,
            may_address=may_address,
        )
        rows = (len(node) * num_robots, num_robots)
        return Graphs(
            node=node.view(np.float32).reshape(*rows, len(ExtendedFeatures.names)),
            parent=buffers.parent.reshape(rows),
            may_address=may_address.reshape(rows),
            has_turn=np.diagonal(node["has_joined"], axis1=1, axis2=2).reshape(-1) > 0.0,
        )


class LocalFeatures(ExtendedFeatures):
    """The extended features without whose turn it is: nothing that a common order grants."""

    names: ClassVar[tuple[str, ...]] = tuple(compress(ExtendedFeatures.names, IS_LOCAL))
    uses: ClassVar[str] = "its buffer, and the packets it sent and received"

    def graphs(self, views: LocalViews) -> Graphs:
        """Return what every robot's network sees now; must see every window."""
        seen = super().graphs(views)
        node = seen.node[:, :, np.array(IS_LOCAL)]
        return replace(seen, node=node, has_turn=np.zeros_like(seen.has_turn))


@compiled()
def _write_nodes(
    memory: Memory,
    last_attempt: Float[np.ndarray, "B N N"],
    is_observed: Flags,
    is_known: Flags,
    believed_m: Places,
    now: Float[np.ndarray, "B"],
    range_m: float,
    threshold: float,
    node: Nodes,
    may_address: Flags,
) -> None:
    """Write every robot's graph, and whom it may address."""
    num_missions, num_robots = node.shape[:2]
    beliefs = empty_beliefs(num_robots)
    slot = empty_slot(num_robots)
    for b in range(num_missions):
        window = int(now[b])
        asked = ask_in_turn(np.arange(num_robots), window)
        turn_rank = (np.arange(num_robots) - window) % num_robots / num_robots
        for i in range(num_robots):
            # One robot's nodes after the other's: they fit into the processor's nearest memory.
            its = node[b, i]
            _write_ages(
                memory=memory,
                b=b,
                i=i,
                last_attempt=last_attempt[b, i],
                is_observed=is_observed[b, i],
                is_known=is_known[b, i],
                believed_m=believed_m[b, i],
                now=now[b],
                range_m=range_m,
                turn_rank=turn_rank,
                its=its,
                may_address=may_address[b, i],
            )
            _write_news(memory, b, i, its)  # by who is near, which is written by now
            # Of a team at rest most robots believe the same: no need to count all of it again.
            if believes_as_the_last(believed_m[b], is_known[b], i):
                _copy_beliefs(its, node[b, i - 1])
            else:
                take_beliefs(believed_m[b, i], is_known[b, i], beliefs)
                _write_beliefs(beliefs, window, range_m, its)
                write_joined(
                    believed_m=believed_m[b, i],
                    is_known=is_known[b, i],
                    turn=window,
                    asked=asked,
                    range_m=range_m,
                    threshold=threshold,
                    slot=slot,
                    has_joined=its["has_joined"],
                )


@compiled(forceinline=True, makes_arrays=False)
def _write_ages(
    memory: Memory,
    b: int,
    i: int,
    last_attempt: Float[np.ndarray, "N"],
    is_observed: Bool[np.ndarray, "N"],
    is_known: Bool[np.ndarray, "N"],
    believed_m: Float[np.ndarray, "N 2"],
    now: float,
    range_m: float,
    turn_rank: Float[np.ndarray, "N"],
    its: OwnNodes,
    may_address: Bool[np.ndarray, "N"],
) -> None:
    """Write all but news, and what follows from positions and the clock alone."""
    num_robots = len(its)
    num_known = 0
    for k in range(num_robots):
        num_known += is_known[k]
    for k in range(num_robots):
        of_k: ExtendedNode = its[k]
        ranges = math.sqrt(squared_distance(believed_m, k, i)) / range_m
        # One of unknown position may be near, so it may be addressed.
        may_address[k] = not is_known[k] or ranges <= ADDRESS_RANGES
        of_k.is_oneself = k == i
        of_k.is_known = is_known[k]
        of_k.timestamp_age = log_age(now, memory.timestamp[b, i, k], is_observed[k])
        of_k.distance = min(ranges, FAR_RANGES) / FAR_RANGES if is_known[k] else 0.0
        of_k.is_near = is_known[k] and k != i and ranges <= 1.0
        of_k.heard_age = log_age(now, memory.heard[b, i, k])
        of_k.attempt_age = log_age(now, last_attempt[k])
        of_k.addressed_age = log_age(now, memory.addressed_by[b, i, k])
        of_k.turn_rank = turn_rank[k]
        of_k.known_share = num_known / num_robots
        of_k.team_size = num_robots / TEAM
    # Of oneself at the end: a choice in the loop would double the time that it takes.
    of_itself: ExtendedNode = its[i]
    of_itself.heard_age = log_age(now, memory.sent[b, i])


@compiled(forceinline=True, makes_arrays=False)
def _write_news(memory: Memory, b: int, i: int, its: OwnNodes) -> None:
    """Write what a robot's packet would tell its neighbours; its own news is to all of them."""
    own = memory.timestamp[b, i]
    said = memory.said[b, i]
    for k in range(len(its)):
        of_k: ExtendedNode = its[k]
        # Who is out of range cannot be reached, so there is no news to it.
        of_k.news = 0.0
        of_k.unsaid_news = 0.0
        if of_k.is_near > 0.0:
            packet = memory.packet[b, k, memory.decoded[b, i, k]]
            of_k.news, of_k.unsaid_news = _rises(own, packet, said)
    # Sums first and logarithms then: what is said to all adds up in windows. And apart from the
    # loop above, in which the processor can then fetch several packets from memory at once.
    news = 0.0
    unsaid_news = 0.0
    for k in range(len(its)):
        of_near: ExtendedNode = its[k]
        if of_near.is_near > 0.0:
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
        by_packet += max(own[j] - neighbour[j], zero)
        by_both += max(own[j] - max(neighbour[j], said[j]), zero)
    return by_packet / own.shape[0], by_both / own.shape[0]


@compiled(makes_arrays=False)
def _write_beliefs(beliefs: Beliefs, window: int, range_m: float, its: OwnNodes) -> None:
    """Write neighbours and turns by distance, which follow from positions and the clock alone."""
    count_near(beliefs, range_m)
    for k in range(len(its)):
        of_k: ExtendedNode = its[k]
        # It finds itself, too; who is unknown finds nobody.
        of_k.neighbours = max(0.0, beliefs.num_near[k] - 1.0) / CROWD
    write_turns(beliefs, window, 1.5 * range_m, its["has_turn_1_5"])
    write_turns(beliefs, window, 2.0 * range_m, its["has_turn_2"])
    write_turns(beliefs, window, 3.0 * range_m, its["has_turn_3"])


@compiled(makes_arrays=False)
def _copy_beliefs(its: OwnNodes, last: OwnNodes) -> None:
    """Write a robot's neighbours and turns, which are those of the robot before it."""
    for k in range(its.shape[0]):
        of_k: ExtendedNode = its[k]
        same: ExtendedNode = last[k]
        of_k.neighbours = same.neighbours
        of_k.has_turn_1_5 = same.has_turn_1_5
        of_k.has_turn_2 = same.has_turn_2
        of_k.has_turn_3 = same.has_turn_3
        of_k.has_joined = same.has_joined
