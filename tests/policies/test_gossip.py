import math

import numpy as np
import pytest

from swarm_mj.policies.gossip import InnovationGossip
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews

NUM_ROBOTS = 4


def started(probability, num_missions=1):
    policy = InnovationGossip(probability)
    policy.start(NUM_ROBOTS, [np.random.default_rng((7, b)) for b in range(num_missions)])
    return policy


def is_telling(policy, timestamp):
    """Who broadcasts, with these T [mission, robot, about]."""
    timestamp = np.asarray(timestamp, dtype=float)
    buffers = empty_buffers(*timestamp.shape[:2])
    buffers.timestamp[:] = timestamp
    return policy.transmits(LocalViews(buffers=buffers, now=np.zeros(len(timestamp)), phases=()))


def test_robots_with_news_enough_broadcast_for_certain_and_then_rest():
    """At p = 0.5 news of 2 windows are certain: 8 windows in all, over a team of 4."""
    policy = started(0.5)
    told = [[[2, 2, 2, 2], [0, 0, 0, 0], [8, 0, 0, 0], [0, 0, 0, 0]]]
    assert is_telling(policy, told).tolist() == [[True, False, True, False]]
    for _ in range(100):
        assert not np.any(is_telling(policy, told))


def test_news_count_from_a_robots_own_last_broadcast():
    """Robots 0 and 2 told all they knew; what robot 1 knows grows, until it is certain too."""
    policy = started(0.5)
    is_telling(policy, [[[2, 2, 2, 2], [0, 0, 0, 0], [8, 0, 0, 0], [0, 0, 0, 0]]])
    later = [[[2, 2, 2, 2], [0, 9, 0, 0], [8, 3, 3, 2], [0, 0, 0, 0]]]
    assert is_telling(policy, later).tolist() == [[False, True, True, False]]


def test_a_new_mission_forgets_what_was_told():
    policy = started(0.5)
    everything = np.full((1, NUM_ROBOTS, NUM_ROBOTS), 2.0)
    assert np.all(is_telling(policy, everything))
    assert not np.any(is_telling(policy, everything))
    policy.start(NUM_ROBOTS, [np.random.default_rng(1)])
    assert np.all(is_telling(policy, everything))


@pytest.mark.parametrize("news", [0.5, 3.0])
def test_chance_is_the_probability_times_the_news(news):
    """Of 8000 robots: within 5 standard deviations."""
    policy = started(0.1, num_missions=2000)
    timestamp = np.zeros((2000, NUM_ROBOTS, NUM_ROBOTS))
    timestamp[:, :, 1] = news * NUM_ROBOTS  # about one teammate: the mean counts
    chance = 0.1 * news
    off = np.mean(is_telling(policy, timestamp)) - chance
    assert abs(off) < 5 * math.sqrt(chance * (1 - chance) / 8000)


def test_news_add_up_until_they_are_told():
    """With one window of news a step at p = 0.1, 0.9 · 0.8 · 0.7 of 8000 are silent for three."""
    policy = started(0.1, num_missions=2000)
    has_told = np.zeros((2000, NUM_ROBOTS), dtype=bool)
    for window in (1.0, 2.0, 3.0):
        has_told |= is_telling(policy, np.full((2000, NUM_ROBOTS, NUM_ROBOTS), window))
    off = np.mean(~has_told) - 0.504
    assert abs(off) < 5 * math.sqrt(0.504 * 0.496 / 8000)


def test_probability_0_is_silence():
    policy = started(0.0)
    assert not any(np.any(is_telling(policy, np.full((1, 4, 4), t))) for t in range(200))
