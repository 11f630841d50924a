"""Arm `robot`: every robot of every mission is one row, paid its own credit."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from swarm_mj.graphs.graph import Graphs
from swarm_mj.learning.env import MissionsEnv, Observation, Step, graph_spaces, largest_team
from swarm_mj.learning.missions import Group, padded


class RobotEnv(MissionsEnv):
    """R rows, one a robot; the action is whom it addresses, the reward its credit per pair.

    Credit is what the team would not have gained in this window had the robot been silent
    (`credit.credits_of`), over the number of pairs, so that all team sizes count alike.
    """

    def __init__(self, groups: Sequence[Group]) -> None:
        """Takes the groups, already started."""
        num_nodes = largest_team(groups)
        observation: dict[str, spaces.Space] = {
            **graph_spaces(num_nodes, groups[0].num_features, ()),
            "owner": spaces.Box(0, num_nodes - 1, (1,), np.int32),
        }
        num_rows = [group.num_missions * group.mission.num_robots for group in groups]
        super().__init__(
            groups, sum(num_rows), spaces.Dict(observation), spaces.Discrete(num_nodes)
        )
        self._ends = np.cumsum(num_rows)[:-1]
        self._owner = np.concatenate(
            [
                np.tile(np.arange(g.mission.num_robots, dtype=np.int32), g.num_missions)
                for g in groups
            ]
        )[:, None]

    def observe(self, graphs: Sequence[Graphs]) -> Observation:
        """The rows' graphs, stacked and padded."""
        return {**padded(graphs, self.num_nodes), "owner": self._owner}

    def step_wait(self) -> Step:
        """One window of all missions."""
        self.outcomes = [
            group.step(actions.reshape(group.num_missions, -1), with_credit=True)
            for group, actions in zip(self.groups, np.split(self._actions, self._ends), strict=True)
        ]
        reward, done = [], []
        for group, outcome in zip(self.groups, self.outcomes, strict=True):
            reward.append(outcome.credit.ravel() / group.mission.num_robots**2)
            done.append(np.full(outcome.credit.size, outcome.last_graphs is not None))
        return (
            self.observe([each.graphs for each in self.outcomes]),
            np.concatenate(reward).astype(np.float32),
            np.concatenate(done),
            self._infos(),
        )

    def _infos(self) -> list[dict[str, Any]]:
        """Empty, but for missions that were cut: what their robots saw last has a value."""
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        starts = [0, *self._ends]
        for start, outcome in zip(starts, self.outcomes, strict=True):
            if outcome.last_graphs is not None and outcome.is_cut:
                last = padded([outcome.last_graphs], self.num_nodes)
                last["owner"] = self._owner[start : start + len(last["node"])]
                for row in range(len(last["node"])):
                    infos[start + row] = {
                        "terminal_observation": {name: last[name][row] for name in last},
                        "TimeLimit.truncated": True,
                    }
        return infos
