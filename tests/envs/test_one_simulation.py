"""All faces are one simulation: the same seeds and actions are the same missions.

Two missions of other seeds fly through each face, window by window, beside a swarm flown by
hand; all is equal to the last digit.
"""

import pickle
from functools import partial

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

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


def begun(env, seed=None, **options):
    env.reset(seed=seed, **options)
    return env


def in_parallel(env, recipient):
    rewards = set(env.step({agent: recipient[int(agent[6:])] for agent in env.agents})[1].values())
    assert len(rewards) == 1  # a team is paid alike
    return rewards.pop()


def by_name(mission, seed):
    """In Gymnasium's registry, in all of its wrappers."""
    register_environments()
    return begun(gymnasium.make("swarm_mj/Flocking-v0", mission=mission), seed)


def through_dm_control(mission, seed):
    environment = make_environment(mission, seed)
    environment.reset()
    return environment


# How to begin a mission, to play a window for its reward, and to find its swarm.
SINGLE = {
    "gymnasium": (
        lambda mission, seed: begun(SwarmEnv(mission), seed),
        lambda env, recipient: env.step(recipient)[1],
        lambda env: env.batch.swarm,
    ),
    "by name": (
        by_name,
        lambda env, recipient: env.step(recipient)[1],
        lambda env: env.unwrapped.batch.swarm,
    ),
    "pettingzoo": (
        lambda mission, seed: begun(parallel_env(mission), seed),
        in_parallel,
        lambda env: env.batch.swarm,
    ),
    "dm_control": (
        through_dm_control,
        lambda env, recipient: env.step(recipient).reward,
        lambda env: env.physics.swarm,
    ),
}


class Singles:
    """Missions of one environment each."""

    def __init__(self, mission, face):
        make, self.play, self.swarm = SINGLE[face]
        self.envs = [make(mission, seed) for seed in SEEDS]

    def step(self, recipient):
        return [self.play(env, each) for env, each in zip(self.envs, recipient, strict=True)]

    def swarms(self):
        return [(self.swarm(env), 0) for env in self.envs]


class Vector:
    """Missions of one environment, which begin together or each in a batch of its own."""

    def __init__(self, mission, face):
        self.env = begun(SwarmVectorEnv(2, mission), SEEDS[0])
        if face == "vector, masked":
            options = {"reset_mask": np.array([False, True])}
            begun(self.env, list(SEEDS), options=options)

    def step(self, recipient):
        return self.env.step(recipient)[1]

    def swarms(self):
        flown = zip(self.env._batches, self.env._rows, strict=True)
        return [(batch.swarm, row) for batch, row in flown]


class Sb3:
    def __init__(self, mission, face):
        self.env = make_vec_env(mission, 2, seed=SEEDS[0], agent=face.partition(" ")[2])
        self.env.reset()

    def step(self, recipient):
        reward = self.env.step(recipient.reshape(self.env.num_envs, -1))[1]
        return reward.reshape(2, -1)[:, 0]

    def swarms(self):
        return [(self.env.batches[0].swarm, row) for row in (0, 1)]


FACES = dict.fromkeys(SINGLE, Singles)
FACES |= {"vector": Vector, "vector, masked": Vector, "sb3 robot": Sb3, "sb3 team": Sb3}


@pytest.mark.parametrize("numbers", [{}, {"failure_fraction": 0.3, "physics": "contact"}])
@pytest.mark.parametrize("face", FACES)
def test_every_face_flies_the_same_missions(face, numbers):
    mission = paper("flocking", num_robots=NUM_ROBOTS, range_ratio=0.4, num_windows=50, **numbers)
    flown, swarm = FACES[face](mission, face), Swarm(mission, SEEDS)
    shape = (NUM_WINDOWS, 2, NUM_ROBOTS)
    for recipient in np.random.default_rng(2).integers(0, NUM_ROBOTS, shape):
        reward = flown.step(recipient)
        costs = swarm.step_with_recipients(recipient)
        exact = np.float32 if isinstance(flown, Sb3) else np.float64
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


@pytest.mark.parametrize("face", [SwarmEnv, parallel_env, partial(SwarmVectorEnv, 2)])
def test_a_copy_by_pickle_flies_the_same(face):
    env = face("flocking", features="paper", num_robots=5, range_ratio=0.4)
    copy = pickle.loads(pickle.dumps(env))
    assert data_equivalence(env.reset(seed=3), copy.reset(seed=3), exact=True)


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
