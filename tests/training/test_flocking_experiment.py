"""The experiment on flocking, on a small scale."""

import flocking_converges as experiment
import numpy as np

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


def test_the_share_left_is_last_over_first_variance():
    mission = paper("flocking", num_robots=6, num_windows=40, range_ratio=1.0)
    settings = experiment.Settings(mission=mission, first_seed=3, num_missions=2)
    left = experiment.left_over(settings, "round-robin")

    swarm = Swarm(mission, [3, 4])
    spread = [
        swarm.states.velocity_mps.var(axis=1).sum(axis=1)
        for _ in rollout(swarm, make_policy("round-robin", mission))
    ]
    np.testing.assert_allclose(left, spread[-1] / spread[0], rtol=1e-9)
    assert np.all(left < 0.01)
