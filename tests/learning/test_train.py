"""Runs as a whole: beginnings, evaluations, logs, the policy kept, replays, limits, refusals."""

import csv
import itertools
import time
from dataclasses import replace

import numpy as np
import pytest
from small_runs import StopAfter, difference, run, small_training
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator
from tiny_policies import save_tiny

from swarm_mj import evaluate
from swarm_mj.learning import held_out, selection, train
from swarm_mj.learning.run_folder import (
    CHECKPOINT,
    CURVE,
    INIT,
    REPLAYS,
    SETTINGS,
    TENSORBOARD,
    Limits,
    TrainingRun,
)
from swarm_mj.learning.settings import HELD_OUT_SEED, TEST_SEED, usual_settings
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.stored import POLICY, read_policy
from swarm_mj.replay.read import windows
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.writing import owned

TRAINING = small_training()
PROMISED = {
    *("held_out/aoi", "held_out/aoi_sem", "held_out/objective"),
    *("rollout/aoi", "rollout/packets_per_window", "rollout/delivery_ratio"),
    *("rollout/decisions_per_s", "train/entropy", "train/explained_variance"),
    "train/learning_rate",
}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A finished run, where it stands, and all that its listener heard."""
    folder, heard = tmp_path_factory.mktemp("run"), []

    def listen(status):
        heard.append((status.progress.decisions, status.evaluated, status.aoi, status.what))
        return True

    limits = Limits(decisions=192, replay_every=100)
    asked = TrainingRun(training=TRAINING, limits=limits, command="swarm-mj train --out x")
    progress = train.train(asked, folder, listener=listen)
    return folder, progress, heard


def evaluated_at(progress):
    return [row.decisions for row in progress.curve]


@pytest.mark.slow
def test_evaluations_and_replays_come_at_the_start_at_intervals_and_at_the_end(whole):
    folder, progress, _ = whole
    assert evaluated_at(progress) == [0.0, 64.0, 128.0, 192.0]
    for at in (0, 128):  # the first evaluations after 0 and 100
        replay = folder / REPLAYS / f"decisions-{at:09d}.rrd"
        assert len(windows(replay)) == TRAINING.mission.num_windows
    assert len(list((folder / REPLAYS).iterdir())) == 2
    with (folder / CURVE).open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["aoi"]) for row in rows] == [row.costs.aoi for row in progress.curve]


@pytest.mark.slow
def test_tensorboard_has_the_numbers_that_matter(whole):
    folder, progress, _ = whole
    events = EventAccumulator(str(folder / TENSORBOARD)).Reload()
    assert set(events.Tags()["scalars"]) >= PROMISED
    logged = [(event.step, event.value) for event in events.Scalars("held_out/aoi")]
    expected = [(row.decisions, pytest.approx(row.costs.aoi)) for row in progress.curve]
    assert logged == expected
    entropy = [event.value for event in events.Scalars("train/entropy")]
    assert all(value > 0.0 for value in entropy)
    steps = {event.step for tag in events.Tags()["scalars"] for event in events.Scalars(tag)}
    assert steps == {row.decisions for row in progress.curve}


def test_a_curve_that_is_ahead_of_the_checkpoint_is_put_right_on_resuming(tmp_path):
    run(TRAINING, tmp_path / "run", 32)
    path = tmp_path / "run" / CURVE
    kept = path.read_text()
    path.write_text(kept + kept.splitlines()[-1] + "\n")
    run(TRAINING, tmp_path / "run", 32, is_resumed=True)
    assert path.read_text() == kept


def test_the_policy_kept_is_the_one_that_was_chosen_and_flies_as_its_card_says(whole):
    folder, progress, _ = whole
    _, config = read_policy(folder / POLICY)
    assert config.training["decisions"] == progress.choice.decisions
    assert config.training["command"] == "swarm-mj train --out x"
    assert config.evaluation["aoi"] == pytest.approx(progress.choice.kept.mean)
    assert config.evaluation["first_seed"] == TEST_SEED
    seeds = range(TEST_SEED, TEST_SEED + progress.choice.num_missions)
    policy = make_policy(str(folder / POLICY), TRAINING.mission)
    summary = summarise(list(rollout(Swarm(TRAINING.mission, seeds), policy)))
    assert summary.aoi_mean.mean() == pytest.approx(progress.choice.kept.mean)


@pytest.mark.slow
def test_an_interrupted_run_keeps_its_best_evaluation_and_chooses_later_and_anew(tmp_path):
    progress = run(TRAINING, tmp_path / "run", 64, StopAfter(9))
    assert progress.choice is None
    _, config = read_policy(tmp_path / "run" / POLICY)
    assert config.evaluation["first_seed"] == HELD_OUT_SEED
    assert config.evaluation["objective"] == progress.best.costs.objective

    def not_yet(status):
        return status.what != "Choosing"

    progress = run(TRAINING, tmp_path / "run", 64, not_yet, is_resumed=True)
    assert (progress.decisions, progress.choice) == (64, None)
    progress = run(TRAINING, tmp_path / "run", 64, is_resumed=True)
    whole = run(TRAINING, tmp_path / "whole", 64)
    assert progress.choice == whole.choice
    again = run(TRAINING, tmp_path / "run", 96, is_resumed=True)
    assert (whole.choice.run_decisions, again.choice.run_decisions) == (64, 96)


def judge(monkeypatch, objectives):
    """Let evaluations find these objectives, one after the other."""
    evaluate, objectives = held_out.evaluate, iter(objectives)

    def judged(*arguments):
        costs, behind = evaluate(*arguments)
        return replace(costs, objective=next(objectives)), behind

    monkeypatch.setattr(held_out, "evaluate", judged)


@pytest.mark.slow
@pytest.mark.parametrize("sitting", [10, 1000])
def test_a_run_stops_when_evaluations_bring_no_gain_however_often_it_was_interrupted(
    tmp_path, monkeypatch, sitting
):
    """Of 0, 64, 128, ... decisions: the best is at 128, and two more bring less than 0.5 %."""
    judge(monkeypatch, [3.0, 2.0, 1.0, 0.998, 1.5, 0.1])
    asked, is_resumed = (TRAINING, tmp_path / "run", 640), False
    for _ in range(10):
        progress = run(*asked, StopAfter(sitting), is_resumed=is_resumed, patience=2)
        is_resumed = True
        if progress.choice is not None:
            break
    assert evaluated_at(progress) == [0.0, 64.0, 128.0, 192.0, 256.0]
    progress = run(*asked, StopAfter(17), is_resumed=True, patience=0)
    assert evaluated_at(progress)[-1] == 320.0


def test_a_stall_stops_a_run_only_when_the_last_weights_are_judged(tmp_path, monkeypatch):
    """Asked for less patience half-way between two evaluations."""
    judge(monkeypatch, itertools.repeat(1.0))
    run(TRAINING, tmp_path / "run", 640, lambda status: status.progress.decisions <= 128)
    progress = run(TRAINING, tmp_path / "run", 640, is_resumed=True, patience=2)
    assert progress.decisions == progress.choice.run_decisions == 160
    assert evaluated_at(progress) == [0.0, 64.0, 128.0, 160.0]
    assert progress.has_chosen


def test_what_an_evaluation_takes_is_known_after_resuming(tmp_path):
    """So minutes are kept back for the choice from the first rollout on."""
    progress = run(TRAINING, tmp_path / "run", 64, StopAfter(3))
    assert progress.evaluation_minutes > 0.0
    minutes = progress.minutes + 0.5 * progress.evaluation_minutes
    again = run(TRAINING, tmp_path / "run", None, is_resumed=True, minutes=minutes)
    assert again.decisions == progress.decisions == 32


def test_hand_written_policies_fly_once_and_are_flat_curves(whole):
    """Their ages are those of the library's own flights."""
    folder, progress, heard = whole
    flown = [what for *_, what in heard if what == "Flying others"]
    assert len(flown) == 3 * TRAINING.mission.num_windows
    seeds = range(HELD_OUT_SEED, HELD_OUT_SEED + TRAINING.held_out)
    events = EventAccumulator(str(folder / TENSORBOARD)).Reload()
    for name in ("tdma", "spatial-tdma", "lookahead-oracle"):
        swarm = Swarm(TRAINING.mission, seeds)
        summary = summarise(list(rollout(swarm, make_policy(name, TRAINING.mission))))
        column = f"aoi_{name.replace('-', '_')}"
        expected = pytest.approx([summary.aoi_mean.mean()] * len(progress.curve))
        assert [row.references[column] for row in progress.curve] == expected
        assert [event.value for event in events.Scalars(f"held_out/{column}")] == expected


