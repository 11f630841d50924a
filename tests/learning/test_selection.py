"""The choice at the end: on missions of its own, told on others, against hand-written policies."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import small_training
from tiny_policies import tiny_network

from swarm_mj.learning.choice import CHOICE_SEED, TEST_SEED
from swarm_mj.learning.held_out import fly, held_out_policy
from swarm_mj.learning.selection import choose, reference_columns, told_of_choice
from swarm_mj.learning.settings import HELD_OUT_SEED
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

TRAINING = replace(small_training(held_out=3), silence_logit=1.0)


def network(seed):
    """One of its own for every seed."""
    made = tiny_network("extended")
    torch.manual_seed(seed)
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


def test_the_card_says_on_which_missions_it_was_chosen():
    choice, _ = choose(TRAINING, CURVE, NETWORKS, lambda _share: None)
    how = told_of_choice(TRAINING, choice)["chosen_by"]
    assert how.endswith("3 of the best policies on as many other missions, from seed 510000")
    how = told_of_choice(TRAINING, replace(choice, num_finalists=1))["chosen_by"]
    assert how == "the least objective of all evaluations; no other was within 25% of it"


def test_the_oracle_flies_few_of_the_held_out_missions_and_no_large_teams(monkeypatch):
    """They are the first 4 of 6; of teams of 101 there are none."""
    flown = []

    def noted(training, policy_of, seeds, _on_window):
        flown.append((policy_of.args[0], seeds))
        return fly(replace(training, robots=(4,)), policy_of, seeds)

    monkeypatch.setattr("swarm_mj.learning.selection.fly", noted)
    training = replace(TRAINING, held_out=6)
    columns = reference_columns(training, lambda _share: None)
    six, four = range(HELD_OUT_SEED, HELD_OUT_SEED + 6), range(HELD_OUT_SEED, HELD_OUT_SEED + 4)
    assert flown == [("tdma", six), ("spatial-tdma", six), ("greedy-oracle", four)]
    assert "aoi_greedy_oracle" in columns
    columns = reference_columns(replace(training, robots=(4, 101)), lambda _share: None)
    assert flown[3:] == [("tdma", six), ("spatial-tdma", six)]
    assert "aoi_greedy_oracle" not in columns


def test_whoever_watches_may_break_off():
    shares = []
    choice, _ = choose(TRAINING, CURVE, NETWORKS, shares.append)
    assert shares == sorted(shares)
    assert 0.0 < shares[0] < 0.05
    assert shares[-1] <= 1.0
    kept_is_first = choice.decisions == 0
    assert len(shares) == (3 + 1 + 2 + (not kept_is_first)) * TRAINING.mission.num_windows

    def enough(_share):
        raise InterruptedError

    with pytest.raises(InterruptedError):
        choose(TRAINING, CURVE, NETWORKS, enough)
