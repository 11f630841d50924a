"""How long each policy takes to decide, in teams that walk and in teams at rest."""

import time
from collections.abc import Collection, Iterator

import numpy as np
from jaxtyping import Int

from swarm_mj.api.flight import compile_ahead
from swarm_mj.cli.bench_simulation import MISSION, Row
from swarm_mj.mission import Mission, paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.swarm import Swarm

TEAMS = {"walking": MISSION, "stationary": paper("stationary")}
NUM_WINDOWS = 120  # of a mission: the planner makes six plans for 40 robots meanwhile


class TimedSwarm(Swarm):
    """A swarm that adds up the time that its policy takes to decide."""

    deciding_s = 0.0

    def decide(self) -> Int[np.ndarray, "B N"]:
        """Return whom each robot addresses next, as any swarm does."""
        # Not the time on the wall: a pause for other programs lasts as long as 100 decisions.
        start_s = time.thread_time()
        recipient = super().decide()
        self.deciding_s += time.thread_time() - start_s
        return recipient


def decision_rows(mission: Mission, policies: Collection[str], seconds: float) -> Iterator[Row]:
    """Time the decisions of all robots in one window, of these policies."""
    for name in policies:
        yield Row(name, _decision_us(name, mission, seconds), "{:,.1f} µs")


def _decision_us(policy: str, mission: Mission, seconds: float) -> float:
    """Return the median over missions of the mean time of a window's decisions [µs]."""
    compile_ahead(mission, policy)
    swarm = TimedSwarm(mission, [0])
    missions_us = []
    end_s = time.perf_counter() + seconds
    while not missions_us or time.perf_counter() < end_s:
        swarm.restart([len(missions_us)])
        swarm.start(make_policy(policy, mission))
        swarm.deciding_s = 0.0
        for _ in range(NUM_WINDOWS):
            swarm.step()
        missions_us.append(1e6 * swarm.deciding_s / NUM_WINDOWS)
    return float(np.median(missions_us))
