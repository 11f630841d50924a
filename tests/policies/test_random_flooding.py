import math

import numpy as np
import pytest
from scipy import stats

from swarm_mj.mission import paper, reference
from swarm_mj.policies.random_flooding import RandomFlooding
from swarm_mj.policies.registry import make_policy
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.simulation.swarm import Swarm

NUM_ROBOTS = 6


def decided(probability, num_slots, num_missions=2, num_robots=NUM_ROBOTS, *, named=True):
    """Whom everyone addresses [slot, mission, robot]."""
    policy = RandomFlooding(probability, names_addressee=named)
    policy.start(num_robots, [np.random.default_rng((7, b)) for b in range(num_missions)])
    views = LocalViews(
        buffers=empty_buffers(num_missions, num_robots), now=np.zeros(num_missions), phases=()
    )
    return np.stack([policy.recipients(views) for _ in range(num_slots)])


def is_sending(recipient):
    return recipient != np.arange(recipient.shape[-1])


def test_iv_c_probability_1_addresses_the_whole_team_alike():
    """As in the authors' code the recipient is uniform over all N, so 1 in N is silence."""
    recipient = decided(1.0, 2000)
    for i in range(NUM_ROBOTS):
        counts = np.bincount(recipient[..., i].ravel(), minlength=NUM_ROBOTS)
        assert len(counts) == NUM_ROBOTS
        assert stats.chisquare(counts).pvalue > 1e-4


@pytest.mark.parametrize("probability", [0.06, 0.5])
def test_iv_c_frequency_is_the_probability(probability):
    """A robot addresses another with probability p (N - 1) / N: within 5 standard deviations."""
    sending = is_sending(decided(probability, 2000))
    expected = probability * (NUM_ROBOTS - 1) / NUM_ROBOTS
    num_draws = sending.shape[0] * sending.shape[1]
    for i in range(NUM_ROBOTS):
        off = abs(np.mean(sending[..., i]) - expected)
        assert off < 5 * math.sqrt(expected * (1 - expected) / num_draws)


def test_iv_c_recipient_does_not_depend_on_whether_a_robot_sends():
    """Among packets at p = 0.3 the recipients are as uniform as at p = 1."""
    recipient = decided(0.3, 4000)
    for i in range(NUM_ROBOTS):
        counts = np.bincount(recipient[..., i].ravel(), minlength=NUM_ROBOTS)
        assert stats.chisquare(np.delete(counts, i)).pvalue > 1e-4


def test_iv_c_robots_missions_and_half_windows_draw_apart():
    sending = is_sending(decided(0.5, 3000)).reshape(3000, -1)
    correlation = np.corrcoef(np.vstack([sending[1:].T, sending[:-1].T]))
    np.testing.assert_allclose(correlation, np.eye(len(correlation)), atol=5 / math.sqrt(3000))


def test_iv_c_a_packet_is_a_broadcast_unless_the_rule_is_the_authors():
    """The same robots transmit, whether packets name whom they are for or not."""
    named, broadcast = decided(0.5, 100), decided(0.5, 100, named=False)
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
