"""The order of robots in the tree and the age matrix, by hand."""

import numpy as np

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.walk import neighbours_together, walk
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


def test_children_follow_their_parents_before_the_next_branch():
    """0 has the children 1 and 2, and 2 has 3 and 4."""
    order, children = walk([-1, 0, 0, 2, 2], [1, 2, 3, 4], 0)
    assert order == [0, 2, 4, 3, 1]
    assert children == {0: [1, 2], 2: [3, 4]}


def test_near_robots_stand_together_in_the_matrix():
    swarm = Swarm(paper("stationary", num_robots=12), [1])
    record = Recorder(swarm)
    record.add(next(rollout(swarm, make_policy("tdma", swarm.mission))))
    log = record.log()
    order = neighbours_together(log)
    assert sorted(order) == list(range(12))
    ways_m = np.linalg.norm(np.diff(log.position_m[0, order], axis=0), axis=1)
    by_number_m = np.linalg.norm(np.diff(log.position_m[0], axis=0), axis=1)
    assert np.mean(ways_m) < np.mean(by_number_m)
