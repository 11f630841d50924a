"""Missions behind stable-baselines3's `VecEnv`, without a loop over environments."""

from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv

from swarm_mj.graphs.graph import Graphs
from swarm_mj.learning.missions import Group, Outcome

Observation = dict[str, np.ndarray]
Step = tuple[Observation, np.ndarray, np.ndarray, list[dict[str, Any]]]


class MissionsEnv(VecEnv):
    """What both arms have in common: groups of missions, each one swarm."""

    def __init__(
        self,
        groups: Sequence[Group],
        num_envs: int,
        observation: spaces.Space,
        action: spaces.Space,
    ) -> None:
        self.groups = list(groups)
        self.num_nodes = largest_team(groups)
        self.outcomes: list[Outcome] = []  # of the last window, group by group
        self._actions = np.zeros(0)
        self.render_mode = None
        super().__init__(num_envs, observation, action)

    @abstractmethod
    def observe(self, graphs: Sequence[Graphs]) -> Observation:
        """All groups' graphs as one observation.

        Args:
            graphs: One a group.

        Returns:
            The observation of all environments.
        """

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
