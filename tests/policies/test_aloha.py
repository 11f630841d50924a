import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.policies.aloha import Aloha, num_contenders
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews

RANGE_M = 250.0


def views_of(position_m, is_known):
    """Views in which robot i believes j at position_m[b, i, j], if it knows of it."""
    buffers = empty_buffers(*position_m.shape[:2])
    buffers.position_m[:] = position_m
    buffers.timestamp[:] = is_known
    return LocalViews(buffers=buffers, now=np.zeros(len(position_m)), phases=())


def everyone_near(num_missions, num_robots):
    shape = (num_missions, num_robots, num_robots)
    return views_of(np.zeros((*shape, 2)), np.ones(shape))


def is_sending(policy, views):
    return policy.transmits(views)


def started(probability, num_missions, num_robots):
    policy = Aloha(probability, range_m=RANGE_M)
    policy.start(num_robots, [np.random.default_rng((7, b)) for b in range(num_missions)])
    return policy


def test_contenders_by_hand():
    """Four on a line at 0, 240, 480, 720 m; robot 0 knows all, 1 nobody, 2 robot 1, 3 robot 0."""
    line_m = np.array([[0.0, 0.0], [240.0, 0.0], [480.0, 0.0], [720.0, 0.0]])
    is_known = np.array([[[1, 1, 1, 1], [0, 0, 0, 0], [0, 1, 1, 0], [1, 0, 0, 1]]])
    views = views_of(np.broadcast_to(line_m, (1, 4, 4, 2)), is_known)
    # 4 · 2/4: itself and robot 1 of four known; 4 · 1/1; 4 · 2/2; 4 · 1/2.
    np.testing.assert_array_equal(num_contenders(views, RANGE_M), [[2.0, 4.0, 4.0, 2.0]])


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 12))
def test_contenders_are_counted_in_each_robots_own_beliefs(seed, num_robots):
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-300, 300, size=(2, num_robots, num_robots, 2))
    is_known = rng.random((2, num_robots, num_robots)) < 0.6
    found = num_contenders(views_of(position_m, is_known), RANGE_M)
    for b, i in np.ndindex(2, num_robots):
        known = [j for j in range(num_robots) if is_known[b, i, j] or j == i]
        near = [j for j in known if math.dist(position_m[b, i, i], position_m[b, i, j]) <= RANGE_M]
        assert found[b, i] == pytest.approx(num_robots * len(near) / len(known))


@pytest.mark.parametrize("probability", [0.3, 0.9])
def test_a_neighbourhood_is_heard_with_the_probability(probability):
    """However many there are, somebody sends with p: 4000 slots, within 5 standard deviations."""
    for num_robots in (2, 7):
        sending = is_sending(
            started(probability, 4000, num_robots), everyone_near(4000, num_robots)
        )
        off = np.mean(np.any(sending, axis=1)) - probability
        assert abs(off) < 5 * math.sqrt(probability * (1 - probability) / 4000)


def test_a_robot_alone_in_range_sends_with_the_probability_itself():
    """Seven that know each other, everyone out of everyone's range: n is 7 · 1/7."""
    apart_m = np.zeros((2000, 7, 7, 2))
    apart_m[..., 0] = 1000.0 * np.arange(7)
    sending = is_sending(started(0.4, 2000, 7), views_of(apart_m, np.ones((2000, 7, 7))))
    assert abs(np.mean(sending) - 0.4) < 5 * math.sqrt(0.24 / 14_000)


def test_probability_0_is_silence_and_1_is_a_storm():
    views = everyone_near(3, 5)
    silent, storm = started(0.0, 3, 5), started(1.0, 3, 5)
    for _ in range(100):
        assert not np.any(is_sending(silent, views))
        assert np.all(is_sending(storm, views))
