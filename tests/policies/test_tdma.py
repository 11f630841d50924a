import numpy as np
import pytest
from scipy import stats

from swarm_mj.mission import paper
from swarm_mj.policies.tdma import Tdma
from swarm_mj.protocol.buffers import BROADCAST, empty_buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.protocol.window import SLOT_WINDOWS
from swarm_mj.simulation.swarm import Swarm

NUM_ROBOTS = 6


def decided(num_slots, num_missions=2, num_robots=NUM_ROBOTS):
    """Who transmits [slot, mission, robot]."""
    policy = Tdma()
    policy.start(num_robots, [np.random.default_rng((7, b)) for b in range(num_missions)])
    buffers = empty_buffers(num_missions, num_robots)
    return np.stack(
        [
            policy.transmits(
                LocalViews(
                    buffers=buffers, now=np.full(num_missions, slot * SLOT_WINDOWS), phases=()
                )
            )
            for slot in range(num_slots)
        ]
    )


def speakers(is_sending):
    """The one robot that transmits [slot, mission]."""
    assert np.all(np.sum(is_sending, axis=-1) == 1)
    return np.argmax(is_sending, axis=-1)


def test_everyone_broadcasts_once_a_round_in_the_same_order():
    speaking = speakers(decided(3 * NUM_ROBOTS))
    for b in range(2):
        rounds = speaking[:, b].reshape(3, NUM_ROBOTS)
        assert sorted(rounds[0]) == list(range(NUM_ROBOTS))
        np.testing.assert_array_equal(rounds[1:], [rounds[0]] * 2)


def test_orders_are_drawn_alike_from_each_missions_own_numbers():
    """The robot that begins is uniform over the team, and missions do not depend on each other."""
    first = speakers(decided(1, num_missions=1200))[0]
    assert stats.chisquare(np.bincount(first, minlength=NUM_ROBOTS)).pvalue > 1e-4
    np.testing.assert_array_equal(decided(9, 3)[:, :1], decided(9, 1))


@pytest.mark.parametrize("num_robots", [2, 5, 8])
def test_age_of_a_fully_connected_team_is_its_closed_form(num_robots):
    """Whoever spoke is as old, at the N - 1 others, as the slots since.

    After h >= N of them those are 0, 1, ..., N - 1 for the N robots, together N (N - 1) / 2 slots
    of 0.5. Over all N² pairs, own ages of 0 included, that is (N - 1)² / (4 N): 0.8 windows
    for 5 robots. Earlier, the h that spoke are 0, ..., h - 1 old, the other N - h are h old.
    """
    mission = paper("stationary", num_robots=num_robots, range_ratio=10.0)
    swarm, policy = Swarm(mission, [1, 2]), Tdma()
    for window in range(1, 30):
        h = 2 * window
        if h >= num_robots:
            expected = (num_robots - 1) ** 2 / (4 * num_robots)
        else:
            halves_old = h * (h - 1) / 2 + (num_robots - h) * h
            expected = 0.5 * halves_old * (num_robots - 1) / num_robots**2
        np.testing.assert_allclose(swarm.step(policy).age_windows, expected, rtol=1e-12)


def test_nobody_is_interfered_with():
    """Whoever is in range of the speaker decodes it, in the first slot as in any."""
    swarm, policy = Swarm(paper("stationary", num_robots=20), [3]), Tdma()
    position_m = swarm.states.position_m[0]
    for _ in range(20):
        swarm.step(policy)
        for phase in swarm.phases:
            (speaker,) = speakers(phase.recipient == BROADCAST)
            distance_m = np.hypot(*(position_m - position_m[speaker]).T)
            expected = np.where(distance_m <= swarm.mission.range_m, speaker, np.arange(20))
            np.testing.assert_array_equal(phase.heard[0], expected)
