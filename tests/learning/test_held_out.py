"""Flights without training: evaluations leave no trace; the choice at the end is fair."""

from dataclasses import replace

import numpy as np
import pytest
import torch
from small_runs import evaluation, small_training
from tiny_policies import tiny_network

from swarm_mj.learning.held_out import (
    Flights,
    choose,
    evaluate,
    fly_references,
    held_out_policy,
    notes_of,
    record_first,
    reference_columns,
)
from swarm_mj.learning.selection import MAX_MISSIONS, Choice, Cost
from swarm_mj.learning.settings import CHOICE_SEED, HELD_OUT_SEED, TEST_SEED
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

NETWORK = tiny_network("extended")


def held_out_costs(training, network):
    """An evaluation beside no references."""
    return evaluate(training, network)[0]


def flown(training, size, seed):
    """One held-out mission on its own, by the library's flight."""
    mission = replace(training.mission, num_robots=size)
    swarm = Swarm(mission, [seed])
    windows = list(rollout(swarm, held_out_policy(training, NETWORK, mission)))
    return summarise(windows), [float(w.costs.age_windows[0]) for w in windows]


@pytest.mark.parametrize("sizes", [(5,), (3, 6)])
def test_means_are_those_of_the_missions_flown_one_by_one(sizes):
    training = replace(small_training(sizes=sizes, held_out=3), silence_logit=1.0)
    found = held_out_costs(training, NETWORK)
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


def test_several_missions_are_judged_by_the_mean_over_their_kinds():
    training = replace(small_training(sizes=(3, 6), held_out=2), silence_logit=1.0)
    other = replace(training.mission, task="random-walk", range_ratio=1.0)
    beside = replace(training, mission=other)
    found = held_out_costs(replace(training, other_missions=(other,)), NETWORK)
    apart = [held_out_costs(each, NETWORK) for each in (training, beside)]
    assert apart[0].aoi != apart[1].aoi
    assert found.aoi == pytest.approx(np.mean([each.aoi for each in apart]))
    assert found.objective == pytest.approx(np.mean([each.objective for each in apart]))
    references = fly_references(replace(training, other_missions=(other,)), lambda _share: None)
    ages = references["aoi_tdma"]
    assert [len(of_kind) for of_kind in ages] == [2] * 4
    assert ages == [
        *fly_references(training, lambda _share: None)["aoi_tdma"],
        *fly_references(beside, lambda _share: None)["aoi_tdma"],
    ]


def test_evaluations_fly_with_the_bound_on_speech():
    loud = replace(small_training(held_out=2), silence_logit=-50.0, most_speech=1.0)
    bounded = replace(loud, most_speech=1e-6)
    # Outside their turns robots now speak at every chance, or hardly ever.
    assert held_out_costs(bounded, NETWORK).packets_per_window < 1.1
    assert held_out_costs(loud, NETWORK).packets_per_window > 3.0


def test_eq17_flocks_are_judged_by_their_velocity_variance():
    its = {"features": "extended", "network": NETWORK.shape}
    training = small_training("team", "flocking", reward="velocity-variance", **its)
    found = held_out_costs(training, NETWORK)
    variance = [
        flown(training, 5, HELD_OUT_SEED + b)[0].velocity_variance_mean[0] for b in range(2)
    ]
    assert found.velocity_variance == pytest.approx(sum(variance) / 2)
    assert found.objective == found.velocity_variance > 0.0


def test_the_mission_that_is_recorded_is_the_first_of_the_first_size():
    training = replace(small_training(sizes=(3, 6)), silence_logit=1.0)
    shares = []
    recorder = record_first(training, NETWORK, shares.append)
    _, ages = flown(training, 3, HELD_OUT_SEED)
    assert recorder.log().age_mean.tolist() == ages
    assert shares == pytest.approx(np.arange(1, 21) / 20)


