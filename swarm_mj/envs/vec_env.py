"""Missions behind stable-baselines3's `VecEnv`, by both kinds of credit assignment."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from swarm_mj.envs.mission_batch import MissionBatch, Reward, Transition
from swarm_mj.policies.gnn.graphs import Graphs
from swarm_mj.protocol.buffers import NO_PARENT

Observation = dict[str, np.ndarray]
Step = tuple[Observation, np.ndarray, np.ndarray, list[dict[str, Any]]]


class MissionsEnv(VecEnv):
    """Batches of missions, already started, each one swarm; no Python loop runs over environments.

    Environments run batch by batch, mission by mission and, if a robot is one, robot by robot:
    `sizes` says how many each batch has.
    """

    def __init__(
        self,
        batches: Sequence[MissionBatch],
        sizes: Sequence[int],
        observation: spaces.Space,
        action: spaces.Space,
    ) -> None:
        self.batches = list(batches)
        self.num_nodes = _largest_team(batches)
        self.transitions: list[Transition] = []  # of the last window, batch by batch
        self._actions = np.zeros(0)
        ends = np.cumsum(sizes)
        self._envs = [slice(end - size, end) for end, size in zip(ends, sizes, strict=True)]
        self.render_mode = None
        super().__init__(sum(sizes), observation, action)

    def observe(self, graphs: Sequence[Graphs]) -> Observation:
        """Return the graphs of all batches, one each, as the observation of all environments."""
        return self._observe(graphs, slice(0, self.num_envs))

    @abstractmethod
    def _observe(self, graphs: Sequence[Graphs], envs: slice) -> Observation:
        """Return the graphs of neighbouring batches, which are these environments."""

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
        """Take the actions; `step_wait` plays them."""
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
        """Return the attribute of this object, once per environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, *_: object, **__: object) -> None:
        """Environments have no attributes of their own; raises AttributeError."""
        raise AttributeError(f"no environment has its own {attr_name}")

    def env_method(self, method_name: str, *_: object, **__: object) -> list[Any]:
        """Environments have no methods of their own; raises AttributeError."""
        raise AttributeError(f"no environment has its own {method_name}")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """No environment is wrapped."""
        del wrapper_class
        return [False for _ in self._get_indices(indices)]


class RobotEnv(MissionsEnv):
    """R environments, one a robot; the action is whom it addresses, the reward its credit per pair.

    Credit is what the team would not have gained in this window had the robot been silent
    (`credit.credits_of`), over the number of pairs, so that all team sizes count alike.
    """

    def __init__(self, batches: Sequence[MissionBatch]) -> None:
        num_nodes = _largest_team(batches)
        observation = _graph_spaces((num_nodes,), batches[0].num_features)
        observation["owner"] = spaces.Box(0, num_nodes - 1, (1,), np.int32)
        owners = [
            np.tile(np.arange(batch.mission.num_robots, dtype=np.int32), batch.num_missions)
            for batch in batches
        ]
        self._owner = np.concatenate(owners)[:, None]
        super().__init__(
            batches, [*map(len, owners)], spaces.Dict(observation), spaces.Discrete(num_nodes)
        )

    def _observe(self, graphs: Sequence[Graphs], envs: slice) -> Observation:
        """Return the robots' graphs, stacked and padded."""
        return {**padded(graphs, self.num_nodes), "owner": self._owner[envs]}

    def _step_batch(
        self, batch: MissionBatch, actions: np.ndarray
    ) -> tuple[Transition, np.ndarray]:
        transition = batch.step(actions.reshape(batch.num_missions, -1), with_credit=True)
        return transition, transition.credit.ravel() / batch.mission.num_robots**2


class TeamEnv(MissionsEnv):
    """B environments; the joint action is everyone's recipient, the reward the negative cost.

    With `aoi` the reward is the mean age of information (Eq. 10) over the mission's duration,
    negative: that of `envs.team.Team` over the number of windows. With `velocity-variance` it is
    the negative variance (Eq. 17), as in Fig. 6. Smaller teams are padded with robots that do not
    exist: they are silent and see nothing.
    """

    def __init__(self, batches: Sequence[MissionBatch], reward: Reward = "aoi") -> None:
        num_nodes = _largest_team(batches)
        observation = _graph_spaces((num_nodes, num_nodes), batches[0].num_features)
        observation["is_robot"] = spaces.MultiBinary(num_nodes)
        num_missions = [batch.num_missions for batch in batches]
        action = spaces.MultiDiscrete([num_nodes] * num_nodes)
        super().__init__(batches, num_missions, spaces.Dict(observation), action)
        self._reward: Reward = reward
        sizes = np.repeat([batch.mission.num_robots for batch in batches], num_missions)
        self._is_robot = np.arange(num_nodes) < sizes[:, None]

    def _observe(self, graphs: Sequence[Graphs], envs: slice) -> Observation:
        """The teams' graphs, stacked and padded; robots that do not exist may only be silent."""
        is_robot = self._is_robot[envs]
        observation = {"is_robot": is_robot}
        for name, rows in padded(graphs, self.num_nodes).items():
            teams = np.zeros((*is_robot.shape, *rows.shape[1:]), dtype=rows.dtype)
            teams[is_robot] = rows
            observation[name] = teams
        observation["parent"][~is_robot] = NO_PARENT
        observation["may_address"] |= np.eye(self.num_nodes, dtype=np.bool_)
        return observation

    def _step_batch(
        self, batch: MissionBatch, actions: np.ndarray
    ) -> tuple[Transition, np.ndarray]:
        transition = batch.step(actions[:, : batch.mission.num_robots], with_credit=False)
        if self._reward == "velocity-variance":
            return transition, -transition.costs.velocity_variance_m2ps2
        return transition, -transition.costs.age_windows / batch.mission.num_windows


def missions_of(model: PPO) -> MissionsEnv:
    """Return a model's environment, inside what may be wrapped around it."""
    env = model.get_env()
    inner = env.unwrapped if env is not None else None
    assert isinstance(inner, MissionsEnv)
    return inner


def padded(graphs: Sequence[Graphs], num_nodes: int) -> Observation:
    """All batches' graphs in one, by name, with unconnected nodes that nobody may address.

    Their R rows have M = `num_nodes` nodes, at least as many as the batches'; `has_turn` is [R, 1].
    """

    def rows_of(name: str, fill: int, dtype: type) -> np.ndarray:
        parts = [getattr(each, name) for each in graphs]
        if all(part.shape[1] == num_nodes for part in parts):
            return np.concatenate(parts, dtype=dtype)
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


def _largest_team(batches: Sequence[MissionBatch]) -> int:
    """Robots of the largest team, to which the others are padded."""
    return max(batch.mission.num_robots for batch in batches)


def _graph_spaces(nodes: tuple[int, ...], num_features: int) -> dict[str, spaces.Space]:
    """Return the spaces of one environment's graphs, of so many nodes, as `padded` orders them."""
    return {
        "node": spaces.Box(-np.inf, np.inf, (*nodes, num_features), np.float32),
        "parent": spaces.Box(-1, nodes[-1] - 1, nodes, np.int32),
        "may_address": spaces.MultiBinary(nodes),
        "has_turn": spaces.MultiBinary([*nodes[:-1], 1]),
    }
