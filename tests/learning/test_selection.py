"""The choice at the end: on missions of its own, told on others, against hand-written policies."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import small_training
from tiny_policies import tiny_network

from swarm_mj.learning.choice import CHOICE_SEED, TEST_SEED
from swarm_mj.learning.held_out import held_out_policy
from swarm_mj.learning.selection import choose
from swarm_mj.policies.registry import make_policy
from swarm_mj.rollout import rollout, summarise
from swarm_mj.swarm import Swarm

TRAINING = replace(small_training(held_out=3), silence_logit=1.0)


def network(bias):
    """One that is silent the more the larger the bias of a robot's own turn is."""
    made = tiny_network("extended")
    torch.manual_seed(bias)
    for weight in made.parameters():
        weight.data += 0.5 * torch.randn_like(weight)
    return made


NETWORKS = {0: network(1), 64: network(2), 128: network(3)}
CURVE = [{"decisions": float(at), "objective": 1.0} for at in NETWORKS]


def ages(policy, first):
    """Of 3 missions, by the library's flights, one by one."""
    swarms = [Swarm(TRAINING.mission, [seed]) for seed in range(first, first + 3)]
    return np.array([summarise(rollout(swarm, policy)).aoi_mean[0] for swarm in swarms])


def flies(made):
    return held_out_policy(TRAINING, made, TRAINING.mission)


def test_the_least_cost_on_fresh_missions_is_chosen_and_told_on_others():
    choice, costs = choose(TRAINING, CURVE, NETWORKS, lambda _share: None)
    judged = {at: ages(flies(made), CHOICE_SEED).mean() for at, made in NETWORKS.items()}
    assert len(set(judged.values())) == 3
    assert choice.decisions == min(judged, key=judged.__getitem__)
    told = ages(flies(NETWORKS[choice.decisions]), TEST_SEED)
    assert choice.kept.mean == pytest.approx(told.mean()) == pytest.approx(costs.aoi)
    assert choice.kept.sem == pytest.approx(told.std(ddof=1) / np.sqrt(3))
    assert (choice.num_finalists, choice.num_missions, choice.run_decisions) == (3, 3, 128)
    for name in ("tdma", "spatial-tdma"):
        other = ages(make_policy(name, TRAINING.mission), TEST_SEED)
        behind = told - other
        cost = choice.others[name]
        assert cost.mean == pytest.approx(other.mean())
        assert cost.behind == pytest.approx(behind.mean())
        assert cost.behind_sem == pytest.approx(behind.std(ddof=1) / np.sqrt(3))


def test_the_first_flies_beside_what_was_chosen_if_it_is_another():
    worse = [CURVE[0] | {"objective": 9.0}, CURVE[1], CURVE[2] | {"objective": 9.0}]
    choice, _ = choose(TRAINING, worse, NETWORKS, lambda _share: None)
    assert (choice.decisions, choice.num_finalists) == (64, 1)
    first = ages(flies(NETWORKS[0]), TEST_SEED)
    assert choice.others["first"].mean == pytest.approx(first.mean())
    only, _ = choose(TRAINING, CURVE[:1], NETWORKS, lambda _share: None)
    assert set(only.others) == {"tdma", "spatial-tdma"}
    assert only.kept.mean == pytest.approx(first.mean())


def test_whoever_watches_may_break_off():
    shares = []
    choose(TRAINING, CURVE, NETWORKS, shares.append)
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.05
    assert shares[-1] <= 1.0

    def enough(_share):
        raise InterruptedError

    with pytest.raises(InterruptedError):
        choose(TRAINING, CURVE, NETWORKS, enough)
