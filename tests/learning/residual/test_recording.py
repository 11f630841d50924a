"""Lessons, against missions that are flown again with one decision changed."""

import numpy as np
import pytest
import torch
from broadcast_scripts import flown

from swarm_mj.learning.residual.network import ResidualNetwork
from swarm_mj.learning.residual.recording import LIKELY, Recorder, lesson
from swarm_mj.mission import paper
from swarm_mj.policies.residual.policy import ResidualPolicy
from swarm_mj.policies.residual.resting_rule import RestingRule
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.rollout import rollout
from swarm_mj.swarm import Swarm

NUM_SLOTS, NUM_ROBOTS, HORIZON = 40, 6, 12
SEEDS = [1, 2]


def a_mission(**channel):
    return paper("stationary", num_robots=NUM_ROBOTS, num_windows=NUM_SLOTS // 2, **channel)


def weights(trust=1.0, says=0.7):
    """Of a network that often contradicts the rule, unless it says nothing."""
    torch.manual_seed(0)
    network = ResidualNetwork(4, trust)
    torch.nn.init.normal_(network.logit.weight, std=says)
    return network.weights(corrects_turns=False)


def a_policy(mission, of, kind=Recorder):
    return kind(of, RestingRule(radio_of(mission)), radio_of(mission))


def taught(mission, of, seed=7, share=1.0):
    """A lesson, what it is of, and the mean age."""
    swarm, policy = Swarm(mission, SEEDS), a_policy(mission, of)
    rng = np.random.default_rng(seed)
    return (*lesson(swarm, policy, rng, share=share, horizon=HORIZON), policy.decisions)


def of_each_row(decisions):
    """Slot, mission and robot of every decision that is far enough from the end."""
    slots = decisions[: NUM_SLOTS - HORIZON // 2]
    return np.array([(s, *row) for s, decision in enumerate(slots) for row in decision.rows])


@pytest.mark.parametrize(
    "channel", [{}, {"fading": "rayleigh", "erasure": 0.1}, {"switched_off": 0.4}], ids=str
)
def test_a_worth_is_what_transmitting_takes_from_the_mean_age(channel):
    """The rest of the script stays as it was decided; worths add up over the slots counted."""
    mission = a_mission(**channel)
    learned, _, decisions = taught(mission, weights())
    rows, script = of_each_row(decisions), np.stack([each.transmits for each in decisions])
    assert len(learned.worth) == len(rows)
    picked = np.random.default_rng(1).choice(len(rows), 30, replace=False)
    slot, of, robot = rows[picked].T
    both = np.concatenate([script[:, of], script[:, of]], axis=1)
    number = np.arange(len(picked))
    both[slot, number, robot] = True
    both[slot, len(picked) + number, robot] = False
    everyone = [*of, *of]
    rngs = None
    if "fading" in channel:
        rngs = [np.random.default_rng(7).spawn(2)[b] for b in everyone]
    observed, _ = flown(mission, [SEEDS[b] for b in everyone], both, rngs)
    gained = observed[:, : len(picked)].astype(int) - observed[:, len(picked) :]
    expected = [gained[s + 1 : s + 1 + HORIZON, n].sum() for n, s in enumerate(slot)]
    np.testing.assert_allclose(learned.worth[picked], np.array(expected) / NUM_ROBOTS**2, rtol=1e-6)
    transmitted = script[slot, of, robot]
    for did in (False, True):
        assert np.any(learned.worth[picked][transmitted == did] != 0.0)
    assert np.any(learned.worth[picked] > 0.0)


def test_what_was_seen_is_what_was_decided_on():
    """Row by row, and neighbour by neighbour."""
    learned, _, decisions = taught(a_mission(), weights())
    slots = decisions[: NUM_SLOTS - HORIZON // 2]
    np.testing.assert_array_equal(learned.logit, np.concatenate([each.logit for each in slots]))
    np.testing.assert_allclose(weights().logits(learned.seen), learned.logit, rtol=1e-4, atol=1e-5)
    assert np.all(learned.weight == 1.0)


def test_of_decisions_that_were_never_in_doubt_a_share_stands_for_all():
    mission, of = a_mission(), weights(trust=5.0, says=0.5)
    all_of_it, _, decisions = taught(mission, of)
    rows = of_each_row(decisions)
    did = np.array([decisions[s].transmits[b, i] for s, b, i in rows])
    is_silent = ~did & (all_of_it.seen.robots[:, 0] < 0.0)
    odds = np.exp(all_of_it.logit)
    is_sure = is_silent & (odds / (1.0 + odds) <= LIKELY)
    assert 20 < np.count_nonzero(is_sure) < len(rows) - 20

    learned, _, _ = taught(mission, of, share=0.25)
    assert set(learned.weight) == {1.0, 4.0}
    found = learned.weight == 1.0
    for part in ("logit", "worth"):
        np.testing.assert_array_equal(
            getattr(learned, part)[found], getattr(all_of_it, part)[~is_sure]
        )
    share = np.count_nonzero(~found) / np.count_nonzero(is_sure)
    assert 0.1 < share < 0.4
    np.testing.assert_allclose(of.logits(learned.seen), learned.logit, rtol=1e-4, atol=1e-5)


def flat(learned):
    return [*learned.seen, *learned[1:]]


@pytest.mark.parametrize("channel", [{}, {"fading": "rayleigh"}], ids=str)
def test_the_same_generator_teaches_the_same(channel):
    mission, of = a_mission(**channel), weights(trust=5.0, says=0.5)
    one, again = (taught(mission, of, share=0.5)[0] for _ in range(2))
    for ours, theirs in zip(flat(one), flat(again), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    other = taught(mission, of, seed=8, share=0.5)[0]
    assert one.logit.tolist() != other.logit.tolist()


def test_where_the_channel_draws_another_generator_flies_other_missions():
    """In the same places, by the same policy."""
    mission = a_mission(fading="rayleigh")
    ages = [taught(mission, weights(), seed=seed)[1] for seed in (7, 8, 7)]
    assert ages[0] == ages[2] != ages[1]


def test_a_recorder_decides_as_the_policy_that_it_records():
    mission, of = a_mission(switched_off=0.4), weights()
    _, age, _ = taught(mission, of)
    windows = rollout(Swarm(mission, SEEDS), a_policy(mission, of, ResidualPolicy))
    assert age == pytest.approx(np.mean([window.costs.age_windows for window in windows]))


def test_whoever_is_switched_off_has_nothing_to_gain():
    mission = a_mission(switched_off=0.4)
    learned, _, decisions = taught(mission, weights())
    swarm = Swarm(mission, SEEDS)
    list(rollout(swarm, a_policy(mission, weights(), ResidualPolicy)))
    slot, of, robot = of_each_row(decisions).T
    is_off = (slot >= NUM_SLOTS // 2) & ~swarm.states.is_active[of, robot]
    assert np.count_nonzero(is_off) > 10
    assert np.all(learned.worth[is_off] == 0.0)
    assert np.any(learned.worth[(slot >= NUM_SLOTS // 2) & ~is_off] != 0.0)
