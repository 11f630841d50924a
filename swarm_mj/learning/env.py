"""Missions behind stable-baselines3's `VecEnv`, without a loop over environments."""

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from swarm_mj.gnn.graphs import Graphs
from swarm_mj.learning.missions import Group, Outcome

Observation = dict[str, np.ndarray]
Step = tuple[Observation, np.ndarray, np.ndarray, list[dict[str, Any]]]


class MissionsEnv(VecEnv):
    """What both arms have in common: groups of missions, each one swarm."""

    def __init__(
        self,
        groups: Sequence[Group],
        sizes: Sequence[int],
        observation: spaces.Space,
        action: spaces.Space,
    ) -> None:
        """Takes the groups, already started, and how many environments each of them is."""
        self.groups = list(groups)
        self.num_nodes = largest_team(groups)
        self.outcomes: list[Outcome] = []  # of the last window, group by group
        self._actions = np.zeros(0)
        self._ends = np.cumsum(sizes)
        self._sizes = list(sizes)
        self.render_mode = None
        super().__init__(sum(sizes), observation, action)

    def observe(self, graphs: Sequence[Graphs]) -> Observation:
        """All groups' graphs as one observation.

        Args:
            graphs: One a group.

        Returns:
            The observation of all environments.
        """
        return self._observe(graphs, slice(0, self.num_envs))

    @abstractmethod
    def _observe(self, graphs: Sequence[Graphs], envs: slice) -> Observation:
        """The graphs of neighbouring groups, which are these environments."""

    @abstractmethod
    def _step_group(self, group: Group, actions: np.ndarray) -> Outcome:
        """One window of a group."""

    @abstractmethod
    def _reward_of(self, group: Group, outcome: Outcome) -> np.ndarray:
        """What a group's environments are paid for a window."""

    @property
    def num_teams(self) -> int:
        """Missions, and so team decisions a window."""
        return sum(group.num_missions for group in self.groups)

    def reset(self) -> Observation:
        """What is seen at the start of the missions under way; those that have begun start over."""
        return self.observe([_at_the_start(group) for group in self.groups])

    def step_async(self, actions: np.ndarray) -> None:
        """Takes the actions; `step_wait` flies them."""
        self._actions = actions

    def step_wait(self) -> Step:
        """One window of all missions."""
        actions = np.split(self._actions, self._ends[:-1])
        steps = zip(self.groups, actions, strict=True)
        self.outcomes = [self._step_group(group, chosen) for group, chosen in steps]
        paid = zip(self.groups, self.outcomes, strict=True)
        reward = np.concatenate([self._reward_of(group, outcome) for group, outcome in paid])
        has_ended = [outcome.last_graphs is not None for outcome in self.outcomes]
        return (
            self.observe([outcome.graphs for outcome in self.outcomes]),
            reward.astype(np.float32),
            np.repeat(has_ended, self._sizes),
            self._infos(),
        )

    def _infos(self) -> list[dict[str, Any]]:
        """Empty, but for missions that were cut: what was seen last there has a value."""
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for outcome, size, end in zip(self.outcomes, self._sizes, self._ends, strict=True):
            if outcome.last_graphs is not None and outcome.is_cut:
                last = self._observe([outcome.last_graphs], slice(end - size, end))
                for env in range(size):
                    infos[end - size + env] = {
                        "terminal_observation": {name: last[name][env] for name in last},
                        "TimeLimit.truncated": True,
                    }
        return infos

    def close(self) -> None:
        """There is nothing to release."""

    def get_attr(self, attr_name: str, indices: int | Iterable[int] | None = None) -> list[Any]:
        """The attribute of this object, once per environment."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(
        self, attr_name: str, value: object, indices: int | Iterable[int] | None = None
    ) -> None:
        """Environments have no attributes of their own.

        Raises:
            AttributeError: Always.
        """
        raise AttributeError(f"no environment has its own {attr_name}: {value}, {indices}")

    def env_method(
        self,
        method_name: str,
        *method_args: object,
        indices: int | Iterable[int] | None = None,
        **method_kwargs: object,
    ) -> list[Any]:
        """Environments have no methods of their own.

        Raises:
            AttributeError: Always.
        """
        given = f"{method_args}, {method_kwargs}, {indices}"
        raise AttributeError(f"no environment has its own {method_name}: {given}")

    def env_is_wrapped(
        self,
        wrapper_class: type,  # noqa: ARG002 - VecEnv's
        indices: int | Iterable[int] | None = None,
    ) -> list[bool]:
        """No environment is wrapped."""
        return [False for _ in self._get_indices(indices)]


def _at_the_start(group: Group) -> Graphs:
    course = group.course()
    if len(course.recipients) == 0:
        return group.first_graphs
    return group.fly_again(replace(course, recipients=course.recipients[:0]))


def largest_team(groups: Sequence[Group]) -> int:
    """Robots of the largest team, to which the others are padded."""
    return max(group.mission.num_robots for group in groups)


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
