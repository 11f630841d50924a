"""The buffer features: the paper's information, T, M, P and L of a robot's own buffer, encoded.

Ages are on a logarithmic scale, positions are relative to the robot and in ranges. A robot is
staler than oneself if its T, the time of its last packet that anyone passed on, is from before
one's own last packet. Who has been silent for longest is thus known to all that hear of each other,
without a memory of packets, an order of identities or a clock.
"""

import math
from typing import Annotated, ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.policies.gnn.features import Feature, dtype_of, names_of
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import log_age
from swarm_mj.policies.gnn.scales import ADDRESS_RANGES, CROWD, FAR_RANGES, TEAM
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


class BufferFeatures(FeatureExtractor):
    """The paper's information, as a network can use it: the fields of `BufferNode`."""

    names: ClassVar[tuple[str, ...]] = names_of(BufferNode)

    def graphs(self, views: LocalViews) -> Graphs:
        """Return the buffers, encoded; teammates believed far out of range are not addressed."""
        buffers = views.buffers
        node = np.empty(buffers.timestamp.shape, dtype=NODE)
        num_missions, num_robots = buffers.shape
        rows = (num_missions * num_robots, num_robots)
        is_known = buffers.is_known | np.eye(num_robots, dtype=np.bool_)
        spoke = buffers.last_attempt.max(axis=2)
        _write_times(
            timestamp=buffers.timestamp,
            last_attempt=buffers.last_attempt,
            is_known=is_known,
            spoke=spoke,
            now=views.now,
            node=node,
        )
        _write_states(
            position_m=buffers.position_m,
            velocity_mps=buffers.velocity_mps,
            parent=buffers.parent,
            is_known=is_known,
            range_m=self._mission.range_m,
            max_mps=self._mission.max_velocity_mps,
            node=node,
        )
        _write_counts(node)
        is_close = node["distance"] <= ADDRESS_RANGES / FAR_RANGES
        return Graphs(
            node=node.view(np.float32).reshape(*rows, len(self.names)),
            parent=buffers.parent.reshape(rows),
            may_address=(~is_known | is_close).reshape(rows),
            has_turn=np.zeros(rows[0], dtype=np.bool_),
        )


@compiled()
def _write_times(
    timestamp: Float[np.ndarray, "B N N"],
    last_attempt: Float[np.ndarray, "B N N"],
    is_known: Bool[np.ndarray, "B N N"],
    spoke: Float[np.ndarray, "B N"],
    now: Float[np.ndarray, "B"],
    node: Shaped[np.ndarray, "B N N"],
) -> None:
    """Write ages, and who was silent for longer than the robot itself."""
    num_missions, num_robots = spoke.shape
    since = np.empty(num_robots)
    for b in range(num_missions):
        for i in range(num_robots):
            for k in range(num_robots):
                of_k: BufferNode = node[b, i, k]
                known = is_known[b, i, k]
                of_k.is_oneself = k == i
                of_k.is_known = known
                of_k.timestamp_age = log_age(now[b], timestamp[b, i, k], known)
                of_k.attempt_age = log_age(now[b], last_attempt[b, i, k])
                of_k.is_staler = known and k != i and timestamp[b, i, k] < spoke[b, i]
                since[k] = timestamp[b, i, k] if known else np.inf
            since[i] = spoke[b, i]
            of_itself: BufferNode = node[b, i, i]
            of_itself.attempt_age = log_age(now[b], spoke[b, i])
            order = np.argsort(since)
            rank = 0
            for place, k in enumerate(order):  # who is equally stale has the same rank
                if place > 0 and since[k] > since[order[place - 1]]:
                    rank = place
                of_next: BufferNode = node[b, i, k]
                of_next.rank = share_of_team(rank)


@compiled()
def _write_states(
    position_m: Float[np.ndarray, "B N N 2"],
    velocity_mps: Float[np.ndarray, "B N N 2"],
    parent: Int[np.ndarray, "B N N"],
    is_known: Bool[np.ndarray, "B N N"],
    range_m: float,
    max_mps: float,
    node: Shaped[np.ndarray, "B N N"],
) -> None:
    """Write states relative to the robot's own; of teammates never heard of, zeros."""
    num_missions, num_robots = node.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            for k in range(num_robots):
                of_k: BufferNode = node[b, i, k]
                known = is_known[b, i, k]
                share = 1.0 / range_m if known else 0.0
                x = (position_m[b, i, k, 0] - position_m[b, i, i, 0]) * share
                y = (position_m[b, i, k, 1] - position_m[b, i, i, 1]) * share
                of_k.x = max(-FAR_RANGES, min(FAR_RANGES, x))
                of_k.y = max(-FAR_RANGES, min(FAR_RANGES, y))
                of_k.distance = min(FAR_RANGES, math.hypot(x, y)) / FAR_RANGES
                of_k.is_near = known and k != i and math.hypot(x, y) <= 1.0
                of_k.is_direct = known and k != i and parent[b, i, k] == i
                share = 1.0 / max_mps if known else 0.0
                of_k.velocity_x = (velocity_mps[b, i, k, 0] - velocity_mps[b, i, i, 0]) * share
                of_k.velocity_y = (velocity_mps[b, i, k, 1] - velocity_mps[b, i, i, 1]) * share


@compiled()
def _write_counts(node: Shaped[np.ndarray, "B N N"]) -> None:
    """Write what is the same in all nodes of a graph: how many are known, near and staler."""
    num_missions, num_robots = node.shape[:2]
    for b in range(num_missions):
        for i in range(num_robots):
            known = near = within_025 = within_05 = within_1 = within_2 = staler = 0
            for k in range(num_robots):
                of_k: BufferNode = node[b, i, k]
                ranges = FAR_RANGES * of_k.distance if of_k.is_staler > 0.0 else np.inf
                known += of_k.is_known > 0.0
                near += of_k.is_near > 0.0
                within_025 += ranges <= 0.25
                within_05 += ranges <= 0.5
                within_1 += ranges <= 1.0
                within_2 += ranges <= 2.0
                staler += ranges < np.inf
            share_025 = share_of_team(within_025)
            share_05 = share_of_team(within_05)
            share_1 = share_of_team(within_1)
            share_2 = share_of_team(within_2)
            share = share_of_team(staler)
            for k in range(num_robots):
                of_each: BufferNode = node[b, i, k]
                of_each.known_share = known / num_robots
                of_each.neighbours = near / CROWD
                of_each.team_size = num_robots / TEAM
                of_each.staler_025 = share_025
                of_each.staler_05 = share_05
                of_each.staler_1 = share_1
                of_each.staler_2 = share_2
                of_each.staler = share


@compiled()
def share_of_team(count: int) -> float:
    """Return a count of robots on a logarithmic scale, 1 at `TEAM`."""
    return math.log1p(count) / math.log1p(TEAM)
