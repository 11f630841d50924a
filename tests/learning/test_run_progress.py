"""Where a run stands: totals, the curve, and JSON that gives every number back."""

import csv
import math

import numpy as np
import pytest

from swarm_mj.learning.missions import make_groups
from swarm_mj.learning.progress import Progress, Tally, from_json, write_curve
from swarm_mj.learning.team_env import TeamEnv
from swarm_mj.mission import paper

ROW = {"decisions": 10.0, "aoi": 1 / 3, "objective": 0.2}


def test_progress_comes_back_from_json_to_the_last_bit():
    progress = Progress(
        decisions=7,
        minutes=0.1 + 0.2,
        next_evaluation=12,
        curve=[ROW, ROW | {"train/explained_variance": math.nan}],
        tally=Tally(seconds=1e-9 / 3, decisions=5, age_windows=0.1),
        optimiser={"train/entropy": 2 / 3},
    )
    again = from_json(progress.to_json())
    assert math.isnan(again.curve[1].pop("train/explained_variance"))
    progress.curve[1].pop("train/explained_variance")
    assert again == progress
    assert again.best_objective == math.inf


def test_the_best_is_the_least_objective_and_the_first_of_equals():
    assert Progress().best is None
    rows = [ROW | {"objective": x, "decisions": float(n)} for n, x in enumerate((3.0, 1.0, 1.0))]
    assert Progress(curve=rows).best is rows[1]


def test_what_is_no_progress_is_refused():
    with pytest.raises(TypeError):
        from_json('{"tally": {}, "wings": 2}')
    with pytest.raises(ValueError, match="Expecting"):
        from_json('{"tally":')


def test_totals_are_per_mission_and_window():
    mission = paper("stationary", num_robots=3, num_windows=9, range_ratio=1.0)
    env = TeamEnv(make_groups(mission, (3,), "paper", 4, 2, np.random.default_rng(1)))
    env.reset()
    tally, ages, sent, arrived = Tally(), [], 0, 0
    assert tally.means() == {}
    for _ in range(5):
        env.step(np.array([[1, 1, 2], [0, 2, 0], [0, 1, 2], [0, 1, 1]]))
        tally.add(env)
        for outcome in env.outcomes:
            ages += list(outcome.age_windows)
            sent, arrived = sent + outcome.attempted.sum(), arrived + outcome.delivered.sum()
    tally.seconds = 4.0
    means = tally.means()
    assert means["rollout/aoi"] == pytest.approx(sum(ages) / 20)
    assert means["rollout/packets_per_window"] == sent / 20 == 1.0
    assert means["rollout/delivery_ratio"] == pytest.approx(arrived / sent)
    assert means["rollout/decisions_per_s"] == 5.0


def test_a_curve_is_a_table_even_if_later_rows_have_more_columns(tmp_path):
    write_curve(tmp_path / "curve.csv", [ROW, ROW | {"train/entropy": 0.5}])
    with (tmp_path / "curve.csv").open(newline="") as file:
        first, second = csv.DictReader(file)
    assert {name: float(x) for name, x in first.items() if x} == ROW
    assert float(second["train/entropy"]) == 0.5
