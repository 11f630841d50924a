"""The extended features: all that one robot can tell of each teammate.

From its own buffer, the packets it sent and decoded, its identity, the team's size and the clock.
"""

import math
from dataclasses import replace
from itertools import compress
from typing import Annotated, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, Shaped

from swarm_mj.mission.geometry import squared_distance
from swarm_mj.policies.gnn.features import Feature, dtype_of, features_of, names_of
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import Memory, empty_memory, log_age, logarithm, remember
from swarm_mj.policies.gnn.scales import ADDRESS_RANGES, CROWD, FAR_RANGES, TEAM
from swarm_mj.policies.gnn.turns import Column, count_near, write_turns
from swarm_mj.protocol.window import LocalViews
from swarm_mj.radio.spatial_reuse import believes_as_the_last, write_joined
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
        is_known = buffers.is_known | np.eye(num_robots, dtype=np.bool_)
        window = views.now.astype(np.int64)
        _write_ages(
            memory=self._memory,
            last_attempt=buffers.last_attempt,
            is_observed=buffers.is_known,
            believed_m=buffers.position_m,
            now=views.now,
            range_m=range_m,
            node=node,
            may_address=may_address,
        )
        _write_news(self._memory, node)  # by who is near, which is written by now
        _write_beliefs(
            believed_m=buffers.position_m,
            is_known=is_known,
            window=window,
            range_m=range_m,
            node=node,
        )
        has_joined = node["has_joined"]  # a view
        self._write_joined(buffers.position_m, is_known, window, has_joined)
        rows = (len(window) * num_robots, num_robots)
        return Graphs(
            node=node.view(np.float32).reshape(*rows, len(ExtendedFeatures.names)),
            parent=buffers.parent.reshape(rows),
            may_address=may_address.reshape(rows),
            has_turn=np.diagonal(has_joined, axis1=1, axis2=2).reshape(-1) > 0.0,
        )

    def _write_joined(
        self,
        believed_m: Places,
        is_known: Flags,
        window: Int[np.ndarray, "B"],
        has_joined: Float32[np.ndarray, "B N N"],
    ) -> None:
        """Write who has a turn by interference, as each robot believes."""
        write_joined(
            believed_m=believed_m,
            is_known=is_known,
            turn=window,
            range_m=self._mission.range_m,
            threshold=from_db(self._mission.sinr_threshold_db),
            has_joined=has_joined,
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
def _write_ages(
    memory: Memory,
    last_attempt: Float[np.ndarray, "B N N"],
    is_observed: Flags,
    believed_m: Places,
    now: Float[np.ndarray, "B"],
    range_m: float,
    node: Nodes,
    may_address: Flags,
) -> None:
    """Write all but news, and what follows from positions and the clock alone."""
    num_missions, num_robots = node.shape[:2]
    for b in range(num_missions):
        rank = (np.arange(num_robots) - int(now[b])) % num_robots / num_robots
        for i in range(num_robots):
            num_known = np.sum(is_observed[b, i]) + (not is_observed[b, i, i])
            known_share = num_known / num_robots
            for k in range(num_robots):
                of_k: ExtendedNode = node[b, i, k]
                is_known = k == i or is_observed[b, i, k]
                ranges = math.sqrt(squared_distance(believed_m[b, i], k, i)) / range_m
                # One of unknown position may be near, so it may be addressed.
                may_address[b, i, k] = not is_known or ranges <= ADDRESS_RANGES
                of_k.is_oneself = k == i
                of_k.is_known = is_known
                of_k.timestamp_age = log_age(
                    now[b], memory.timestamp[b, i, k], is_observed[b, i, k]
                )
                of_k.distance = min(ranges, FAR_RANGES) / FAR_RANGES if is_known else 0.0
                of_k.is_near = is_known and k != i and ranges <= 1.0
                of_k.heard_age = log_age(now[b], memory.heard[b, i, k])
                of_k.attempt_age = log_age(now[b], last_attempt[b, i, k])
                of_k.addressed_age = log_age(now[b], memory.addressed_by[b, i, k])
                of_k.turn_rank = rank[k]
                of_k.known_share = known_share
                of_k.team_size = num_robots / TEAM
            # Of oneself at the end: a choice in the loop would double the time that it takes.
            of_itself: ExtendedNode = node[b, i, i]
            of_itself.heard_age = log_age(now[b], memory.sent[b, i])


@compiled()
def _write_news(memory: Memory, node: Nodes) -> None:
    """Write what a robot's packet would tell its neighbours; its own news is to all of them."""
    num_missions, num_robots = node.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            own = memory.timestamp[b, i]
            said = memory.said[b, i]
            news = 0.0
            unsaid_news = 0.0
            for k in range(num_robots):
                of_k: ExtendedNode = node[b, i, k]
                # Who is out of range cannot be reached, so there is no news to it.
                of_k.news = 0.0
                of_k.unsaid_news = 0.0
                if of_k.is_near > 0.0:
                    of_k.news, of_k.unsaid_news = _rises(own, memory.neighbour[b, i, k], said)
                    # Sums first and logarithms then: what is said to all adds up in windows.
                    news += of_k.news
                    unsaid_news += of_k.unsaid_news
                    of_k.news = logarithm(of_k.news)
                    of_k.unsaid_news = logarithm(of_k.unsaid_news)
            of_itself: ExtendedNode = node[b, i, i]
            of_itself.news = logarithm(news)
            of_itself.unsaid_news = logarithm(unsaid_news)


@compiled(fastmath=True)
def _rises(own: Timestamps, neighbour: Timestamps, said: Timestamps) -> tuple[float, float]:
    """Mean rise of a neighbour's T if it heard all: by its packet, or also by one's own."""
    zero = np.float32(0.0)
    by_packet = zero
    by_both = zero
    for j in range(own.shape[0]):
        by_packet += max(own[j] - neighbour[j], zero)
        by_both += max(own[j] - max(neighbour[j], said[j]), zero)
    return by_packet / own.shape[0], by_both / own.shape[0]


@compiled()
def _write_beliefs(
    believed_m: Places,
    is_known: Flags,
    window: Int[np.ndarray, "B"],
    range_m: float,
    node: Nodes,
) -> None:
    """Write neighbours and turns by distance, which follow from positions and the clock alone."""
    num_missions, num_robots = is_known.shape[:2]
    # Columns of their own, with which the inner loops are compiled to vectors.
    x_m = np.empty(num_robots)
    y_m = np.empty(num_robots)
    known_x_m = np.empty(num_robots)
    known_y_m = np.empty(num_robots)
    is_close = np.empty(num_robots)
    for b in range(num_missions):
        for i in range(num_robots):
            its = node[b, i]
            # Of a team at rest most robots believe the same: no need to count all of it again.
            if believes_as_the_last(believed_m[b], is_known[b], i):
                _copy_beliefs(its, node[b, i - 1])
                continue
            num_known = 0
            for k in range(num_robots):
                x_m[k] = believed_m[b, i, k, 0]
                y_m[k] = believed_m[b, i, k, 1]
                known_x_m[num_known] = x_m[k]
                known_y_m[num_known] = y_m[k]
                num_known += is_known[b, i, k]  # else the next one takes its place
            for k in range(num_robots):
                of_each: ExtendedNode = its[k]
                of_each.neighbours = 0.0
                if is_known[b, i, k]:
                    num_near = count_near(
                        known_x_m[:num_known], known_y_m[:num_known], x_m[k], y_m[k], range_m
                    )
                    of_each.neighbours = (num_near - 1) / CROWD  # for it finds itself
            _write_turns_by_radius(
                x_m=x_m,
                y_m=y_m,
                is_known=is_known[b, i],
                window=window[b],
                range_m=range_m,
                its=its,
                is_close=is_close,
            )


@compiled()
def _copy_beliefs(its: OwnNodes, last: OwnNodes) -> None:
    """Write a robot's neighbours and turns, which are those of the robot before it."""
    for k in range(its.shape[0]):
        of_k: ExtendedNode = its[k]
        same: ExtendedNode = last[k]
        of_k.neighbours = same.neighbours
        of_k.has_turn_1_5 = same.has_turn_1_5
        of_k.has_turn_2 = same.has_turn_2
        of_k.has_turn_3 = same.has_turn_3


@compiled()
def _write_turns_by_radius(
    x_m: Column,
    y_m: Column,
    is_known: Bool[np.ndarray, "N"],
    window: int,
    range_m: float,
    its: OwnNodes,
    is_close: Column,
) -> None:
    """Write one robot's turns at the three radii, as `write_turns` does."""
    write_turns(
        x_m=x_m,
        y_m=y_m,
        is_known=is_known,
        window=window,
        radius_m=1.5 * range_m,
        has_turn=its["has_turn_1_5"],
        is_close=is_close,
    )
    write_turns(
        x_m=x_m,
        y_m=y_m,
        is_known=is_known,
        window=window,
        radius_m=2.0 * range_m,
        has_turn=its["has_turn_2"],
        is_close=is_close,
    )
    write_turns(
        x_m=x_m,
        y_m=y_m,
        is_known=is_known,
        window=window,
        radius_m=3.0 * range_m,
        has_turn=its["has_turn_3"],
        is_close=is_close,
    )
