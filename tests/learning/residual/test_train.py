"""A training that begins, stops, goes on, and chooses, on the smallest missions."""

import csv
from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch

from swarm_mj.learning.residual import train as training_module
from swarm_mj.learning.residual.ppo import PpoSettings
from swarm_mj.learning.residual.train import (
    CHECKPOINT,
    CHOICE_SEED,
    CURVE,
    FIRST_PLACE,
    HELD_OUT_SEED,
    ResidualTraining,
    Run,
    train,
)
from swarm_mj.mission import paper
from swarm_mj.policies.policy import BroadcastPolicy
from swarm_mj.policies.residual.resting_rule import RestingRule
from swarm_mj.radio.mission_radio import radio_of
from swarm_mj.rollout import rollout
from swarm_mj.swarm import Swarm

MISSIONS = {
    name: paper("stationary", num_robots=5, num_windows=14, **channel)
    for name, channel in {"free space": {}, "Rayleigh": {"fading": "rayleigh"}}.items()
}
TRAINING = ResidualTraining(
    missions=MISSIONS,
    width=4,
    trust=1.0,  # so that robots contradict the rule, and there is something to learn
    ppo=PpoSettings(learning_rate=0.02),
    together=2,
    places=3,
    held_out=1,
    horizon=8,
    evaluate_every=2,
)


@pytest.fixture(autouse=True, scope="module")
def _half_minutes():
    """Each improvement takes half a minute."""
    ticks = iter(range(0, 10**6, 30))
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(training_module, "time", SimpleNamespace(monotonic=lambda: next(ticks)))
        yield


@pytest.fixture(scope="module")
def whole(tmp_path_factory, _half_minutes):
    """A run of four improvements that never stopped."""
    run = Run(TRAINING, tmp_path_factory.mktemp("whole"))
    train(run, 2.0, nobody)
    return run


def nobody(_line):
    """Listens to nothing."""


def arrays(run):
    """The weights of the best networks, by improvements."""
    return {at: dict(each) for at, each in run.progress.best.items()}


def rows_of(folder):
    with (folder / CURVE).open() as file:
        return [{name: float(cell) for name, cell in row.items()} for row in csv.DictReader(file)]


def assert_same(one, other):
    assert one.progress.curve == other.progress.curve
    assert arrays(one).keys() == arrays(other).keys()
    for at, weights in arrays(one).items():
        for name, weight in weights.items():
            assert torch.equal(weight, arrays(other)[at][name])


class RuleAlone(BroadcastPolicy):
    """Transmits as the rule proposes."""

    def __init__(self, mission):
        self.rule = RestingRule(radio_of(mission))

    def start(self, num_robots, rngs):
        self.rule.start(num_robots, rngs)

    def transmits(self, views):
        return self.rule.propose(views).transmits


def test_it_begins_with_the_ages_of_the_rule_alone(tmp_path):
    run = Run(replace(TRAINING, held_out=2), tmp_path)
    (row,) = run.progress.curve
    for name, mission in MISSIONS.items():
        windows = rollout(Swarm(mission, [HELD_OUT_SEED, HELD_OUT_SEED + 1]), RuleAlone(mission))
        assert row[name] == pytest.approx(np.mean([each.costs.age_windows for each in windows]))
    assert row["ratio"] == 1.0
    assert list(run.progress.best) == [0]


def test_places_of_training_and_of_both_evaluations_are_never_the_same():
    most = {each.name: each.metadata.get("high") for each in fields(ResidualTraining)}
    assert FIRST_PLACE + most["places"] <= HELD_OUT_SEED
    assert HELD_OUT_SEED + most["held_out"] <= CHOICE_SEED


def test_the_curve_has_a_row_an_evaluation_and_says_what_it_was(tmp_path):
    said = []
    run = Run(TRAINING, tmp_path)
    train(run, 1.5, said.append)
    rows = rows_of(tmp_path)
    assert [row["improvements"] for row in rows] == [0, 2, 3]
    assert [row["minutes"] for row in rows] == [0.0, 1.0, 1.5]
    for row in rows:
        assert row["ratio"] == pytest.approx(np.mean([row[n] / rows[0][n] for n in MISSIONS]))
    assert [line.split(":")[0].strip() for line in said] == [
        "1 improvements, 0.5 min",
        "2 improvements, 1.0 min",
        "held out",
        "3 improvements, 1.5 min",
        "held out",
    ]
    assert f"{rows[1]['ratio']:.3f} of the rule's age" in said[2]
    assert f"Rayleigh {rows[1]['Rayleigh']:.2f}" in said[2]
    networks = arrays(run)
    assert not torch.equal(networks[2]["logit.weight"], networks[3]["logit.weight"])


@pytest.mark.parametrize("num_lines", [1, 2, 3, 4])
def test_a_run_that_goes_on_ends_as_one_that_never_stopped(tmp_path, whole, num_lines):
    """It is interrupted after an improvement, before an evaluation that is due, and after it."""
    said = []

    def interrupted(line):
        said.append(line)
        if len(said) == num_lines:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(Run(TRAINING, tmp_path), 2.0, interrupted)
    parts = Run(TRAINING, tmp_path)
    assert parts.progress.improvements == sum("improvements" in line for line in said)
    train(parts, 2.0, nobody)
    assert_same(parts, whole)


