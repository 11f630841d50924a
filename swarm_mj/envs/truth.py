"""The whole truth about a mission, for critics that see it in training; no robot ever does."""

import numpy as np
from gymnasium import spaces
from jaxtyping import Float32

from swarm_mj.envs.mission_batch import MissionBatch
from swarm_mj.envs.options import largest_feature
from swarm_mj.mission import Mission
from swarm_mj.policies.gnn.packet_memory import LONG_WINDOWS

NUM_OWN = 5  # numbers of a robot itself: x, y, their velocities, whether it is active


def truth_space(mission: Mission) -> spaces.Box:
    """Return the space of `truth`: all numbers are normalised, and none has a unit."""
    num_robots = mission.num_robots
    most = largest_feature(mission)
    return spaces.Box(-most, most, (1 + num_robots * (NUM_OWN + num_robots),), np.float32)


def truth(batch: MissionBatch) -> Float32[np.ndarray, "B S"]:
    """Return where all robots truly are, and how old everything is that each of them knows.

    The share of the mission that is flown; then for every robot its position by half the side of
    the area, its velocity by the maximum, 1 if it is active, and the age of what it knows of each
    robot, on the scale of the extended features.
    """
    mission, swarm = batch.mission, batch.flown
    age = np.minimum(swarm.now[:, np.newaxis, np.newaxis] - swarm.buffers.timestamp, LONG_WINDOWS)
    log_age = np.log1p(age) / np.log1p(LONG_WINDOWS)  # 0 is now, 1 is `LONG_WINDOWS` ago
    robots = np.concatenate(
        [
            swarm.states.position_m / mission.half_side_m,
            swarm.states.velocity_mps / (mission.max_velocity_mps or 1.0),
            batch.is_active[..., np.newaxis],
            np.where(swarm.buffers.is_known, log_age, 1.0),  # 1 is also what was never known
        ],
        axis=-1,
    )
    flown = swarm.now[:, np.newaxis] / mission.num_windows
    return np.hstack([flown, robots.reshape(len(flown), -1)]).astype(np.float32)
