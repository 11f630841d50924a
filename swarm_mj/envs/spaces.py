"""Observation and action spaces, the same in every face."""

from typing import Any

import numpy as np
from gymnasium import spaces
from gymnasium.vector.utils import batch_space

from swarm_mj.envs.mission_batch import MissionBatch
from swarm_mj.mission import MISSION_DISTANCE_M, Mission
from swarm_mj.policies.gnn.feature_sets import is_own_set
from swarm_mj.protocol.buffers import NO_PARENT


def robot_spaces(batch: MissionBatch) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    """Return one robot's observation space, and its recipients.

    `observation` [N, F] is what it knows of every teammate, itself included: see `FEATURES` of the
    feature set; all are normalised, and none has a unit. `action_mask` [N] is 1 for recipients
    within reach; itself, which is silence, always is. `parent` [N] is the robot that a
    teammate's news came over first, or -1.
    """
    num_robots = batch.mission.num_robots
    most = np.inf if is_own_set(batch.features) else _largest_feature(batch.mission)
    seen: dict[str, spaces.Space] = {
        "action_mask": spaces.Box(0, 1, (num_robots,), np.int8),
        "observation": spaces.Box(-most, most, (num_robots, batch.num_features), np.float32),
    }
    if batch.with_parents:
        seen["parent"] = spaces.Box(NO_PARENT, num_robots - 1, (num_robots,), np.int32)
    return spaces.Dict(seen), spaces.Discrete(num_robots)


def team_spaces(batch: MissionBatch) -> tuple[spaces.Space[Any], spaces.Space[Any]]:
    """Return all robots' observation space, with a leading axis N, and everyone's recipients."""
    num_robots = batch.mission.num_robots
    seen, _ = robot_spaces(batch)
    return batch_space(seen, num_robots), spaces.MultiDiscrete([num_robots] * num_robots)


def _largest_feature(mission: Mission) -> float:
    """Return a bound on every number that a feature set makes of a mission.

    Ages are shares of the mission or of 500 windows; positions and distances are those of robots
    that fly straight on all the time, by the area or by 1 km; counts are by 10 at least.
    """
    flown_m = mission.max_velocity_mps * mission.window_s * mission.num_windows
    lengths = (mission.side_m + 2.0 * flown_m) / min(mission.side_m, MISSION_DISTANCE_M)
    return float(np.ceil(mission.num_robots + mission.num_windows / 500.0 + lengths))
