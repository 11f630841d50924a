"""The training of the planner's network, on teams of a few robots."""

from itertools import islice

import cma
import numpy as np
import pytest

from swarm_mj.learning import plan_training
from swarm_mj.learning.plan_practice import EXERCISES, Exercise, draw_teams
from swarm_mj.learning.plan_training import PlanTraining, ages, imitated, relative
from swarm_mj.mission import paper
from swarm_mj.policies.worth import RuleOfThumb
from swarm_mj.policies.worth_network import SHAPES, WorthNetwork, num_weights, unpacked

TINY = {
    "few": Exercise(mission=paper("stationary", num_robots=4, range_ratio=0.2), num_teams=2),
    "walk": Exercise(mission=paper("random-walk", num_robots=5), num_teams=1, largest_error_m=6.0),
}


@pytest.fixture(autouse=True)
def small(monkeypatch):
    """A training of moments."""
    monkeypatch.setattr(plan_training, "EXERCISES", TINY)
    monkeypatch.setattr(plan_training, "IMITATION_STEPS", 40)
    monkeypatch.setattr(plan_training, "POPULATION", 4)


def begin(path, seed=1, **options):
    return PlanTraining(path, seed=seed, step_size=0.1, **options)


def evolve(training, num_generations):
    """The next generations' progress."""
    return list(islice(training.generations(), num_generations))


def flat(training):
    return np.concatenate([array.ravel() for array in training.mean.values()])


def test_the_mean_is_a_network_and_moves(tmp_path):
    training = begin(tmp_path / "e.npz")
    start = flat(training)
    WorthNetwork(training.mean, digest="")
    (now,) = evolve(training, 1)
    assert now.generation == 1
    assert now.step_size > 0.0
    assert now.candidates > 0.0
    assert not np.array_equal(flat(training), start)


def test_an_interrupted_training_continues_to_the_same_weights(tmp_path):
    """Bit for bit, and with the same progress, wherever it was interrupted."""
    whole = begin(tmp_path / "whole.npz", measure_every=2)
    progress, expected = evolve(whole, 5), flat(whole)
    for first in (1, 2, 4):
        path = tmp_path / f"{first}.npz"
        evolve(begin(path, measure_every=2), first)
        continued = begin(path, measure_every=2)
        rest = evolve(continued, 5 - first)
        np.testing.assert_array_equal(flat(continued), expected)
        assert repr(rest) == repr(progress[first:])


def test_a_generation_that_was_not_finished_is_done_again(tmp_path, monkeypatch):
    """What is on disk is of whole generations, and nothing else lies about."""
    expected = begin(tmp_path / "whole.npz")
    evolve(expected, 2)
    path, measured = tmp_path / "e.npz", []
    training = begin(path)
    evolve(training, 1)

    def interrupted(*arguments):
        measured.append(arguments)
        if len(measured) == 3:
            raise KeyboardInterrupt
        return relative(*arguments)

    with monkeypatch.context() as patched:
        patched.setattr(plan_training, "relative", interrupted)
        with pytest.raises(KeyboardInterrupt):
            evolve(training, 1)
    continued = begin(path)
    evolve(continued, 1)
    np.testing.assert_array_equal(flat(continued), flat(expected))
    assert sorted(file.name for file in tmp_path.iterdir()) == ["e.npz", "whole.npz"]


def test_the_file_holds_every_candidate_and_its_loss(tmp_path):
    training = begin(tmp_path / "e.npz")
    medians = [now.candidates for now in evolve(training, 3)]
    stored = np.load(tmp_path / "e.npz")
    assert stored["found"].shape == (3, 4, num_weights())
    assert np.median(stored["losses"], axis=1).tolist() == medians
    np.testing.assert_array_equal(stored["start"], imitated(1))
    network = WorthNetwork(unpacked(stored["found"][1, 2]), digest="")
    teams = draw_teams(TINY, np.random.default_rng([1, 2]))
    assert relative(teams, ages(teams, RuleOfThumb()), network) == stored["losses"][1, 2]


def test_the_file_is_asked_and_told_in_order(tmp_path):
    """Replayed by the library alone: the mean follows from the candidates and their losses."""
    training = begin(tmp_path / "e.npz")
    evolve(training, 3)
    stored = np.load(tmp_path / "e.npz")
    options = {"popsize": 4, "seed": 2, "verbose": -9}
    evolution = cma.CMAEvolutionStrategy(stored["start"], 0.1, options)
    for found, losses in zip(stored["found"], stored["losses"], strict=True):
        np.testing.assert_array_equal(np.stack(evolution.ask()), found)
        evolution.tell(list(found), list(losses))
    np.testing.assert_array_equal(flat(training), evolution.mean.astype(np.float32))


