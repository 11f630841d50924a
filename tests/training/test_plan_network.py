"""The script that trains the planner's network: it goes on, and keeps the best."""

import csv
import importlib.util
import json
import sys
from itertools import islice
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from swarm_mj.learning import plan_training
from swarm_mj.learning.plan_practice import Exercise
from swarm_mj.learning.plan_training import Progress
from swarm_mj.mission import paper
from swarm_mj.policies.stored_scorer import load_scorer
from swarm_mj.policies.worth_network import num_weights, unpacked

FILE = Path(__file__).parent.parent.parent / "training" / "plan_network.py"
STEP_S = 30.0  # that each generation is made to take


@pytest.fixture
def script(tmp_path, monkeypatch):
    """The script with a clock of its own, in a folder of its own."""
    spec = importlib.util.spec_from_file_location("plan_network", FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    seconds = iter(np.arange(0.0, 1e6, STEP_S))
    monkeypatch.setattr(module, "OUT", tmp_path / "runs" / "plan_network")
    monkeypatch.setattr(module, "CURVE", tmp_path / "results" / "curve.csv")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(module, "time", SimpleNamespace(monotonic=lambda: next(seconds)))
    monkeypatch.setattr(module, "commit", lambda: "abc")
    return module


class Told:
    """A training whose held-out ages are told; its weights are the generation's number."""

    measured = (np.nan, 0.97, np.nan, 0.93, np.nan, 0.95, np.nan, 0.91)

    def __init__(self, path, **options):
        self.path, self.options = path, options
        self.generation = int(path.read_text()) if path.exists() else 0

    @property
    def mean(self):
        return unpacked(np.full(num_weights(), float(self.generation)))

    def generations(self):
        while True:
            self.generation += 1
            self.path.write_text(str(self.generation))
            yield Progress(
                generation=self.generation,
                candidates=1.0,
                held_out=self.measured[self.generation - 1],
                step_size=0.01,
            )


@pytest.fixture
def told(script, monkeypatch):
    """The trainings that the script begins."""
    begun = []

    def begin(path, **options):
        begun.append(Told(path, **options))
        return begun[-1]

    monkeypatch.setattr(script, "PlanTraining", begin)
    return begun


def called(script, monkeypatch, *arguments):
    monkeypatch.setattr(sys, "argv", ["plan_network.py", *arguments])
    return script.main()


def rows(path):
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def kept():
    """The generation whose weights were kept, and what is said of them."""
    folder = Path("runs/plan_network/policy")
    config = json.loads((folder / "config.json").read_text())
    expected = unpacked(np.full(num_weights(), float(config["training"]["generations"])))
    plain = load_scorer(folder)._parameters
    assert all(np.array_equal(plain[name], array) for name, array in expected.items())
    return config["training"], (folder / "README.md").read_text()


def test_it_trains_for_its_minutes_and_keeps_the_best(script, told, monkeypatch):
    """Half a minute a generation: six in three minutes, of which the fourth was best."""
    assert called(script, monkeypatch, "--minutes", "3", "--seed", "5", "--step-size", "0.2") == 0
    (training,) = told
    assert training.options == {"seed": 5, "step_size": 0.2}
    facts, card = kept()
    assert facts == {
        "command": "python training/plan_network.py --minutes 3 --seed 5",
        "seed": 5,
        "minutes": 2.0,
        "generations": 4,
        "held_out": 0.93,
        "commit": "abc",
        "version": script.version(),
    }
    assert f"{num_weights()} weights" in card
    assert "`python training/plan_network.py --minutes 3 --seed 5`" in card
    assert "of generation 4, of 24\n  candidates each, after 2.0 minutes" in card
    assert "0.930" in card


def test_the_curve_has_a_row_a_generation(script, told, monkeypatch):
    called(script, monkeypatch, "--minutes", "3")
    curve = rows(script.CURVE)
    assert tuple(curve[0]) == script.COLUMNS
    assert [row["minutes"] for row in curve] == ["0.50", "1.00", "1.50", "2.00", "2.50", "3.00"]
    assert [row["generation"] for row in curve] == list("123456")
    expected = ["nan", "0.97000", "nan", "0.93000", "nan", "0.95000"]
    assert [row["held_out"] for row in curve] == expected
    assert script.CURVE.read_text() == (script.OUT / "curve.csv").read_text()
    assert len(told) == 1


def test_started_again_it_has_the_rest_of_its_minutes(script, told, monkeypatch):
    """Two minutes, then four in all; then there is nothing left to do."""
    called(script, monkeypatch, "--minutes", "2")
    assert [row["generation"] for row in rows(script.CURVE)] == list("1234")
    called(script, monkeypatch, "--minutes", "4")
    assert [row["generation"] for row in rows(script.CURVE)] == list("12345678")
    assert rows(script.CURVE)[-1]["minutes"] == "4.00"
    assert kept()[0]["held_out"] == 0.91
    before = script.CURVE.read_text()
    called(script, monkeypatch, "--minutes", "4")
    assert script.CURVE.read_text() == before
    assert len(told) == 3


def test_what_was_better_before_the_interruption_is_kept(script, told, monkeypatch):
    """The sixth generation, measured after it, is no better than the fourth."""
    called(script, monkeypatch, "--minutes", "2")
    called(script, monkeypatch, "--minutes", "3.5")
    assert len(told) == 2
    assert kept()[0]["generations"] == 4


def test_an_interruption_says_how_to_go_on(script, told, monkeypatch, capsys):
    """And what was done until then counts."""

    def interrupted(self):
        yield from islice(Told.generations(self), 1)
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr(script, "PlanTraining", type("Cut", (Told,), {"generations": interrupted}))
        assert called(script, monkeypatch, "--minutes", "2") == 130
    assert "interrupted; start it again to go on" in capsys.readouterr().err
    assert not script.CURVE.exists()
    assert [row["generation"] for row in rows(script.OUT / "curve.csv")] == ["1"]
    assert called(script, monkeypatch, "--minutes", "2") == 0
    assert [row["minutes"] for row in rows(script.CURVE)] == ["0.50", "1.00", "1.50", "2.00"]
    assert len(told) == 1


def test_a_real_training_of_moments_leaves_a_policy(script, monkeypatch):
    """Ten generations, to the first measurement; and further ones from its file."""
    tiny = {"few": Exercise(mission=paper("stationary", num_robots=3), num_teams=1)}
    monkeypatch.setattr(plan_training, "EXERCISES", tiny)
    monkeypatch.setattr(plan_training, "IMITATION_STEPS", 5)
    monkeypatch.setattr(plan_training, "POPULATION", 4)
    assert called(script, monkeypatch, "--minutes", "5") == 0
    assert len(np.load(script.OUT / "evolution.npz")["found"]) == 10
    first = load_scorer(script.OUT / "policy").parameters
    assert called(script, monkeypatch, "--minutes", "5.5") == 0
    assert len(np.load(script.OUT / "evolution.npz")["found"]) == 11
    assert load_scorer(script.OUT / "policy").parameters == first
    last = rows(script.CURVE)[9]
    assert float(last["held_out"]) > 0.0
    assert len(rows(script.CURVE)) == 11
