"""Arm `team`, the paper's: one mission is one environment, its robots act jointly, one reward."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from gymnasium import spaces

from swarm_mj.gnn.graphs import Graphs
from swarm_mj.learning.env import MissionsEnv, Observation, graph_spaces, largest_team
from swarm_mj.learning.missions import Group, Outcome, padded
from swarm_mj.protocol.buffers import NO_PARENT

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
            num_missions,
            spaces.Dict(observation),
            spaces.MultiDiscrete([num_nodes] * num_nodes),
        )
        self._reward: Reward = reward
        sizes = np.repeat([group.mission.num_robots for group in groups], num_missions)
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

    def _step_group(self, group: Group, actions: np.ndarray) -> Outcome:
        return group.step(actions[:, : group.mission.num_robots], with_credit=False)

    def _reward_of(self, group: Group, outcome: Outcome) -> np.ndarray:
        if self._reward == "velocity-variance":
            return -outcome.velocity_variance_m2ps2
        return -outcome.age_windows / group.mission.num_windows