def test_other_seeds_are_other_trainings(tmp_path):
    starts, means = [], []
    for n, seed in enumerate((1, 1, 2)):
        training = begin(tmp_path / f"{n}.npz", seed)
        starts.append(flat(training))
        evolve(training, 1)
        means.append(flat(training))
    for first, same, other in (starts, means):
        np.testing.assert_array_equal(first, same)
        assert not np.array_equal(first, other)


def test_held_out_teams_are_never_trained_on(tmp_path, monkeypatch):
    drawn = []

    def noted(exercises, rng):
        drawn.append(draw_teams(exercises, rng))
        return drawn[-1]

    monkeypatch.setattr(plan_training, "draw_teams", noted)
    training = begin(tmp_path / "e.npz", measure_every=1)
    held_out = {team.links.received_mw.tobytes() for team in drawn.pop()}
    evolve(training, 3)
    trained_on = {team.links.received_mw.tobytes() for teams in drawn for team in teams}
    assert len(held_out) == 3
    assert len(trained_on) == (plan_training.IMITATED_TEAMS + 3) * 3
    assert not held_out & trained_on


def test_progress_is_measured_now_and_then_on_held_out_teams(tmp_path):
    training = begin(tmp_path / "e.npz", measure_every=2)
    measured = []
    for now in training.generations():
        if now.generation == 5:
            break
        measured.append(now.held_out)
        if now.generation % 2 == 0:
            assert now.held_out == training.measure()
    assert np.isnan(measured).tolist() == [True, False, True, False]
    teams = draw_teams(TINY, np.random.default_rng([500_000, 500_000]))
    network = WorthNetwork(training.mean, digest="")
    expected = relative(teams, ages(teams, RuleOfThumb()), network)
    assert training.measure() == expected != 1.0


def test_the_rule_is_as_old_as_itself():
    teams = draw_teams(TINY, np.random.default_rng(0))
    assert relative(teams, ages(teams, RuleOfThumb()), RuleOfThumb()) == 1.0


def test_exercises_count_alike_whatever_their_number_of_teams_by_hand(monkeypatch):
    """Teams of "few" are 1.2 and 1.4 times as old as by the rule, that of "walk" 0.7 times."""
    teams = draw_teams(TINY, np.random.default_rng(0))
    known = {id(team): age for team, age in zip(teams, (12.0, 28.0, 21.0), strict=True)}
    monkeypatch.setattr(plan_training, "mean_age", lambda team, _: known[id(team)])
    network = WorthNetwork(unpacked(np.zeros(num_weights())), digest="")
    rule = np.array([10.0, 20.0, 30.0])
    assert relative(teams, rule, network) == pytest.approx((1.3 + 0.7) / 2)


def test_the_network_begins_as_the_rule(monkeypatch):
    """On teams that it has not seen: the rule's squared weights up to one factor, and its share."""
    monkeypatch.setattr(plan_training, "IMITATION_STEPS", 1500)
    monkeypatch.setattr(plan_training, "IMITATED_TEAMS", 6)
    network = WorthNetwork(unpacked(imitated(4)), digest="")
    for team in draw_teams(TINY, np.random.default_rng(77)):
        rule, own = RuleOfThumb()(team.believed[0]), network(team.believed[0])
        others = ~np.eye(len(rule.squared), dtype=bool)
        unit = 8.0 * 2 * len(rule.squared) / 4.0
        np.testing.assert_allclose(
            own.squared[others] * unit, rule.squared[others], rtol=0.25, atol=0.25
        )
        assert np.max(np.abs(own.linear)) < 0.05
        assert own.least_share == pytest.approx(rule.least_share, abs=0.05)


def test_equal_seeds_imitate_alike():
    np.testing.assert_array_equal(imitated(3), imitated(3))
    assert not np.array_equal(imitated(3), imitated(4))
    assert len(imitated(3)) == sum(int(np.prod(shape)) for shape in SHAPES.values())


def test_the_real_exercises_are_those_of_the_practice(monkeypatch):
    monkeypatch.undo()
    assert plan_training.EXERCISES is EXERCISES


@pytest.mark.parametrize(("seed", "step_size"), [(2, 0.01), (1, 0.02)])
def test_a_file_of_another_seed_or_step_size_is_refused(tmp_path, seed, step_size):
    evolve(PlanTraining(tmp_path / "e.npz", seed=1, step_size=0.01), 1)
    with pytest.raises(ValueError, match=r"begun with seed 1 and step size 0\.01"):
        PlanTraining(tmp_path / "e.npz", seed=seed, step_size=step_size)


def test_a_damaged_file_is_refused(tmp_path):
    (tmp_path / "e.npz").write_bytes(b"no archive")
    with pytest.raises(ValueError, match="no training's file"):
        PlanTraining(tmp_path / "e.npz", seed=1, step_size=0.01)
