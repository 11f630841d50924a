import copy

import numpy as np
import pytest
from residual_networks import silent_weights, some_weights

from swarm_mj.mission import paper, reference
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.residual.making import residual_policy
from swarm_mj.policies.residual.network import Weights
from swarm_mj.swarm import Swarm

REST = paper("stationary", num_robots=8, range_ratio=0.3)
LOSSY = paper("stationary", num_robots=8, range_ratio=0.3, erasure=0.3)
EVERYONE = np.arange(8)


def transmitters(mission, policy, seeds=(1, 2), num_windows=40):
    """Who transmits in each slot [slot, mission, robot]."""
    swarm, rows = Swarm(mission, list(seeds)), []
    swarm.start(policy)
    for _ in range(num_windows):
        swarm.step(policy)
        rows += [phase.recipient != EVERYONE for phase in swarm.phases]
    return np.array(rows)


@pytest.mark.parametrize("corrects_turns", [False, True])
@pytest.mark.parametrize("mission", [REST, LOSSY])
def test_a_network_that_says_nothing_leaves_the_plan_as_it_is(mission, corrects_turns):
    weights = silent_weights(corrects_turns=corrects_turns)
    flown = transmitters(mission, residual_policy(weights, mission, is_deterministic=True))
    planned = transmitters(mission, make_policy("planner --payload none", mission))
    np.testing.assert_array_equal(flown, planned)


class Apart(BroadcastPolicy):
    """A flight in which some robots are also asked apart, by their own views and packets alone."""

    uses = "its buffer"

    def __init__(self, weights, mission, robots):
        self.policy = residual_policy(weights, mission)
        self.minds = {i: residual_policy(weights, mission) for i in robots}
        self.num_corrected = 0

    def start(self, num_robots, rngs):
        for mind in self.minds.values():
            mind.start(num_robots, copy.deepcopy(rngs))
        self.policy.start(num_robots, rngs)

    def transmits(self, views):
        decided = self.policy.decide(views)
        for i, mind in self.minds.items():
            alone = mind.decide(self.as_seen_by(i, views))
            np.testing.assert_array_equal(decided.transmits[:, i], alone.transmits[:, i])
            its, same = (each.logit[each.rows[:, 1] == i] for each in (decided, alone))
            np.testing.assert_allclose(its, same, rtol=1e-4, atol=1e-5)
        self.num_corrected += np.sum(decided.transmits != decided.proposal.transmits)
        return decided.transmits

    @staticmethod
    def as_seen_by(i, views):
        """All that is not robot i's is lost, but T of whom it decoded in the last slot."""
        seen, others = copy.deepcopy(views), np.arange(views.num_robots) != i
        for array in vars(seen.buffers).values():
            array[:, others] = 0
        for phase in seen.phases:
            phase.heard[:, others] = phase.recipient[:, others] = EVERYONE[others]
        if seen.phases:
            for b, sender in enumerate(seen.phases[-1].heard[:, i]):
                seen.buffers.timestamp[b, sender] = views.buffers.timestamp[b, sender]
        return seen


@pytest.mark.parametrize("preset", [paper, reference])
@pytest.mark.parametrize("corrects_turns", [False, True])
def test_eq9_robots_decide_by_their_buffers_and_by_t_in_packets(preset, corrects_turns):
    mission = preset("stationary", num_robots=8, range_ratio=0.3, erasure=0.2)
    swarm = Swarm(mission, [1, 2])
    apart = Apart(some_weights(corrects_turns=corrects_turns), mission, [0, 5])
    swarm.start(apart)
    for _ in range(40):
        swarm.step(apart)
    assert apart.num_corrected > 100


def test_the_same_seed_is_the_same_flight_whatever_flies_beside():
    beside = transmitters(LOSSY, residual_policy(some_weights(), LOSSY), [5, 6])
    alone = transmitters(LOSSY, residual_policy(some_weights(), LOSSY), [6])
    np.testing.assert_array_equal(beside[:, 1:], alone)
    assert np.any(alone != beside[:, :1])


def test_a_policy_that_has_flown_flies_again_as_if_it_were_new():
    policy = residual_policy(some_weights(), LOSSY)
    transmitters(LOSSY, policy, [3, 4])
    again = transmitters(LOSSY, policy)
    np.testing.assert_array_equal(
        again, transmitters(LOSSY, residual_policy(some_weights(), LOSSY))
    )


@pytest.mark.parametrize("corrects_turns", [False, True])
def test_turns_are_corrected_only_by_a_network_that_may(corrects_turns):
    """By one that always says transmit. The first slots are everyone's turns."""
    weights = silent_weights(corrects_turns=corrects_turns)
    weights.arrays["logit.bias"][...] = 50.0
    policy, swarm = residual_policy(weights, REST), Swarm(REST, [1])
    swarm.start(policy)
    first = policy.decide(swarm.views)
    assert len(first.rows) == len(first.logit) == (8 if corrects_turns else 0)
    assert np.sum(first.proposal.transmits) == 1
    assert np.sum(first.transmits) == (8 if corrects_turns else 1)


