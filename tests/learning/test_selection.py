"""What is chosen from a curve, by arithmetic in view."""

from dataclasses import replace

import pytest
from small_runs import small_training

from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED
from swarm_mj.learning.selection import (
    candidates,
    finalists,
    has_stalled,
    num_missions,
    reserved_minutes,
)
from swarm_mj.learning.settings import CHOICE_SEED, HELD_OUT_SEED, TEST_SEED


def curve(*objectives):
    return [{"decisions": 10.0 * n, "objective": x} for n, x in enumerate(objectives)]


def at(rows):
    return [row["decisions"] for row in rows]


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


@pytest.mark.parametrize(
    ("decisions", "size"),
    [
        # Half of the decisions, over 5 flights, 2 sizes and 20 windows; 2 are held out.
        (0, 2),
        (1000, 2),
        (4000, 10),
        (4399, 10),
        (4400, 11),
        (10**9, 40),
    ],
)
def test_missions_that_choose_are_a_share_of_the_run(decisions, size):
    training = small_training(sizes=(3, 6))
    assert num_missions(training, decisions, 5) == size
    assert num_missions(replace(training, held_out=50), decisions, 5) == 50


def test_minutes_are_reserved_for_every_flight_of_the_end_but_never_most_of_them():
    """The last evaluation, 4 finalists, 4 others: of 2 missions at first, as an evaluation has."""
    training = small_training()
    assert reserved_minutes(training, 0, 0.5, 60.0) == pytest.approx(0.5 + 8 * 0.5)
    # Half of 3200 decisions over 8 flights of 20 windows are 10 missions, 5 times as many.
    assert reserved_minutes(training, 3200, 0.5, 60.0) == pytest.approx(0.5 + 8 * 2.5)
    assert reserved_minutes(training, 3200, 0.5, 2.0) == 1.0
    assert reserved_minutes(training, 0, 0.0, 2.0) == 0.0


@pytest.mark.parametrize(
    ("objectives", "patience", "stalled"),
    [
        ((3.0, 2.0, 1.0), 2, False),
        ((3.0, 1.0, 2.0), 2, False),
        ((1.0, 1.0, 1.0), 2, True),
        ((1.0, 0.996, 2.0), 2, True),
        ((1.0, 0.994, 2.0), 2, False),
        ((1.0, 0.994, 2.0, 1.5), 2, True),
        ((1.0, 2.0), 2, False),
        ((1.0, 2.0, 2.0), 0, False),
        ((1.0, 2.0, 2.0), None, False),
        ((), 2, False),
    ],
)
def test_a_run_has_stalled_if_the_last_evaluations_gain_less_than_half_a_percent(
    objectives, patience, stalled
):
    assert has_stalled(curve(*objectives), patience) is stalled


def test_missions_that_choose_tell_or_train_are_others():
    assert HELD_OUT_SEED + 10_000 <= CHOICE_SEED
    assert CHOICE_SEED + 10_000 <= TEST_SEED < TEST_SEED + 10_000 < FIRST_TRAINING_SEED
