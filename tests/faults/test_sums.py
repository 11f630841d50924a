"""A mission's numbers, alone and beside others."""

import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("random-walk", num_robots=8, num_windows=150)


def summary(seeds):
    return summarise(list(rollout(Swarm(MISSION, seeds), make_policy("tdma", MISSION))))


@pytest.mark.fault("same numbers alone and beside others")
def test_a_summary_is_the_same_alone_and_beside_others(tries):
    """Fault 27: means differed in their last digits."""
    seeds = range(tries(8))
    together = summary(seeds)
    for seed in seeds:
        alone = summary([seed])
        for name in ("aoi_mean", "velocity_variance_mean", "hops_mean"):
            assert getattr(alone, name)[0] == getattr(together, name)[seed], (name, seed)
