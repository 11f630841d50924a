"""Evaluations on held-out missions: the same for the same weights, and no trace of them."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import small_training
from tiny_policies import tiny_network

from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED
from swarm_mj.learning.held_out import evaluate, held_out_policy
from swarm_mj.learning.settings import HELD_OUT_SEED
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

NETWORK = tiny_network("extended")


def flown(training, size, seed):
    """One held-out mission on its own, by the library's flight."""
    mission = replace(training.mission, num_robots=size)
    swarm = Swarm(mission, [seed])
    windows = list(rollout(swarm, held_out_policy(training, NETWORK, mission)))
    return summarise(windows), [float(w.costs.age_windows[0]) for w in windows]


@pytest.mark.parametrize("sizes", [(5,), (3, 6)])
def test_means_are_those_of_the_missions_flown_one_by_one(sizes):
    training = replace(small_training(sizes=sizes, held_out=3), silence_logit=1.0)
    found = evaluate(training, NETWORK)
    ages, steady, errors, objectives, attempted, delivered = [], [], [], [], 0.0, 0.0
    for size in sizes:
        flights = [flown(training, size, HELD_OUT_SEED + b) for b in range(3)]
        mean = [summary.aoi_mean[0] for summary, _ in flights]
        ages.append(sum(mean) / 3)
        objectives.append(sum(mean) / 3 / size)
        steady.append(sum(sum(age[10:]) / 10 for _, age in flights) / 3)
        errors.append(np.std(mean, ddof=1) / np.sqrt(3))
        attempted += sum(summary.packets_attempted[0] for summary, _ in flights)
        delivered += sum(summary.packets_delivered[0] for summary, _ in flights)
    assert found.aoi == pytest.approx(sum(ages) / len(sizes))
    assert found.aoi_steady == pytest.approx(sum(steady) / len(sizes))
    assert found.aoi_sem == pytest.approx(np.sqrt(sum(e**2 for e in errors)) / len(sizes))
    assert found.objective == pytest.approx(sum(objectives) / len(sizes))
    assert found.packets_per_window == pytest.approx(attempted / (len(sizes) * 3 * 20))
    assert found.delivery_ratio == pytest.approx(delivered / attempted)
    assert attempted > 0


def test_eq17_flocks_are_judged_by_their_velocity_variance():
    its = {"features": "extended", "network": NETWORK.shape}
    training = small_training("team", "flocking", reward="velocity-variance", **its)
    found = evaluate(training, NETWORK)
    variance = [
        flown(training, 5, HELD_OUT_SEED + b)[0].velocity_variance_mean[0] for b in range(2)
    ]
    assert found.velocity_variance == pytest.approx(sum(variance) / 2)
    assert found.objective == found.velocity_variance > 0.0


def test_global_random_states_do_not_matter_and_are_left_alone():
    training, results = small_training(), []
    for seed in (1, 2):
        torch.manual_seed(seed)
        np.random.seed(seed)  # noqa: NPY002
        before = torch.get_rng_state(), np.random.get_state()  # noqa: NPY002
        results.append(evaluate(training, NETWORK))
        assert torch.equal(torch.get_rng_state(), before[0])
        after = np.random.get_state()  # noqa: NPY002
        assert all(np.array_equal(a, b) for a, b in zip(after, before[1], strict=True))
    assert results[0] == results[1]


def test_the_seed_of_the_training_does_not_change_the_missions():
    assert evaluate(small_training(seed=1), NETWORK) == evaluate(small_training(seed=2), NETWORK)
    assert HELD_OUT_SEED + 10_000 < FIRST_TRAINING_SEED


def test_one_mission_has_no_error():
    found = evaluate(small_training(held_out=1), NETWORK)
    assert found.aoi_sem is None


def test_whoever_watches_hears_every_window_and_may_break_off():
    shares = []
    evaluate(small_training(sizes=(3, 6)), NETWORK, shares.append)
    np.testing.assert_allclose(shares, np.arange(1, 41) / 40)

    def enough(share):
        if share > 0.1:
            raise InterruptedError

    with pytest.raises(InterruptedError):
        evaluate(small_training(), NETWORK, enough)
