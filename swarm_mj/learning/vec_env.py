"""Missions behind stable-baselines3's `VecEnv`: what both kinds of credit assignment share."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from swarm_mj.gnn.graphs import Graphs
from swarm_mj.learning.mission_batch import MissionBatch, Transition
from swarm_mj.protocol.buffers import NO_PARENT

Observation = dict[str, np.ndarray]
Step = tuple[Observation, np.ndarray, np.ndarray, list[dict[str, Any]]]


class MissionsEnv(VecEnv):
    """Batches of missions, each one swarm; no Python loop runs over environments.

    Environments run batch by batch, mission by mission and, if a robot is one, robot by robot.
    """

    def __init__(
        self,
        batches: Sequence[MissionBatch],
        sizes: Sequence[int],
        observation: spaces.Space,
        action: spaces.Space,
    ) -> None:
        """Takes the batches, already started, and how many environments each of them is."""
        self.batches = list(batches)
        self.num_nodes = largest_team(batches)
        self.transitions: list[Transition] = []  # of the last window, batch by batch
        self._actions = np.zeros(0)
        ends = np.cumsum(sizes)
        self._envs = [slice(end - size, end) for end, size in zip(ends, sizes, strict=True)]
        self.render_mode = None
        super().__init__(sum(sizes), observation, action)

    def observe(self, graphs: Sequence[Graphs]) -> Observation:
        """The graphs of all batches, one each, as the observation of all environments."""
        return self._observe(graphs, slice(0, self.num_envs))

    @abstractmethod
    def _observe(self, graphs: Sequence[Graphs], envs: slice) -> Observation:
        """The graphs of neighbouring batches, which are these environments."""

    @abstractmethod
    def _step_batch(
        self, batch: MissionBatch, actions: np.ndarray
    ) -> tuple[Transition, np.ndarray]:
        """One window of a batch, and the rewards of its environments."""

    @property
    def num_teams(self) -> int:
        """Missions, and so team decisions a window."""
        return sum(batch.num_missions for batch in self.batches)

    def reset(self) -> Observation:
        """What is seen at the start of the missions under way, which start over."""
        return self.observe([batch.restart() for batch in self.batches])

    def step_async(self, actions: np.ndarray) -> None:
        """Takes the actions; `step_wait` plays them."""
        self._actions = actions

    def step_wait(self) -> Step:
        """One window of all missions; of those that were cut, also what was seen at the end."""
        done = np.zeros(self.num_envs, dtype=np.bool_)
        reward = np.zeros(self.num_envs, dtype=np.float32)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self.transitions = []
        for batch, envs in zip(self.batches, self._envs, strict=True):
            transition, reward[envs] = self._step_batch(batch, self._actions[envs])
            self.transitions.append(transition)
            done[envs] = transition.last_graphs is not None
            if transition.last_graphs is not None and transition.is_cut:
                last = self._observe([transition.last_graphs], envs)
                infos[envs] = [
                    {
                        "terminal_observation": {name: rows[n] for name, rows in last.items()},
                        "TimeLimit.truncated": True,
                    }
                    for n in range(envs.stop - envs.start)
                ]
        return self.observe([each.graphs for each in self.transitions]), reward, done, infos

    def close(self) -> None:
        """There is nothing to release."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """The attribute of this object, once per environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: object, indices: VecEnvIndices = None) -> None:  # noqa: ARG002 - VecEnv's
        """Environments have no attributes of their own; raises AttributeError."""
        raise AttributeError(f"no environment has its own {attr_name}")

    def env_method(self, method_name: str, *_: object, **__: object) -> list[Any]:
        """Environments have no methods of their own; raises AttributeError."""
        raise AttributeError(f"no environment has its own {method_name}")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:  # noqa: ARG002 - VecEnv's
        """No environment is wrapped."""
        return [False for _ in self._get_indices(indices)]


def largest_team(batches: Sequence[MissionBatch]) -> int:
    """Robots of the largest team, to which the others are padded."""
    return max(batch.mission.num_robots for batch in batches)


def graph_spaces(
    num_nodes: int, num_features: int, rows: tuple[int, ...]
) -> dict[str, spaces.Space]:
    """The spaces of one environment's graphs.

    Args:
        num_nodes: M, of the largest team.
        num_features: F.
        rows: (), or one dimension for environments of several robots.

    Returns:
        Spaces by name, as `padded` orders them.
    """
    return {
        "node": spaces.Box(-np.inf, np.inf, (*rows, num_nodes, num_features), np.float32),
        "parent": spaces.Box(-1, num_nodes - 1, (*rows, num_nodes), np.int32),
        "may_address": spaces.MultiBinary([*rows, num_nodes]),
        "has_turn": spaces.MultiBinary([*rows, 1]),
    }


def padded(graphs: Sequence[Graphs], num_nodes: int) -> Observation:
    """All batches' graphs in one, with unconnected nodes that nobody may address.

    Args:
        graphs: One a batch, of at most M nodes.
        num_nodes: M.

    Returns:
        The arrays of `Graphs` by name, R rows of M nodes; `has_turn` is [R, 1].
    """

    def rows_of(name: str, fill: int, dtype: type) -> np.ndarray:
        parts = [getattr(each, name) for each in graphs]
        shape = (sum(map(len, parts)), num_nodes, *parts[0].shape[2:])
        rows, start = np.full(shape, fill, dtype=dtype), 0
        for part in parts:
            rows[start : start + len(part), : part.shape[1]] = part
            start += len(part)
        return rows

    return {
        "node": rows_of("node", 0, np.float32),
        "parent": rows_of("parent", NO_PARENT, np.int32),
        "may_address": rows_of("may_address", False, np.bool_),
        "has_turn": np.concatenate([each.has_turn for each in graphs])[:, None],
    }
