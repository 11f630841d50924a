"""Shared team reward, the paper's way (III-C): each mission is one environment."""

from collections.abc import Sequence

import numpy as np
from gymnasium import spaces

from swarm_mj.gnn.graphs import Graphs
from swarm_mj.learning.mission_batch import MissionBatch, Transition
from swarm_mj.learning.settings import Reward
from swarm_mj.learning.vec_env import MissionsEnv, Observation, graph_spaces, largest_team, padded
from swarm_mj.protocol.buffers import NO_PARENT


class TeamEnv(MissionsEnv):
    """B environments; the joint action is everyone's recipient, the reward the negative cost.

    With `aoi` the reward is the mean age of information (Eq. 10) over the mission's duration,
    negative; with `velocity-variance` it is the negative variance (Eq. 17), as in Fig. 6. Smaller
    teams are padded with robots that do not exist: they are silent and see nothing.
    """

    def __init__(self, batches: Sequence[MissionBatch], reward: Reward = "aoi") -> None:
        """Takes the batches, already started."""
        num_nodes = largest_team(batches)
        observation: dict[str, spaces.Space] = {
            **graph_spaces(num_nodes, batches[0].num_features, (num_nodes,)),
            "is_robot": spaces.MultiBinary(num_nodes),
        }
        num_missions = [batch.num_missions for batch in batches]
        super().__init__(
            batches,
            num_missions,
            spaces.Dict(observation),
            spaces.MultiDiscrete([num_nodes] * num_nodes),
        )
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
