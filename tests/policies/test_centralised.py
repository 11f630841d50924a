"""Round robin and the minimum spanning tree, by hand."""

import math

import numpy as np
import pytest

from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.centralised import MinimumSpanningTree, RoundRobin
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.window import LocalViews


def decided(policy, position_m, window=0):
    """Whom everyone addresses in this window of missions with these positions [b, i, axis]."""
    num_missions, num_robots = position_m.shape[:2]
    now = np.full(num_missions, float(window))
    views = LocalViews(buffers=empty_buffers(num_missions, num_robots), now=now, phases=())
    states = RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
    return policy.recipients(views, states)


# Round robin among four robots in the plane [m]; the third is nearest the centre.
SQUARE_M = np.array([[-90.0, 0.0], [0.0, 80.0], [10.0, -10.0], [70.0, 70.0]])


@pytest.mark.parametrize(
    ("order", "schedule"),
    [
        # Robots 0, 1 and 3 take turns in addressing the base, robot 2; everyone else is silent.
        ([0, 1, 2, 3], [[2, 1, 2, 3], [0, 2, 2, 3], [0, 1, 2, 2], [2, 1, 2, 3], [0, 2, 2, 3]]),
        ([2, 0, 1, 3], [[0, 0, 2, 3], [0, 1, 0, 3], [0, 1, 2, 0]]),  # the base is robot 0
        ([0, 1, 3, 2], [[3, 1, 2, 3], [0, 3, 2, 3], [0, 1, 3, 3]]),  # the base is robot 3
    ],
)
def test_iv_c_schedule_by_hand(order, schedule):
    position_m = SQUARE_M[None, order]
    found = [decided(RoundRobin(), position_m, window)[0].tolist() for window in range(5)]
    assert found[: len(schedule)] == schedule


@pytest.mark.parametrize(
    ("position_m", "window", "recipients"),
    [
        # The middle robot of a line beside the centre is no base: the one nearest the origin is.
        ([[300.0, 0.0], [200.0, 0.0], [100.0, 0.0]], 0, [2, 1, 2]),
        # When robot 3 moves to the centre it is the base of the next window.
        ([*SQUARE_M[:3].tolist(), [1.0, 1.0]], 2, [0, 1, 3, 3]),
        # (3, 3) is 4.2 m from the centre by a straight line, (5, 0) is 5 m; along axes 6 and 5.
        ([[5.0, 0.0], [3.0, 3.0], [9.0, 9.0]], 0, [1, 1, 2]),
    ],
)
def test_iv_c_the_base_is_nearest_to_the_centre(position_m, window, recipients):
    policy = RoundRobin()
    decided(policy, SQUARE_M[None], window)  # which must not be remembered
    assert decided(policy, np.array([position_m]), window).tolist() == [recipients]


# The tree of a line, 10 m apart but for a gap, as robots 3, 0, 4, 1, 2: the middle one is robot 4.
LINE_M = np.array([[10.0, 0.0], [45.0, 0.0], [55.0, 0.0], [0.0, 0.0], [20.0, 0.0]])


def tree(probability=1.0, num_missions=1, **options):
    policy = MinimumSpanningTree(probability, **options)
    policy.start(5, [np.random.default_rng((5, b)) for b in range(num_missions)])
    return policy


def test_iv_c_root_is_silent_by_default_and_addresses_the_last_robot_in_the_authors_code():
    """Their missing parent, -1, counts from the end; a root that is the last is silent."""
    swapped = LINE_M[[0, 1, 4, 3, 2]]  # robot 2 is now the middle one
    for options, position_m, parents in (
        ({}, LINE_M, [4, 4, 1, 0, 4]),
        ({"root_transmits": True}, swapped, [2, 2, 4, 0, 1]),
        ({"root_transmits": True}, LINE_M, [4, 4, 1, 0, 4]),
    ):
        np.testing.assert_array_equal(decided(tree(**options), position_m[None]), [parents])


def test_iv_c_tree_is_kept_from_the_start_or_recomputed():
    moved = LINE_M[[4, 1, 2, 3, 0]]  # robots 0 and 4 swap places: robot 0 is the middle one
    kept, anew = tree(), tree(is_recomputed=True)
    for policy in (kept, anew):
        np.testing.assert_array_equal(decided(policy, LINE_M[None]), [[4, 4, 1, 0, 4]])
    np.testing.assert_array_equal(decided(kept, moved[None]), [[4, 4, 1, 0, 4]])
    np.testing.assert_array_equal(decided(anew, moved[None]), [[0, 0, 1, 4, 0]])
    kept.start(5, [np.random.default_rng(0)])  # a new mission forgets the old tree
    np.testing.assert_array_equal(decided(kept, moved[None]), [[0, 0, 1, 4, 0]])


@pytest.mark.parametrize("probability", [0.0, 0.06, 0.5])
def test_iv_c_frequency_is_the_probability(probability):
    """Each robot but the root: within 5 standard deviations; and robots draw apart."""
    policy, both_m = tree(probability, num_missions=2), np.stack([LINE_M, LINE_M])
    sending = np.stack([decided(policy, both_m) != np.arange(5) for _ in range(3000)])
    assert not np.any(sending[..., 4])
    deviation = math.sqrt(probability * (1 - probability) / 6000)
    off = np.mean(sending[..., :4], axis=(0, 1)) - probability
    assert np.abs(off).max() <= 5 * deviation
    if probability:
        correlation = np.corrcoef(sending[..., :4].reshape(3000, -1).T)
        np.testing.assert_allclose(correlation, np.eye(8), atol=5 / math.sqrt(3000))