def constant(logit, trust=0.0):
    """A network that always says the same."""
    weights = silent_weights(corrects_turns=True)
    weights.arrays["logit.bias"][...] = logit
    return Weights(weights.arrays, trust, weights.corrects_turns)


@pytest.mark.parametrize(("logit", "probability"), [(-1.0, 0.2689), (0.0, 0.5), (2.0, 0.8808)])
def test_robots_transmit_with_the_probability_of_their_logit(logit, probability):
    """1 / (1 + exp(-logit)): 2 missions of 8 robots and 160 slots, within 5 deviations."""
    flown = transmitters(LOSSY, residual_policy(constant(logit), LOSSY), num_windows=80)
    spread = np.sqrt(probability * (1.0 - probability) / flown.size)
    assert abs(np.mean(flown) - probability) < 5.0 * spread
    shares = np.mean(flown, axis=0)  # each robot draws for itself
    assert np.all(np.abs(shares - probability) < 5.0 * np.sqrt(flown.size / len(flown)) * spread)
    assert np.all(np.any(flown != flown[:, :, :1], axis=(0, 1))[1:])


def test_deterministic_robots_do_what_is_likelier():
    for logit, share in [(-0.01, 0.0), (0.01, 1.0)]:
        policy = residual_policy(constant(logit), LOSSY, is_deterministic=True)
        assert np.mean(transmitters(LOSSY, policy, num_windows=5)) == share


def test_the_digest_changes_with_anything_that_a_file_holds_but_its_card():
    weights = some_weights()

    def said(network=weights, **options):
        return residual_policy(network, REST, **options).parameters

    first, digests = said(), set()
    assert said() == first
    assert said(is_deterministic=True) == first | {"is_deterministic": True}
    for array in weights.arrays.values():
        last = array.reshape(-1)[-1]
        array.reshape(-1)[-1] += 0.5
        digests.add(said()["digest"])
        array.reshape(-1)[-1] = last
    assert said() == first
    arrays, trust = weights.arrays, weights.trust
    for other in (Weights(arrays, trust + 1.0, False), Weights(arrays, trust, True)):
        digests.add(said(other)["digest"])
    assert len(digests - {first["digest"]}) == len(arrays) + 2


def test_robots_remember_the_slots_in_which_they_sent_and_decoded():
    """Slots are counted from 1; of the last slot of the flight they have not been told."""
    swarm, policy = Swarm(LOSSY, [1, 2]), residual_policy(some_weights(), LOSSY)
    swarm.start(policy)
    sent, decoded = np.zeros((2, 8)), np.zeros((2, 8, 8))
    phases = [phase for _ in range(20) if swarm.step(policy) for phase in swarm.phases]
    for slot, phase in enumerate(phases[:-1], start=1):
        for b in range(2):
            for i in range(8):
                if phase.recipient[b, i] != i:
                    sent[b, i] = slot
                if phase.heard[b, i] != i:
                    decoded[b, i, phase.heard[b, i]] = slot
    np.testing.assert_array_equal(policy._beliefs.sent, sent)
    np.testing.assert_array_equal(policy._beliefs.decoded, decoded)
    np.testing.assert_array_equal(policy._beliefs.heard, np.max(decoded, axis=2))


def test_the_network_sees_those_in_range_that_a_robot_has_heard_of():
    swarm, talk = Swarm(LOSSY, [1]), make_policy("tdma", LOSSY)
    policy = residual_policy(constant(0.0), LOSSY)
    swarm.start(talk)
    place_m = swarm.states.position_m[0]
    apart_m = np.linalg.norm(place_m[:, None] - place_m, axis=2)
    num_seen = []
    for _ in range(12):
        is_near = (apart_m <= LOSSY.range_m) & swarm.buffers.is_known[0] & ~np.eye(8, dtype=bool)
        policy.start(8, [np.random.default_rng(1)])
        seen = policy.decide(swarm.views).seen
        assert np.bincount(seen.owner, minlength=8).tolist() == np.sum(is_near, axis=1).tolist()
        num_seen.append(len(seen.owner))
        swarm.step(talk)
    assert num_seen[0] == 0
    assert num_seen[-1] > 10


def test_packets_that_hold_a_part_of_t_tell_nothing_of_what_their_senders_know():
    slow = paper("stationary", num_robots=8, range_ratio=0.3, bit_rate=5_000.0)
    strange = reference("stationary", num_robots=8, range_ratio=0.3)
    for mission, tells in ((slow, False), (strange, False), (REST, True)):
        policy = residual_policy(silent_weights(), mission)
        transmitters(mission, policy, num_windows=20)
        assert np.any(policy._beliefs.decoded > 0) == tells
