"""Between rollouts: evaluations, what is logged, the best policy, replays, limits."""

import csv
import json
import time
from dataclasses import replace

import pytest
from small_runs import StopAfter, go_on, run, small_training
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from swarm_mj.learning import callback
from swarm_mj.learning.run_folder import CURVE, POLICY, REPLAYS, TENSORBOARD, Limits, Run
from swarm_mj.learning.settings import HELD_OUT_SEED
from swarm_mj.learning.train import train
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.stored import read_policy
from swarm_mj.replay.read import windows
from swarm_mj.rollout import rollout, summarise
from swarm_mj.swarm import Swarm

TRAINING = small_training()
PROMISED = {
    "held_out/aoi",
    "held_out/aoi_sem",
    "held_out/objective",
    "rollout/aoi",
    "rollout/packets_per_window",
    "rollout/delivery_ratio",
    "rollout/decisions_per_s",
    "train/entropy",
    "train/explained_variance",
    "train/learning_rate",
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished run, where it stands, and all that its listener heard."""
    folder, heard = tmp_path_factory.mktemp("run"), []

    def listen(status):
        heard.append((status.decisions, status.evaluated, status.aoi))
        return True

    limits = Limits(decisions=192, replay_every=100)
    asked = Run(training=TRAINING, limits=limits, command="swarm-mj train --out x")
    progress = train(asked, folder, listener=listen)
    return folder, progress, heard


def test_evaluations_come_at_the_start_at_intervals_and_at_the_end(whole):
    _, progress, _ = whole
    assert [row["decisions"] for row in progress.curve] == [0.0, 64.0, 128.0, 192.0]


def test_tensorboard_has_the_numbers_that_matter(whole):
    folder, progress, _ = whole
    events = EventAccumulator(str(folder / TENSORBOARD)).Reload()
    assert set(events.Tags()["scalars"]) >= PROMISED
    logged = [(event.step, event.value) for event in events.Scalars("held_out/aoi")]
    expected = [(row["decisions"], pytest.approx(row["aoi"])) for row in progress.curve]
    assert logged == expected
    entropy = [event.value for event in events.Scalars("train/entropy")]
    assert all(value > 0.0 for value in entropy)
    steps = {event.step for tag in events.Tags()["scalars"] for event in events.Scalars(tag)}
    assert steps == {row["decisions"] for row in progress.curve}


def test_the_curve_is_a_table_of_every_evaluation(whole):
    folder, progress, _ = whole
    with (folder / CURVE).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["aoi"]) for row in rows] == [row["aoi"] for row in progress.curve]


def test_a_curve_that_is_ahead_of_the_checkpoint_is_put_right_on_resuming(tmp_path):
    run(TRAINING, tmp_path / "run", 32)
    path = tmp_path / "run" / CURVE
    kept = path.read_text()
    path.write_text(kept + kept.splitlines()[-1] + "\n")
    run(TRAINING, tmp_path / "run", 32, is_resumed=True)
    assert path.read_text() == kept


def test_the_best_policy_is_the_one_of_the_best_evaluation(whole):
    folder, progress, _ = whole
    _, config = read_policy(folder / POLICY)
    assert progress.best is not None
    assert config.training["decisions"] == progress.best["decisions"]
    assert config.training["command"] == "swarm-mj train --out x"
    for name in ("aoi", "objective", "packets_per_window"):
        assert config.evaluation[name] == progress.best[name]
    assert config.evaluation["first_seed"] == HELD_OUT_SEED
    assert progress.best["objective"] == min(row["objective"] for row in progress.curve)


def test_the_best_policy_flies_as_it_was_evaluated(whole):
    folder, progress, _ = whole
    seeds = range(HELD_OUT_SEED, HELD_OUT_SEED + TRAINING.held_out)
    policy = make_policy(str(folder / POLICY), TRAINING.mission)
    summary = summarise(list(rollout(Swarm(TRAINING.mission, seeds), policy)))
    assert summary.aoi_mean.mean() == pytest.approx(progress.best["aoi"])


def test_replays_are_recorded_at_intervals(whole):
    folder, _, _ = whole
    names = sorted(path.name for path in (folder / REPLAYS).iterdir())
    assert names == ["decisions-000000000.rrd", "decisions-000000128.rrd"]
    for name in names:
        assert len(windows(folder / REPLAYS / name)) == TRAINING.mission.num_windows


def test_listeners_hear_of_every_window_and_of_evaluations(whole):
    _, _, heard = whole
    trained = [decisions for decisions, evaluated, _ in heard if evaluated is None]
    assert [d for d in trained if d % 64] == [d for d in range(4, 193, 4) if d % 64]
    shares = [evaluated for _, evaluated, _ in heard if evaluated is not None]
    assert len(shares) == 4 * TRAINING.mission.num_windows
    assert shares.count(1.0) == 4


def test_the_totals_of_an_evaluation_are_of_the_windows_since_the_last(whole):
    """Every window is heard of once after its last evaluation; all have as many missions."""
    _, progress, heard = whole
    ages = {decisions: aoi for decisions, evaluated, aoi in heard if evaluated is None}
    for before, row in zip(progress.curve, progress.curve[1:], strict=False):
        its = [age for at, age in ages.items() if before["decisions"] < at <= row["decisions"]]
        assert len(its) == 16
        assert row["rollout/aoi"] == pytest.approx(sum(its) / 16)


def test_a_better_policy_takes_the_place_of_the_last_and_a_worse_one_does_not(
    tmp_path, monkeypatch
):
    objectives = iter([3.0, 1.0, 2.0, 1.0])
    evaluate = callback.evaluate

    def judged(*arguments):
        return replace(evaluate(*arguments), objective=next(objectives))

    monkeypatch.setattr(callback, "evaluate", judged)
    progress = run(TRAINING, tmp_path / "run")
    assert progress.best_objective == 1.0
    _, config = read_policy(tmp_path / "run" / POLICY)
    assert config.training["decisions"] == 64


def test_minutes_end_a_run_after_a_whole_rollout(tmp_path):
    asked = Run(training=TRAINING, limits=Limits(minutes=1e-9))
    progress = train(asked, tmp_path / "run", listener=go_on)
    assert progress.decisions == 0
    assert [row["decisions"] for row in progress.curve] == [0.0]

    def slow(status):
        if status.decisions == 36:
            time.sleep(0.02)
        return True

    limits = Limits(minutes=progress.minutes + 0.02 / 60.0)
    asked = Run(training=TRAINING, limits=limits)
    progress = train(asked, tmp_path / "run", listener=slow, is_resumed=True)
    assert progress.decisions % 32 == 0
    assert 0 < progress.decisions <= 64
    assert progress.curve[-1]["decisions"] == progress.decisions
    assert progress.minutes >= limits.minutes


def test_an_evaluation_is_left_for_later_when_the_listener_has_had_enough(tmp_path):
    """In the middle of the first one: nothing is judged yet, and all else is kept."""

    def enough(status):
        return status.evaluated is None or status.evaluated < 0.5

    progress = run(TRAINING, tmp_path / "run", listener=enough)
    assert progress.curve == []
    assert not (tmp_path / "run" / POLICY).exists()
    progress = run(TRAINING, tmp_path / "run", 32, is_resumed=True)
    assert [row["decisions"] for row in progress.curve] == [0.0, 32.0]


def test_a_stop_finishes_the_rollout_and_is_not_evaluated(tmp_path):
    progress = run(TRAINING, tmp_path / "run", listener=StopAfter(3))
    assert progress.decisions == 32
    assert [row["decisions"] for row in progress.curve] == [0.0]


def test_a_stop_in_the_last_rollout_leaves_its_evaluation_to_the_next_session(tmp_path):
    stopped = run(TRAINING, tmp_path / "run", 64, StopAfter(14))
    assert stopped.decisions == 64
    assert [row["decisions"] for row in stopped.curve] == [0.0]
    progress = run(TRAINING, tmp_path / "run", 64, is_resumed=True)
    assert [row["decisions"] for row in progress.curve] == [0.0, 64.0]
    whole = run(TRAINING, tmp_path / "whole", 64)
    for row in (progress.curve[-1], whole.curve[-1]):
        del row["minutes"], row["rollout/decisions_per_s"]
    assert json.dumps(progress.curve[-1]) == json.dumps(whole.curve[-1])
