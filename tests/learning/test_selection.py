"""A run's progress and what is chosen from its curve, by arithmetic in view."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from small_runs import evaluation, small_training

from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED
from swarm_mj.learning.graph_vec_env import GraphVecEnv
from swarm_mj.learning.selection import (
    Accumulator,
    Progress,
    candidates,
    curve_row_of,
    finalists,
    num_missions,
    reserved_minutes,
)
from swarm_mj.learning.settings import CHOICE_SEED, HELD_OUT_SEED, TEST_SEED


def curve(*objectives):
    return [evaluation(10 * n, objective=x) for n, x in enumerate(objectives)]


def at(rows):
    return [row.decisions for row in rows]


def test_the_first_and_the_best_three_are_candidates_in_their_order():
    assert at(candidates(curve(9.0, 5.0, 3.0, 6.0, 4.0))) == [0.0, 10.0, 20.0, 40.0]
    assert at(candidates(curve(1.0, 5.0, 3.0, 6.0, 4.0))) == [0.0, 20.0, 40.0]
    assert at(candidates(curve(2.0))) == [0.0]
    assert candidates([]) == []


def test_an_evaluation_that_is_no_longer_a_candidate_never_becomes_one_again():
    """So its weights need not be kept."""
    objectives = (5.0, 3.0, 4.0, 3.5, 2.0, 6.0, 3.2)
    kept = set()
    for n in range(len(objectives)):
        now = set(at(candidates(curve(*objectives[: n + 1]))))
        assert now <= kept | {10.0 * n}
        kept = now


def test_only_what_is_near_the_best_flies_again():
    """1.25 times the best is near."""
    assert at(finalists(curve(9.0, 5.0, 4.0, 5.1))) == [10.0, 20.0]
    assert at(finalists(curve(4.5, 5.0, 4.0))) == [0.0, 10.0, 20.0]


def test_missions_that_choose_are_a_share_of_the_run():
    """Half of the decisions, over 5 flights, 2 sizes and 20 windows; 2 are held out."""
    training = small_training(sizes=(3, 6))
    for decisions, size in ((0, 2), (1000, 2), (4399, 10), (4400, 11), (10**9, 40)):
        assert num_missions(training, decisions, 5) == size
        assert num_missions(replace(training, held_out=50), decisions, 5) == 50


def test_minutes_are_reserved_for_every_flight_of_the_end_but_never_most_of_them():
    """The last evaluation, 4 finalists, 5 others: of 2 missions at first, as an evaluation has."""

    def reserved(decisions, evaluation, limit):
        progress = Progress(decisions=decisions, evaluation_minutes=evaluation)
        return reserved_minutes(small_training(), progress, limit)

    assert reserved(0, 0.5, 60.0) == pytest.approx(0.5 + 9 * 0.5)
    # Half of 3200 decisions over 9 flights of 20 windows are 8 missions, 4 times as many.
    assert reserved(3200, 0.5, 60.0) == pytest.approx(0.5 + 9 * 2.0)
    assert reserved(3200, 0.5, 2.0) == 1.0
    assert reserved(0, 0.0, 2.0) == 0.0


@pytest.mark.parametrize(
    ("objectives", "patience", "stalled"),
    [
        ((3.0, 2.0, 1.0), 2, False),
        ((3.0, 1.0, 2.0), 2, False),
        ((1.0, 1.0, 1.0), 2, True),
        ((1.0, 0.996, 2.0), 2, True),
        ((1.0, 0.994, 2.0), 2, False),
        ((1.0, 2.0), 2, False),
        ((1.0, 2.0, 2.0), 0, False),
        ((1.0, 2.0, 2.0), None, False),
        ((), 2, False),
    ],
)
def test_a_run_has_stalled_if_the_last_evaluations_gain_less_than_half_a_percent(
    objectives, patience, stalled
):
    assert Progress(curve=curve(*objectives)).has_stalled(patience) is stalled


def test_missions_that_choose_tell_or_train_are_others():
    assert HELD_OUT_SEED + 10_000 <= CHOICE_SEED
    assert CHOICE_SEED + 10_000 <= TEST_SEED < TEST_SEED + 10_000 < FIRST_TRAINING_SEED


def test_the_best_is_the_least_objective_and_the_first_of_equals():
    assert Progress().best is None
    rows = curve(3.0, 1.0, 1.0)
    assert Progress(curve=rows).best is rows[1]


def test_a_curve_is_a_table_even_if_later_rows_have_more_columns(tmp_path):
    row = evaluation(10, aoi=1 / 3)
    entropy = {"train/entropy": 0.5}
    curve = [row, replace(row, training=entropy)]
    Progress(curve=curve).write_curve(tmp_path / "curve.csv")
    with (tmp_path / "curve.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert {name: float(x) for name, x in first.items() if x} == row.columns()
    assert first["decisions"] == "10.0"
    assert float(second["train/entropy"]) == 0.5


def test_an_evaluation_is_its_columns_and_comes_back_from_them():
    """A cost that is not known has no column; a slash tells training from reference policies."""
    row = replace(evaluation(64), references={"aoi_tdma": 3.0}, training={"rollout/aoi": 4.0})
    columns = row.columns()
    assert list(columns)[:4] == ["decisions", "minutes", "aoi", "aoi_steady"]
    assert list(columns)[-3:] == ["objective", "aoi_tdma", "rollout/aoi"]
    assert curve_row_of(columns) == row
    known = evaluation(64, aoi_sem=0.25)
    assert list(known.columns())[3] == "aoi_sem"
    assert curve_row_of(known.columns()) == known
    del columns["objective"]
    with pytest.raises(KeyError, match="objective"):
        curve_row_of(columns)


def test_totals_are_per_mission_and_window():
    training = small_training("team", sizes=(3,), groups=2)
    env = GraphVecEnv(training, np.random.default_rng(1))
    env.reset()
    accumulator, ages, sent, arrived = Accumulator(), [], 0, 0
    assert accumulator.means() == {}
    for _ in range(5):
        env.step(np.array([[1, 1, 2], [0, 2, 0], [0, 1, 2], [0, 1, 1]]))
        accumulator.add(env.costs)
        ages += [age for its in env.costs for age in its.age_windows]
        sent += sum(its.packets.attempted.sum() for its in env.costs)
        arrived += sum(its.packets.delivered.sum() for its in env.costs)
    accumulator.seconds = 4.0
    means = accumulator.means()
    assert means["rollout/aoi"] == pytest.approx(sum(ages) / 20)
    assert means["rollout/packets_per_window"] == sent / 20 == 1.0
    assert means["rollout/delivery_ratio"] == pytest.approx(arrived / sent)
    assert means["rollout/decisions_per_s"] == 5.0