def test_listeners_hear_of_every_window_and_of_evaluations(whole):
    _, _, heard = whole
    trained = [decisions for decisions, evaluated, *_ in heard if evaluated is None]
    assert [d for d in trained if d % 64] == [d for d in range(4, 193, 4) if d % 64]
    shares = [evaluated for _, evaluated, _, what in heard if what == "Evaluating"]
    assert len(shares) == 4 * TRAINING.mission.num_windows
    assert shares.count(1.0) == 4


def test_the_totals_of_an_evaluation_are_of_the_windows_since_the_last(whole):
    """Every window is heard of once after its last evaluation; all have as many missions."""
    _, progress, heard = whole
    ages = {decisions: aoi for decisions, evaluated, aoi, _ in heard if evaluated is None}
    for before, row in zip(progress.curve, progress.curve[1:], strict=False):
        its = [age for at, age in ages.items() if before.decisions < at <= row.decisions]
        assert len(its) == 16
        assert row.training["rollout/aoi"] == pytest.approx(sum(its) / 16)


def test_a_better_policy_takes_the_place_of_the_last_and_a_worse_one_does_not(
    tmp_path, monkeypatch
):
    judge(monkeypatch, [3.0, 1.0, 2.0, 1.0])
    monkeypatch.setattr(train.TrainingSession, "choose", lambda _: None)
    run(TRAINING, tmp_path / "run")
    _, config = read_policy(tmp_path / "run" / POLICY)
    assert config.training["decisions"] == 64