def test_a_run_that_is_over_goes_on_for_more_minutes_only(tmp_path):
    train(Run(TRAINING, tmp_path), 1.0, nobody)
    before = (tmp_path / CHECKPOINT).read_bytes()
    said = []
    train(Run(TRAINING, tmp_path), 1.0, said.append)
    assert said == []
    assert (tmp_path / CHECKPOINT).read_bytes() == before
    train(Run(TRAINING, tmp_path), 2.0, said.append)
    assert [row["improvements"] for row in rows_of(tmp_path)] == [0, 2, 4]


def test_a_run_that_is_broken_off_loses_the_improvement_under_way_alone(
    tmp_path, whole, monkeypatch
):
    broken = Run(TRAINING, tmp_path)
    broken.improve()

    def interrupted(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(training_module, "improve", interrupted)
        with pytest.raises(KeyboardInterrupt):
            broken.improve()
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {CHECKPOINT, CURVE}
    again = Run(TRAINING, tmp_path)
    assert again.progress.improvements == 1
    train(again, 2.0, nobody)
    assert_same(again, whole)


def choice_if(run, monkeypatch, ratios):
    """What is chosen if networks fly missions of the choice at these ratios to the rule."""
    ages = iter([{"one": 4.0, "other": 2.0}, *({"one": 4 * r, "other": 2 * r} for r in ratios)])
    monkeypatch.setattr(run, "ages", lambda *_, **__: next(ages))
    return run.choose()


def test_the_choice_is_the_best_and_keeps_the_rule_if_all_networks_are_worse(whole, monkeypatch):
    assert list(whole.progress.best) == [0, 2, 4]
    at, weights, ratios = choice_if(whole, monkeypatch, [0.9, 0.8])
    assert (at, ratios) == (4, {0: 1.0, 2: pytest.approx(0.9), 4: pytest.approx(0.8)})
    for name, weight in arrays(whole)[4].items():
        np.testing.assert_array_equal(weights.arrays[name], weight)
    at, weights, _ = choice_if(whole, monkeypatch, [1.01, 1.2])
    assert at == 0
    assert np.all(weights.arrays["logit.weight"] == 0.0)


def test_the_best_three_of_all_evaluations_are_kept_and_the_untrained_one(tmp_path, monkeypatch):
    run = Run(TRAINING, tmp_path)
    first = run.progress.curve[0]
    for number, ratio in enumerate([0.9, 0.7, 1.1, 0.8, 0.6, 0.95], 1):
        run.progress.improvements = number
        ages = {name: ratio * first[name] for name in MISSIONS}
        monkeypatch.setattr(run, "ages", lambda *_, ages=ages, **__: ages)
        assert run.evaluate()["ratio"] == pytest.approx(ratio)
    assert sorted(run.progress.best) == [0, 2, 4, 5]
    assert len(rows_of(tmp_path)) == 7


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """The bytes of a sound checkpoint."""
    folder = tmp_path_factory.mktemp("run")
    Run(TRAINING, folder)
    return (folder / CHECKPOINT).read_bytes()


def refusal(folder, content, training=TRAINING):
    """Why a run with this checkpoint is refused; it must be one line."""
    (folder / CHECKPOINT).write_bytes(content)
    with pytest.raises(ValueError, match=CHECKPOINT) as caught:
        Run(training, folder)
    assert "\n" not in str(caught.value)
    assert (folder / CHECKPOINT).read_bytes() == content
    return str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.999])
def test_a_checkpoint_that_was_cut_off_is_refused(kept, tmp_path, share):
    said = refusal(tmp_path, kept[: int(share * len(kept))])
    assert "is damaged, or none; begin a new run with another --out" in said


@pytest.mark.parametrize(
    "other", [{"seed": 1}, {"width": 5}, {"missions": {"free space": MISSIONS["free space"]}}]
)
def test_a_checkpoint_of_other_settings_is_refused(kept, tmp_path, other):
    said = refusal(tmp_path, kept, replace(TRAINING, **other))
    assert "is not this run's (it was made with other settings); begin a new run" in said


@pytest.mark.parametrize(
    "change",
    [
        lambda state: state.pop("progress"),
        lambda state: state.pop("rng"),
        lambda state: state["network"].pop("logit.bias"),
        lambda state: state.update(shuffle=torch.zeros(3)),
        lambda state: state["progress"].update(mood="good"),
        lambda state: state.clear(),
    ],
)
def test_a_checkpoint_that_lacks_something_is_refused(kept, tmp_path, change):
    (tmp_path / "before.pt").write_bytes(kept)
    state = torch.load(tmp_path / "before.pt", weights_only=True)
    change(state)
    torch.save(state, tmp_path / "after.pt")
    assert "is not this run's" in refusal(tmp_path, (tmp_path / "after.pt").read_bytes())


@pytest.mark.parametrize(
    ("other", "complaint"),
    [
        ({"together": 4}, "together must be up to places, 3, not 4"),
        ({"horizon": 56}, "horizon must be below twice the slots of a mission, 56, not 56"),
        ({"share": 0.0}, "share must be a number from 0.001 to 1, not 0.0"),
    ],
)
def test_settings_that_leave_nothing_to_fly_or_learn_are_refused(other, complaint):
    with pytest.raises(ValueError, match=complaint):
        replace(TRAINING, **other)


def test_missions_in_which_nobody_has_a_plan_to_correct_teach_nothing(tmp_path):
    missions = {"short": paper("stationary", num_robots=5, num_windows=2)}
    run = Run(replace(TRAINING, missions=missions, horizon=2), tmp_path)
    with pytest.raises(ValueError, match="no robot had a plan to correct"):
        run.improve()
