import math

import numpy as np
import pytest

from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.minimum_spanning_tree import MinimumSpanningTree
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews

# On a line, 10 m apart but for a gap, as robots 3, 0, 4, 1, 2: the middle one is robot 4.
LINE_M = np.array([[10.0, 0.0], [45.0, 0.0], [55.0, 0.0], [0.0, 0.0], [20.0, 0.0]])


def decided(policy, position_m):
    """Whom everyone addresses."""
    num_missions, num_robots = position_m.shape[:2]
    views = LocalViews(
        buffers=empty_buffers(num_missions, num_robots), now=np.zeros(num_missions), phases=()
    )
    states = RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
    return policy.recipients(views, states)


def started(num_robots, probability=1.0, num_missions=1, **options):
    policy = MinimumSpanningTree(probability, **options)
    policy.start(num_robots, [np.random.default_rng((5, b)) for b in range(num_missions)])
    return policy


def test_iv_c_root_is_silent_by_default():
    """The paper's root has no parent to talk to; everyone else addresses theirs."""
    np.testing.assert_array_equal(decided(started(5), LINE_M[None]), [[4, 4, 1, 0, 4]])


def test_iv_c_reference_root_addresses_the_last_robot():
    """The authors' missing parent, -1, counts from the end; a root that is the last is silent."""
    swapped = LINE_M[[0, 1, 4, 3, 2]]  # robot 2 is now the middle one
    policy = started(5, root_transmits=True)
    np.testing.assert_array_equal(decided(policy, swapped[None]), [[2, 2, 4, 0, 1]])
    policy = started(5, root_transmits=True)
    np.testing.assert_array_equal(decided(policy, LINE_M[None]), [[4, 4, 1, 0, 4]])


def test_iv_c_tree_is_kept_from_the_start_or_recomputed():
    moved = LINE_M[[4, 1, 2, 3, 0]]  # robots 0 and 4 swap places: robot 0 is the middle one
    kept, anew = started(5), started(5, is_recomputed=True)
    for policy in (kept, anew):
        np.testing.assert_array_equal(decided(policy, LINE_M[None]), [[4, 4, 1, 0, 4]])
    np.testing.assert_array_equal(decided(kept, moved[None]), [[4, 4, 1, 0, 4]])
    np.testing.assert_array_equal(decided(anew, moved[None]), [[0, 0, 1, 4, 0]])
    kept.start(5, [np.random.default_rng(0)])  # a new mission forgets the old tree
    np.testing.assert_array_equal(decided(kept, moved[None]), [[0, 0, 1, 4, 0]])


def test_iv_c_probability_0_is_silence():
    policy = started(5, probability=0.0)
    for _ in range(100):
        np.testing.assert_array_equal(decided(policy, LINE_M[None]), [range(5)])


@pytest.mark.parametrize("probability", [0.06, 0.5])
def test_iv_c_frequency_is_the_probability(probability):
    """Each robot but the root: within 5 standard deviations; and robots draw apart."""
    policy = started(5, probability, num_missions=2)
    both_m = np.stack([LINE_M, LINE_M])
    sending = np.stack([decided(policy, both_m) != np.arange(5) for _ in range(3000)])
    assert not np.any(sending[..., 4])
    deviation = math.sqrt(probability * (1 - probability) / 6000)
    off = np.mean(sending[..., :4], axis=(0, 1)) - probability
    assert np.abs(off).max() < 5 * deviation
    correlation = np.corrcoef(sending[..., :4].reshape(3000, -1).T)
    np.testing.assert_allclose(correlation, np.eye(8), atol=5 / math.sqrt(3000))