def test_minutes_end_a_run_after_a_whole_rollout(tmp_path, monkeypatch):
    """Where none are kept back for the choice."""
    monkeypatch.setattr(selection, "reserved_minutes", lambda *_: 0.0)
    progress = run(TRAINING, tmp_path / "run", None, minutes=1e-9)
    assert progress.decisions == 0
    assert evaluated_at(progress) == [0.0]

    def slow(status):
        if status.progress.decisions == 36:
            time.sleep(0.5)
        return True

    minutes = progress.minutes + 0.5 / 60.0
    progress = run(TRAINING, tmp_path / "run", None, slow, is_resumed=True, minutes=minutes)
    assert progress.decisions in (32, 64)
    assert evaluated_at(progress)[-1] == progress.decisions
    assert progress.minutes >= minutes


def test_an_evaluation_that_is_broken_off_is_left_for_later(tmp_path):
    """Nothing is judged yet, and all else is kept."""

    def enough(status):
        return status.evaluated is None or status.evaluated < 0.5

    progress = run(TRAINING, tmp_path / "run", listener=enough)
    assert progress.curve == []
    assert not (tmp_path / "run" / POLICY).exists()
    progress = run(TRAINING, tmp_path / "run", 32, is_resumed=True)
    assert evaluated_at(progress) == [0.0, 32.0]


# Beginnings and refusals.


@pytest.mark.parametrize("credit", ["robot", "team"])
def test_a_run_begins_with_the_policy_it_is_given(tmp_path, credit):
    """The best policy before the first rollout is that policy itself."""
    given = save_tiny(tmp_path / "given", "extended")
    training = small_training(credit, network=given.shape, features="extended", held_out=1)

    def enough(status):
        return status.evaluated is not None or not status.progress.curve

    run(training, tmp_path / "run", listener=enough, init=tmp_path / "given")
    for folder in ("policy", INIT):
        kept, _ = read_policy(tmp_path / "run" / folder)
        assert not difference(kept.state_dict(), given.state_dict())


def test_missions_that_cannot_be_made_leave_nothing(tmp_path):
    training = small_training()
    sparse = replace(training, mission=replace(training.mission, range_ratio=0.01))
    with pytest.raises(ValueError, match="too sparse"):
        run(sparse, tmp_path / "run", 1)
    assert not (tmp_path / "run").exists()


def test_training_that_diverges_says_so_and_keeps_what_was_before(tmp_path, monkeypatch):
    monkeypatch.setattr("swarm_mj.learning.ppo.decayed_rate", lambda *_: 1e33)
    with pytest.raises(ValueError, match=r"no longer finite after \d+ decisions; begin a new run"):
        run(small_training(), tmp_path / "run", 320)
    read_policy(tmp_path / "run")


def test_a_budget_is_met_by_whole_rollouts_and_a_run_that_is_done_does_nothing_more(tmp_path):
    training, heard = small_training(held_out=1), []
    for budget, made in ((32, 32), (33, 64)):
        progress = run(training, tmp_path / f"{budget}", budget)
        assert progress.decisions == progress.curve[-1].decisions == made
    again = run(training, tmp_path / "33", 64, heard.append, is_resumed=True)
    assert again.curve == progress.curve
    assert heard == []


def test_a_run_that_appears_meanwhile_is_not_continued(tmp_path, monkeypatch):
    """Another process begins and ends one between the look into the folder and owning it."""

    def owned_late(path):
        for name in (SETTINGS, CHECKPOINT):
            path.with_name(name).touch()
        return owned(path)

    monkeypatch.setattr(train, "owned", owned_late)
    with pytest.raises(ValueError, match=r"holds checkpoint.pt; go on with a run by --resume"):
        run(small_training(), tmp_path)


@pytest.mark.slow
def test_a_minute_of_training_by_the_usual_settings_beats_random_flooding(tmp_path):
    """On missions that neither has seen, mission by mission; tails count, too."""
    mission = paper("stationary", num_robots=20)
    usual = usual_settings("robot", mission, (20,), seed=1)
    run(replace(usual, held_out=2, evaluate_every=12_000), tmp_path, decisions=12_000)
    flown = evaluate(
        [str(tmp_path), "random-flooding"], num_robots=20, num_missions=20, seed=4_700_000
    )
    trained, flooding = (np.array(result.aoi) for result in flown.results)
    gain = flooding - trained
    assert gain.mean() > 3.0 * gain.std(ddof=1) / np.sqrt(20)
    assert trained.max() < flooding.max()
