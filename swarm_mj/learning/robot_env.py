"""Credit assignment per robot: each robot is one environment, its reward a difference reward."""

from collections.abc import Sequence

import numpy as np
from gymnasium import spaces

from swarm_mj.gnn.graphs import Graphs
from swarm_mj.learning.mission_batch import MissionBatch, Transition
from swarm_mj.learning.vec_env import MissionsEnv, Observation, graph_spaces, largest_team, padded


class RobotEnv(MissionsEnv):
    """R environments, one a robot; the action is whom it addresses, the reward its credit per pair.

    Credit is what the team would not have gained in this window had the robot been silent
    (`credit.credits_of`), over the number of pairs, so that all team sizes count alike.
    """

    def __init__(self, batches: Sequence[MissionBatch]) -> None:
        """Takes the batches, already started."""
        num_nodes = largest_team(batches)
        observation: dict[str, spaces.Space] = {
            **graph_spaces(num_nodes, batches[0].num_features, ()),
            "owner": spaces.Box(0, num_nodes - 1, (1,), np.int32),
        }
        owners = [
            np.tile(np.arange(batch.mission.num_robots, dtype=np.int32), batch.num_missions)
            for batch in batches
        ]
        self._owner = np.concatenate(owners)[:, None]
        super().__init__(
            batches, [*map(len, owners)], spaces.Dict(observation), spaces.Discrete(num_nodes)
        )

    def _observe(self, graphs: Sequence[Graphs], envs: slice) -> Observation:
        """The robots' graphs, stacked and padded."""
        return {**padded(graphs, self.num_nodes), "owner": self._owner[envs]}

    def _step_batch(
        self, batch: MissionBatch, actions: np.ndarray
    ) -> tuple[Transition, np.ndarray]:
        transition = batch.step(actions.reshape(batch.num_missions, -1), with_credit=True)
        return transition, transition.credit.ravel() / batch.mission.num_robots**2
