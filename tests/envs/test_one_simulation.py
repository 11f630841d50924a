"""All faces are one simulation: the same seeds and actions are the same missions.

Two missions of other seeds fly through each face, window by window, beside a swarm flown by
hand; all is equal to the last digit.
"""

import gymnasium
import numpy as np
import pytest

from swarm_mj.envs import register_environments
from swarm_mj.envs.dm import make_environment
from swarm_mj.envs.gymnasium import SwarmEnv
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.envs.pettingzoo import parallel_env
from swarm_mj.envs.sb3 import make_vec_env
from swarm_mj.mission import paper
from swarm_mj.simulation.swarm import Swarm

SEEDS = (11, 12)
NUM_WINDOWS, NUM_ROBOTS = 40, 6
BUFFERS = ("timestamp", "position_m", "velocity_mps", "parent", "last_attempt")


class Flown:
    """Missions of one environment each."""

    def __init__(self, mission):
        self.envs = [self.make(mission, seed) for seed in SEEDS]

    def step(self, recipient):
        return [self.play(env, each) for env, each in zip(self.envs, recipient, strict=True)]

    def swarms(self):
        return [(self.swarm(env), 0) for env in self.envs]


class Single(Flown):
    def make(self, mission, seed):
        env = SwarmEnv(mission)
        env.reset(seed=seed)
        return env

    def play(self, env, recipient):
        return env.step(recipient)[1]

    def swarm(self, env):
        return env.unwrapped.batch.swarm


class Made(Single):
    """By its name in Gymnasium's registry, in all of its wrappers."""

    def make(self, mission, seed):
        register_environments()
        env = gymnasium.make("swarm_mj/Flocking-v0", mission=mission)
        env.reset(seed=seed)
        return env


class Parallel(Flown):
    def make(self, mission, seed):
        env = parallel_env(mission)
        env.reset(seed=seed)
        return env

    def play(self, env, recipient):
        actions = {agent: recipient[int(agent[6:])] for agent in env.agents}
        rewards = set(env.step(actions)[1].values())
        assert len(rewards) == 1  # a team is paid alike
        return rewards.pop()

    def swarm(self, env):
        return env.batch.swarm


class DmControl(Flown):
    def make(self, mission, seed):
        env = make_environment(mission, seed)
        env.reset()
        return env

    def play(self, env, recipient):
        return env.step(recipient).reward

    def swarm(self, env):
        return env.physics.swarm


class Vector:
    def __init__(self, mission):
        self.env = SwarmVectorEnv(2, mission)
        self.env.reset(seed=SEEDS[0])

    def step(self, recipient):
        return self.env.step(recipient)[1]

    def swarms(self):
        (group,) = self.env._groups
        return [(group.batch.swarm, 0), (group.batch.swarm, 1)]


class MaskedVector(Vector):
    """Missions that began at different times, each in a group of its own."""

    def __init__(self, mission):
        self.env = SwarmVectorEnv(2, mission)
        self.env.reset(seed=SEEDS[0])
        mask = np.array([False, True])
        self.env.reset(seed=list(SEEDS), options={"reset_mask": mask})

    def swarms(self):
        groups = self.env._groups
        return [(g.batch.swarm, row) for g in groups for row in g.rows]


class Sb3Robots:
    agent = "robot"

    def __init__(self, mission):
        self.env = make_vec_env(mission, 2, seed=SEEDS[0], agent=self.agent)
        self.env.reset()

    def step(self, recipient):
        reward = self.env.step(recipient.reshape(self.env.num_envs, -1))[1]
        return reward.reshape(2, -1)[:, 0]

    def swarms(self):
        swarm = self.env.batches[0].swarm
        return [(swarm, 0), (swarm, 1)]


class Sb3Teams(Sb3Robots):
    agent = "team"


FACES = [Single, Made, Parallel, DmControl, Vector, MaskedVector, Sb3Robots, Sb3Teams]


@pytest.mark.parametrize("numbers", [{}, {"failure_fraction": 0.3, "physics": "contact"}])
@pytest.mark.parametrize("face", FACES)
def test_every_face_flies_the_same_missions(face, numbers):
    mission = paper("flocking", num_robots=NUM_ROBOTS, range_ratio=0.4, num_windows=50, **numbers)
    flown, swarm = face(mission), Swarm(mission, SEEDS)
    shape = (NUM_WINDOWS, 2, NUM_ROBOTS)
    for recipient in np.random.default_rng(2).integers(0, NUM_ROBOTS, shape):
        reward = flown.step(recipient)
        costs = swarm.step_with_recipients(recipient)
        exact = np.float32 if isinstance(flown, Sb3Robots) else np.float64
        np.testing.assert_array_equal(reward, -costs.age_windows.astype(exact))
        for b, (other, row) in enumerate(flown.swarms()):
            for name in BUFFERS:
                theirs, ours = (getattr(each.buffers, name) for each in (other, swarm))
                np.testing.assert_array_equal(theirs[row], ours[b])
            np.testing.assert_array_equal(other.states.position_m[row], swarm.states.position_m[b])
            np.testing.assert_array_equal(
                other.states.velocity_mps[row], swarm.states.velocity_mps[b]
            )
            assert other.now[row] == swarm.now[b]
    assert (swarm.states.is_active is not None) == ("failure_fraction" in numbers)
    assert np.all(np.mean(swarm.buffers.timestamp > 0.0, axis=(1, 2)) > 0.4)  # they did talk


def test_later_missions_are_the_same_too():
    """Without a seed, every face of Gymnasium's kind draws the next mission by the same rule."""
    mission = paper("flocking", num_robots=4, num_windows=3)
    single, parallel = SwarmEnv(mission), parallel_env(mission)
    single.reset(seed=5), parallel.reset(seed=5)
    drawn = [single.reset()[1]["seed"] for _ in range(3)]
    assert [parallel.reset()[1]["robot_0"]["seed"] for _ in range(3)] == drawn
    vector, sb3 = SwarmVectorEnv(2, mission), make_vec_env(mission, 2, seed=5)
    vector.reset(seed=5)
    assert [vector.reset()[1]["seed"][0] for _ in range(3)] == drawn
    sb3.reset()
    assert [(sb3.reset(), sb3.reset_infos[0]["seed"])[1] for _ in range(3)] == drawn
    assert min(drawn) >= 2**40
    assert len(set(drawn)) == 3