def test_global_random_states_do_not_matter_and_are_left_alone():
    training, results = small_training(), []
    for seed in (1, 2):
        torch.manual_seed(seed)
        np.random.seed(seed)  # noqa: NPY002
        before = torch.get_rng_state(), np.random.get_state()  # noqa: NPY002
        results.append(held_out_costs(training, NETWORK))
        assert torch.equal(torch.get_rng_state(), before[0])
        after = np.random.get_state()  # noqa: NPY002
        assert all(np.array_equal(a, b) for a, b in zip(after, before[1], strict=True))
    assert results[0] == results[1]


def test_the_seed_of_the_training_does_not_change_the_missions_and_one_has_no_error():
    found = [held_out_costs(small_training(seed=seed, held_out=1), NETWORK) for seed in (1, 2)]
    assert found[0] == found[1]
    assert found[0].aoi_sem is None


# The choice at the end: on missions of its own, reported on others, next to other policies.

TRAINING = replace(small_training(held_out=3), silence_logit=1.0)


def network(seed):
    """One of its own for every seed."""
    made = tiny_network("extended")
    torch.manual_seed(seed)
    for weight in made.parameters():
        weight.data += 0.5 * torch.randn_like(weight)
    return made


NETWORKS = {0: network(1), 64: network(2), 128: network(3)}
CURVE = [evaluation(at) for at in NETWORKS]


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
    for name in ("tdma", "spatial-tdma", "lookahead-oracle"):
        other = ages(make_policy(name, TRAINING.mission), TEST_SEED)
        behind = told - other
        cost = choice.others[name]
        assert cost.mean == pytest.approx(other.mean())
        assert cost.behind == pytest.approx(behind.mean())
        assert cost.behind_sem == pytest.approx(behind.std(ddof=1) / np.sqrt(3))


def test_finalists_are_judged_and_the_kept_one_told_on_fresh_missions(monkeypatch):
    """No mission of the evaluations chooses, and none that chose tells the cost."""
    seeds = []
    fly = Flights.fly

    def noted(flights, make_flown, first_seed, num_missions):
        seeds.append(set(range(first_seed, first_seed + num_missions)))
        return fly(flights, make_flown, first_seed, num_missions)

    monkeypatch.setattr(Flights, "fly", noted)
    held_out_costs(TRAINING, NETWORK)
    (evaluated,) = seeds
    seeds.clear()
    choose(TRAINING, CURVE, NETWORKS, lambda _share: None)
    chose = seeds[: len(CURVE)]
    told = seeds[len(CURVE) :]
    assert all(each == chose[0] for each in chose)
    assert all(each == told[0] for each in told)
    assert not evaluated & chose[0]
    assert not evaluated & told[0]
    assert not chose[0] & told[0]


def test_the_largest_flights_do_not_reach_the_next_ones_missions():
    """Nor those that training draws, from 2^40 on."""
    evaluations = range(HELD_OUT_SEED, HELD_OUT_SEED + 10_000)  # the most that may be held out
    assert evaluations.stop <= CHOICE_SEED
    assert CHOICE_SEED + max(10_000, MAX_MISSIONS) <= TEST_SEED
    assert TEST_SEED + max(10_000, MAX_MISSIONS) <= 2**40


def test_the_first_flies_beside_what_was_chosen_if_it_is_another():
    worse = [evaluation(0, objective=9.0), CURVE[1], evaluation(128, objective=9.0)]
    choice, _ = choose(TRAINING, worse, NETWORKS, lambda _share: None)
    assert (choice.decisions, choice.num_finalists) == (64, 1)
    first = ages(flies(NETWORKS[0]), TEST_SEED)
    assert choice.others["first"].mean == pytest.approx(first.mean())
    only, _ = choose(TRAINING, CURVE[:1], NETWORKS, lambda _share: None)
    assert set(only.others) == {"tdma", "spatial-tdma", "lookahead-oracle"}
    assert only.kept.mean == pytest.approx(first.mean())


