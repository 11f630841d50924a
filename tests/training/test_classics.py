import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.radio.links import links_between
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.simulation.swarm import Swarm
from training.classics import AgeDebt, AgeDifference, AgeThresholdAloha, heaviest

LINE_M = np.array([[0.0, 0.0], [200.0, 0.0], [400.0, 0.0]])  # neighbours are in range, ends not


@pytest.fixture(scope="module")
def mission():
    return paper("stationary", num_robots=3)


def links(mission):
    return links_between(radio_of(mission), LINE_M)


def test_the_sender_with_the_largest_age_difference_goes_alone(mission):
    """The middle would be jammed by both ends, and it serves both: 3 + 3 above 5."""
    gain = np.array([[0.0, 5.0, 9.0], [3.0, 0.0, 3.0], [9.0, 1.0, 0.0]])
    assert heaviest(gain, links(mission)).tolist() == [False, True, False]
    gain[0, 1] = 7.0  # that of r0 to r1 now outweighs them; r2 is out of r0's range
    assert heaviest(gain, links(mission)).tolist() == [True, False, False]


def test_age_difference_lets_a_relay_gather_before_it_forwards(mission):
    """On a line of three the ends send first, then the middle serves both in one packet."""
    swarm, policy = Swarm(mission, [1]), AgeDifference(mission)
    swarm._physics.place(LINE_M[None], np.zeros((1, 3, 2)))
    sends = []
    for _ in range(60):
        swarm.step(policy)
        sends += [np.flatnonzero(p.recipient[0] != np.arange(3)).tolist() for p in swarm.phases]
    assert sends[-6:] == sends[-3:] * 2
    assert sorted(sends[-3:]) == [[0], [1], [2]]


def test_no_pair_s_mean_age_exceeds_the_target_by_more_than_its_debt_over_time():
    """The queue's law, of which stability follows: the sum of ages <= target t + Q(t)."""
    mission = paper("random-walk", num_robots=8, num_windows=80)
    swarm, policy = Swarm(mission, [1, 2]), AgeDebt(mission, target=3.0)
    total, num_slots = np.zeros((2, 8, 8)), 0
    seen = policy.weights

    def watched(age):
        nonlocal total, num_slots
        total, num_slots = total + age, num_slots + 1
        return seen(age)

    policy.weights = watched
    for _ in range(mission.num_windows):
        swarm.step(policy)
    assert num_slots == 160
    assert np.all(total <= 3.0 * num_slots + policy.debt + 1e-9)
    assert np.any(policy.debt == 0.0)  # some targets are met, so the law is no empty one


def test_debt_prefers_the_pair_that_was_neglected(mission):
    policy = AgeDebt(mission, target=5.0)
    policy.start(3, [np.random.default_rng(1)])
    age = np.array([[[0.0, 8.0, 5.0], [4.0, 0.0, 20.0], [5.0, 5.0, 0.0]]])
    policy.weights(age)
    assert policy.weights(age)[0].tolist() == [[0, 6, 0], [0, 0, 30], [0, 0, 0]]


@pytest.mark.parametrize(("threshold", "probability"), [(0, 0.2), (10, 0.2), (10, 1.0)])
def test_gaps_are_a_silence_and_a_geometric_wait(threshold, probability):
    """The age of a lone link follows from E[D] and E[D²] of the gaps D, as in the paper's Eq. 5."""
    mission = paper("stationary", num_robots=40, num_windows=400)
    policy, swarm = AgeThresholdAloha(mission, (threshold, probability)), Swarm(mission, [1, 2])
    sends = []
    for _ in range(mission.num_windows):
        swarm.step(policy)
        sends += [phase.recipient != np.arange(40) for phase in swarm.phases]
    sends = np.array(sends).reshape(800, 80)
    gaps = np.concatenate([np.diff(np.flatnonzero(its)) for its in sends.T])
    silence = max(threshold, 1)  # a gap is at least a slot
    assert gaps.min() == silence
    assert np.mean(gaps) == pytest.approx(silence - 1 + 1 / probability, rel=0.04)
    deviation = np.sqrt(1 - probability) / probability
    assert np.std(gaps) == pytest.approx(deviation, rel=0.08, abs=1e-9)


def test_thresholds_halve_the_age_at_equal_rates():
    """The paper's gain: a link that sends every D slots is (D - 1) / 2 old, at random D - 1."""
    gap = 12
    regular = np.arange(gap)  # ages between two packets, p = 1
    at_random = np.arange(4000) * (1 - 1 / gap) ** np.arange(4000) / gap
    assert np.mean(regular) / at_random.sum() == pytest.approx(0.5)
