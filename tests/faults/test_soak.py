"""Many windows and many missions in one process: the memory stays, and so do threads and files."""

import gc
import os
from pathlib import Path

import numpy as np
import pytest

import swarm_mj
from swarm_mj.envs.gymnasium_vector import SwarmVectorEnv
from swarm_mj.envs.sb3 import make_vec_env
from swarm_mj.simulation.rollout import rollout

SMALL = {"num_robots": 8, "num_windows": 10, "range_ratio": 0.5}
WARM_UP = 10  # rounds, in which caches fill
MOST_MIB = 6.0  # that may be added, whatever the number of rounds
needs_proc = pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux")


def taken():
    """What this process has: memory [MiB], threads and open files."""
    gc.collect()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    mib = pages * os.sysconf("SC_PAGE_SIZE") / 2**20
    return np.array([mib, len(os.listdir("/proc/self/task")), len(os.listdir("/proc/self/fd"))])


def restarted_swarm(policy, **fields):
    """One swarm, restarted for each round."""
    mission = swarm_mj.paper(**SMALL, **fields)
    swarm = swarm_mj.Swarm(mission, [1, 2])
    flies = swarm_mj.make_policy(policy, mission)

    def one_round(n):
        swarm.restart([n, n + 1])
        for _ in rollout(swarm, flies):
            pass

    return one_round


def vector_env():
    """Environments some of which begin alone, so that batches come and go."""
    env = SwarmVectorEnv(3, autoreset_mode="Disabled", **SMALL)
    env.reset(seed=1)

    def one_round(n):
        alone = np.arange(3) == n % 3
        env.reset(seed=n, options={"reset_mask": alone})
        env.step(np.zeros((3, 8), dtype=int))
        env.reset(seed=n)

    return one_round


def vec_env():
    env = make_vec_env("flocking", 3, seed=1, **SMALL)
    env.reset()

    def one_round(_):
        for _ in range(SMALL["num_windows"]):
            env.step(np.zeros(env.num_envs, dtype=int))

    return one_round


def new_flights():
    """A new mission each time, compiled and forgotten."""

    def one_round(n):
        swarm_mj.fly("flocking", policy="tdma", seed=n, **SMALL)

    return one_round


ROUNDS = {
    "planner": (lambda: restarted_swarm("planner"), 20),
    "sotdma": (lambda: restarted_swarm("sotdma"), 20),
    "gnn": (lambda: restarted_swarm("gnn"), 20),
    "city": (lambda: restarted_swarm("tdma", arena="forest", physics="contact"), 20),
    "fades": (lambda: restarted_swarm("csma", fading="rayleigh", burst_begin=0.1), 20),
    "vector": (vector_env, 20),
    "sb3": (vec_env, 20),
    "flights": (new_flights, 15),
}


@needs_proc
@pytest.mark.slow
@pytest.mark.fault("memory of many missions")
@pytest.mark.parametrize("kind", ROUNDS)
def test_many_missions_take_no_more_than_some(tries, kind):
    begin, usual = ROUNDS[kind]
    one_round = begin()
    for n in range(WARM_UP):
        one_round(n)
    before = taken()
    for n in range(tries(usual)):
        one_round(n)
    more_mib, more_threads, more_files = taken() - before
    assert more_mib < MOST_MIB
    assert more_threads <= 0
    assert more_files <= 0
