"""Arm `team`, the paper's: one mission is one environment, its robots act jointly, one reward."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from gymnasium import spaces

from swarm_mj.buffers import NO_PARENT
from swarm_mj.graphs.graph import Graphs
from swarm_mj.learning.env import MissionsEnv, Observation, Step, graph_spaces, largest_team
from swarm_mj.learning.missions import Group, Outcome, padded

Reward = Literal["aoi", "velocity-variance"]


class TeamEnv(MissionsEnv):
    """B environments; the action is everyone's recipient, the reward the negative cost.

    With `aoi` the reward is the mean age of information (Eq. 10) over the mission's duration,
    negative; with `velocity-variance` it is the negative variance (Eq. 17), as in Fig. 6. Smaller
    teams are padded with robots that do not exist: they are silent and see nothing.
    """

    def __init__(self, groups: Sequence[Group], reward: Reward = "aoi") -> None:
        """Takes the groups, already started."""
        num_nodes = largest_team(groups)
        observation: dict[str, spaces.Space] = {
            **graph_spaces(num_nodes, groups[0].num_features, (num_nodes,)),
            "is_robot": spaces.MultiBinary(num_nodes),
        }
        num_missions = [group.num_missions for group in groups]
        super().__init__(
            groups,
            sum(num_missions),
            spaces.Dict(observation),
            spaces.MultiDiscrete([num_nodes] * num_nodes),
        )
        self._reward: Reward = reward
        self._ends = np.cumsum(num_missions)[:-1]
        sizes = np.repeat([group.mission.num_robots for group in groups], num_missions)
        self._is_robot = np.arange(num_nodes) < sizes[:, None]

    def observe(self, graphs: Sequence[Graphs]) -> Observation:
        """The teams' graphs, stacked and padded; robots that do not exist may only be silent."""
        return self._observe(graphs, self._is_robot)

    def _observe(self, graphs: Sequence[Graphs], is_robot: np.ndarray) -> Observation:
        observation = {"is_robot": is_robot}
        for name, rows in padded(graphs, self.num_nodes).items():
            teams = np.zeros((*is_robot.shape, *rows.shape[1:]), dtype=rows.dtype)
            teams[is_robot] = rows
            observation[name] = teams
        observation["parent"][~is_robot] = NO_PARENT
        observation["may_address"] |= np.eye(self.num_nodes, dtype=np.bool_)
        return observation

    def step_wait(self) -> Step:
        """One window of all missions."""
        self.outcomes = [
            group.step(actions[:, : group.mission.num_robots], with_credit=False)
            for group, actions in zip(self.groups, np.split(self._actions, self._ends), strict=True)
        ]
        done = [
            np.full(group.num_missions, outcome.last_graphs is not None)
            for group, outcome in zip(self.groups, self.outcomes, strict=True)
        ]
        reward = [
            self._reward_of(group, outcome)
            for group, outcome in zip(self.groups, self.outcomes, strict=True)
        ]
        return (
            self.observe([each.graphs for each in self.outcomes]),
            np.concatenate(reward).astype(np.float32),
            np.concatenate(done),
            self._infos(),
        )

    def _reward_of(self, group: Group, outcome: Outcome) -> np.ndarray:
        if self._reward == "velocity-variance":
            return -outcome.velocity_variance_m2ps2
        return -outcome.age_windows / group.mission.num_windows

    def _infos(self) -> list[dict[str, Any]]:
        """Empty, but for missions that were cut: what their teams saw last has a value."""
        infos: list[dict[str, Any]] = []
        for outcome in self.outcomes:
            cut: list[dict[str, Any]] = [{} for _ in outcome.age_windows]
            if outcome.last_graphs is not None and outcome.is_cut:
                last = self._observe(
                    [outcome.last_graphs], self._is_robot[len(infos) : len(infos) + len(cut)]
                )
                cut = [
                    {
                        "terminal_observation": {name: last[name][b] for name in last},
                        "TimeLimit.truncated": True,
                    }
                    for b in range(len(cut))
                ]
            infos += cut
        return infos
