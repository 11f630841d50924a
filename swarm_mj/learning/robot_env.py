"""Arm `robot`: every robot of every mission is one row, paid its own credit."""

from collections.abc import Sequence

import numpy as np
from gymnasium import spaces

from swarm_mj.gnn.graphs import Graphs
from swarm_mj.learning.env import MissionsEnv, Observation, graph_spaces, largest_team
from swarm_mj.learning.missions import Group, Outcome, padded


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
        super().__init__(groups, num_rows, spaces.Dict(observation), spaces.Discrete(num_nodes))
        self._owner = np.concatenate(
            [
                np.tile(np.arange(g.mission.num_robots, dtype=np.int32), g.num_missions)
                for g in groups
            ]
        )[:, None]

    def _observe(self, graphs: Sequence[Graphs], envs: slice) -> Observation:
        """The rows' graphs, stacked and padded."""
        return {**padded(graphs, self.num_nodes), "owner": self._owner[envs]}

    def _step_group(self, group: Group, actions: np.ndarray) -> Outcome:
        return group.step(actions.reshape(group.num_missions, -1), with_credit=True)

    def _reward_of(self, group: Group, outcome: Outcome) -> np.ndarray:
        return outcome.credit.ravel() / group.mission.num_robots**2