@pytest.mark.parametrize(
    ("num_finalists", "how"),
    [
        (3, "3 of the best policies on as many other missions, from seed 510000"),
        (1, "the least objective of all evaluations; no other was within 25% of it"),
    ],
)
def test_the_card_says_on_which_missions_it_was_chosen(num_finalists, how):
    kept = Cost(mean=1.0, sem=None)
    its = {"decisions": 64, "run_decisions": 128, "num_finalists": num_finalists}
    choice = Choice(**its, num_missions=3, kept=kept, others={})
    notes = notes_of(replace(TRAINING, robots=(3, 6)), choice)
    assert notes["chosen_by"].endswith(how)
    assert notes["missions"] == 2 * 3


def test_all_references_fly_the_held_out_missions_and_the_oracle_no_large_teams(monkeypatch):
    """Of teams of 101 it has none."""
    flown, fly = [], Flights.fly

    def noted(flights, make_flown, first_seed, size):
        flown.append((make_flown.args[0], first_seed, size))
        flights.training = replace(training, robots=(4,))
        return fly(flights, make_flown, first_seed, size)

    monkeypatch.setattr(Flights, "fly", noted)
    training = replace(TRAINING, held_out=6)
    columns = reference_columns(fly_references(training, lambda _share: None))
    six = [("tdma", HELD_OUT_SEED, 6), ("spatial-tdma", HELD_OUT_SEED, 6)]
    assert flown == [*six, ("lookahead-oracle", HELD_OUT_SEED, 6)]
    assert "aoi_lookahead_oracle" in columns
    large = replace(training, robots=(4, 101))
    columns = reference_columns(fly_references(large, lambda _share: None))
    assert flown[3:] == six
    assert "aoi_lookahead_oracle" not in columns


def test_a_resumed_run_is_still_compared_with_the_oracle_that_it_began_with():
    """Runs of 1.0 have flown the greedy oracle."""
    training = small_training(sizes=(4,), held_out=2)
    _, columns = evaluate(training, NETWORK, {"aoi_greedy_oracle": [[7.0, 6.0]]})
    assert columns.keys() == {"aoi_behind_greedy_oracle", "aoi_behind_greedy_oracle_sem"}


def test_an_evaluation_is_compared_mission_by_mission():
    """With ages of 3 missions of each size that a hand has written: no reference has flown."""
    training = small_training(sizes=(4, 5), held_out=3)
    ages, errors = [], []
    theirs = [[7.0, 6.0, 8.0], [9.0, 11.0, 10.0]]
    for size, their in zip((4, 5), theirs, strict=True):
        mine = [flown(training, size, HELD_OUT_SEED + b)[0].aoi_mean[0] for b in range(3)]
        behind = np.array(mine) - their
        ages.append(behind.mean())
        errors.append(behind.std(ddof=1) / np.sqrt(3))
    _, columns = evaluate(training, NETWORK, {"aoi_spatial_tdma": theirs})
    assert columns == {
        "aoi_behind_spatial_tdma": pytest.approx(sum(ages) / 2),
        "aoi_behind_spatial_tdma_sem": pytest.approx(np.hypot(*errors) / 2),
    }
    alone = replace(training, robots=(4,), held_out=1)
    _, columns = evaluate(alone, NETWORK, {"aoi_tdma": [[7.0]]})
    assert list(columns) == ["aoi_behind_tdma"]


def test_flights_report_their_shares_and_may_be_broken_off():
    evaluated, chosen = [], []
    evaluate(small_training(sizes=(3, 6)), NETWORK, on_window=evaluated.append)
    np.testing.assert_allclose(evaluated, np.arange(1, 41) / 40)
    choice, _ = choose(TRAINING, CURVE, NETWORKS, chosen.append)
    assert chosen == sorted(chosen)
    assert 0.0 < chosen[0] < 0.05
    assert chosen[-1] <= 1.0
    num_flights = 3 + 1 + 3 + (choice.decisions != 0)
    assert len(chosen) == num_flights * TRAINING.mission.num_windows

    def enough(_share):
        raise InterruptedError

    with pytest.raises(InterruptedError):
        choose(TRAINING, CURVE, NETWORKS, enough)
