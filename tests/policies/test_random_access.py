"""Policies that draw whether they transmit: how often, to whom, and from whose numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from swarm_mj.mission import paper, reference
from swarm_mj.policies.random_access import Aloha, InnovationGossip, RandomFlooding, num_contenders
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.protocol.window import LocalViews
from swarm_mj.simulation.swarm import Swarm

NUM_ROBOTS, RANGE_M = 6, 250.0


def started(policy, num_missions=1, num_robots=NUM_ROBOTS):
    policy.start(num_robots, [np.random.default_rng((7, b)) for b in range(num_missions)])
    return policy


def views_of(timestamp, position_m=0.0):
    """Views with these T [mission, robot, about], and beliefs where everyone is."""
    buffers = empty_buffers(*np.shape(timestamp)[:2])
    buffers.timestamp[:], buffers.position_m[:] = timestamp, position_m
    return LocalViews(buffers=buffers, now=np.zeros(len(timestamp)), phases=())


def everyone_near(num_missions, num_robots):
    return views_of(np.ones((num_missions, num_robots, num_robots)))


def is_about(share, expected, num_draws):
    """Whether a share of draws is within 5 standard deviations of its probability."""
    return np.all(abs(share - expected) < 5 * math.sqrt(expected * (1 - expected) / num_draws))


# Random flooding.


def flooded(probability, num_slots, *, named=True):
    """Whom everyone addresses [slot, mission, robot]."""
    policy = started(RandomFlooding(probability, names_addressee=named), num_missions=2)
    views = everyone_near(2, NUM_ROBOTS)
    return np.stack([policy.recipients(views) for _ in range(num_slots)])


def is_sending(recipient):
    return recipient != np.arange(recipient.shape[-1])


@pytest.mark.parametrize("probability", [0.3, 1.0])
def test_iv_c_the_whole_team_is_addressed_alike(probability):
    """As in the authors' code the recipient is uniform over all N, so at p = 1 in N is silence.

    It does not depend on whether a robot sends: among packets at p = 0.3 it is as uniform.
    """
    recipient = flooded(probability, 4000)
    for i in range(NUM_ROBOTS):
        counts = np.bincount(recipient[..., i].ravel(), minlength=NUM_ROBOTS)
        assert len(counts) == NUM_ROBOTS
        drawn = counts if probability == 1.0 else np.delete(counts, i)
        assert stats.chisquare(drawn).pvalue > 1e-4


@pytest.mark.parametrize("probability", [0.06, 0.5])
def test_iv_c_frequency_of_flooding_is_the_probability(probability):
    """A robot addresses another with probability p (N - 1) / N."""
    sending = is_sending(flooded(probability, 2000))
    expected = probability * (NUM_ROBOTS - 1) / NUM_ROBOTS
    assert is_about(sending.mean(axis=(0, 1)), expected, 4000)


def test_iv_c_robots_missions_and_half_windows_draw_apart():
    sending = is_sending(flooded(0.5, 3000)).reshape(3000, -1)
    correlation = np.corrcoef(np.vstack([sending[1:].T, sending[:-1].T]))
    np.testing.assert_allclose(correlation, np.eye(len(correlation)), atol=5 / math.sqrt(3000))


def test_iv_c_a_packet_is_a_broadcast_unless_the_rule_is_the_authors():
    """The same robots transmit, whether packets name whom they are for or not."""
    named, broadcast = flooded(0.5, 100), flooded(0.5, 100, named=False)
    silence = np.broadcast_to(np.arange(NUM_ROBOTS), named.shape)
    np.testing.assert_array_equal(broadcast, np.where(is_sending(named), BROADCAST, silence))


@pytest.mark.parametrize(("preset", "is_named"), [(paper, False), (reference, True)])
def test_packets_name_their_addressees_in_the_reference_preset_only(preset, is_named):
    """Where a robot that is addressed hears while it sends, and L is noted (Eq. 7)."""
    swarm = Swarm(preset("stationary", num_robots=6), [1])
    policy = make_policy("random-flooding", swarm.mission, 0.9)
    num_packets = 0
    for _ in range(20):
        num_packets += swarm.step(policy).packets.sent[0]
        recipient = np.stack([phase.recipient for phase in swarm.phases])
        assert np.any(recipient == BROADCAST) != is_named
    assert np.any(swarm.buffers.last_attempt) == is_named
    assert num_packets > 100


# Slotted ALOHA.


@given(seed=st.integers(0, 2**32 - 1), num_robots=st.integers(2, 12))
def test_contenders_are_counted_in_each_robots_own_beliefs(seed, num_robots):
    rng = np.random.default_rng(seed)
    position_m = rng.uniform(-300, 300, size=(2, num_robots, num_robots, 2))
    is_known = rng.random((2, num_robots, num_robots)) < 0.6
    found = num_contenders(is_known, position_m, RANGE_M)
    for b, i in np.ndindex(2, num_robots):
        known = [j for j in range(num_robots) if is_known[b, i, j] or j == i]
        near = [j for j in known if math.dist(position_m[b, i, i], position_m[b, i, j]) <= RANGE_M]
        assert found[b, i] == pytest.approx(num_robots * len(near) / len(known))


@pytest.mark.parametrize("num_robots", [2, 7])
@pytest.mark.parametrize("probability", [0.0, 0.3, 0.9, 1.0])
def test_a_neighbourhood_is_heard_with_the_probability(probability, num_robots):
    """However many there are, somebody sends with p; at 0 nobody does, at 1 everybody."""
    policy = started(Aloha(probability, range_m=RANGE_M), 4000, num_robots)
    sending = policy.transmits(everyone_near(4000, num_robots))
    if probability in (0.0, 1.0):
        assert np.all(sending == probability)
    else:
        assert is_about(np.mean(np.any(sending, axis=1)), probability, 4000)


# Innovation gossip.


def gossip(probability, num_missions=1):
    return started(InnovationGossip(probability), num_missions, num_robots=4)


def is_telling(policy, timestamp):
    """Who broadcasts, with these T [mission, robot, about]."""
    return policy.transmits(views_of(np.asarray(timestamp, dtype=float)))


def test_robots_with_news_enough_broadcast_for_certain_and_then_rest():
    """At p = 0.5 news of 2 windows are certain: 8 windows in all, over a team of 4.

    Later news count from a robot's own last broadcast; a new mission forgets what was sent.
    """
    policy = gossip(0.5)
    first = [[[2, 2, 2, 2], [0, 0, 0, 0], [8, 0, 0, 0], [0, 0, 0, 0]]]
    later = [[[2, 2, 2, 2], [0, 9, 0, 0], [8, 3, 3, 2], [0, 0, 0, 0]]]
    assert is_telling(policy, first).tolist() == [[True, False, True, False]]
    for _ in range(100):
        assert not np.any(is_telling(policy, first))
    assert is_telling(policy, later).tolist() == [[False, True, True, False]]
    policy.start(4, [np.random.default_rng(1)])
    assert is_telling(policy, first).tolist() == [[True, False, True, False]]


@pytest.mark.parametrize("news", [0.5, 3.0])
def test_chance_is_the_probability_times_the_news(news):
    timestamp = np.zeros((2000, 4, 4))
    timestamp[:, :, 1] = news * 4  # about one teammate: the mean counts
    assert is_about(np.mean(is_telling(gossip(0.1, 2000), timestamp)), 0.1 * news, 8000)


def test_news_add_up_until_they_are_sent():
    """With one window of news a step at p = 0.1, 0.9 · 0.8 · 0.7 of 8000 are silent for three."""
    policy, has_sent = gossip(0.1, 2000), np.zeros((2000, 4), dtype=bool)
    for window in (1.0, 2.0, 3.0):
        has_sent |= is_telling(policy, np.full((2000, 4, 4), window))
    assert is_about(np.mean(~has_sent), 0.504, 8000)
