"""The buffer features: the paper's information, T, M, P and L of a robot's own buffer, encoded.

Ages are on a logarithmic scale, positions are relative to the robot and in ranges. A robot is
staler than oneself if its T, the time of its last packet that anyone passed on, is from before
one's own last packet. Who has been silent for longest is thus known to all that hear of each other,
without a memory of packets, an order of identities or a clock.
"""

import math
import tomllib
from pathlib import Path
from typing import ClassVar

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped

from swarm_mj.policies.gnn.extended_features import ADDRESS_RANGES, CROWD, FAR_RANGES, TEAM
from swarm_mj.policies.gnn.graphs import FeatureExtractor, Graphs
from swarm_mj.policies.gnn.packet_memory import log_age
from swarm_mj.protocol.window import LocalViews
from swarm_mj.system.compiled import compiled

FEATURES: dict[str, str] = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
NODE = np.dtype([(field, np.float32) for field in FEATURES])


class BufferFeatures(FeatureExtractor):
    """The paper's information, as a network can use it; see `FEATURES`."""

    names: ClassVar[tuple[str, ...]] = tuple(FEATURES.values())

    def graphs(self, views: LocalViews) -> Graphs:
        """Return the buffers, encoded; teammates believed far out of range are not addressed."""
        buffers, mission = views.buffers, self._mission
        node = np.empty(buffers.timestamp.shape, dtype=NODE)
        num_missions, num_robots = buffers.shape
        rows = num_missions * num_robots, num_robots
        is_known = buffers.is_known | np.eye(num_robots, dtype=np.bool_)
        spoke = buffers.last_attempt.max(axis=2)
        _write_times(buffers.timestamp, buffers.last_attempt, is_known, spoke, views.now, node)
        states = buffers.position_m, buffers.velocity_mps, buffers.parent
        _write_states(*states, is_known, mission.range_m, mission.max_velocity_mps, node)
        _write_counts(node)
        is_close = node["distance"] <= ADDRESS_RANGES / FAR_RANGES
        return Graphs(
            node=node.view(np.float32).reshape(*rows, len(FEATURES)),
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
                of_k, known = node[b, i, k], is_known[b, i, k]
                of_k.is_oneself, of_k.is_known = k == i, known
                of_k.timestamp_age = log_age(now[b], timestamp[b, i, k], known)
                of_k.attempt_age = log_age(now[b], last_attempt[b, i, k])
                of_k.is_staler = known and k != i and timestamp[b, i, k] < spoke[b, i]
                since[k] = timestamp[b, i, k] if known else np.inf
            since[i] = spoke[b, i]
            node[b, i, i].attempt_age = log_age(now[b], spoke[b, i])
            order, rank = np.argsort(since), 0
            for place, k in enumerate(order):  # who is equally stale has the same rank
                rank = place if since[k] > since[order[place - 1]] else rank
                node[b, i, k].rank = share_of_team(rank)


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
                of_k, known = node[b, i, k], is_known[b, i, k]
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
            for of_k in node[b, i]:
                ranges = FAR_RANGES * of_k.distance if of_k.is_staler > 0.0 else np.inf
                known += of_k.is_known > 0.0
                near += of_k.is_near > 0.0
                within_025 += ranges <= 0.25
                within_05 += ranges <= 0.5
                within_1 += ranges <= 1.0
                within_2 += ranges <= 2.0
                staler += ranges < np.inf
            all_025, all_05 = share_of_team(within_025), share_of_team(within_05)
            all_1, all_2 = share_of_team(within_1), share_of_team(within_2)
            everyone = share_of_team(staler)
            for of_k in node[b, i]:
                of_k.known_share, of_k.neighbours = known / num_robots, near / CROWD
                of_k.staler_025, of_k.staler_05 = all_025, all_05
                of_k.staler_1, of_k.staler_2 = all_1, all_2
                of_k.team_size, of_k.staler = num_robots / TEAM, everyone


@compiled()
def share_of_team(count: int) -> float:
    """Return a count of robots on a logarithmic scale, 1 at `TEAM`."""
    return math.log1p(count) / math.log1p(TEAM)
