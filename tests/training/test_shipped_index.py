"""The recipe of the shipped index: a short search on few missions writes numbers that fly."""

import runpy
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.index.shipped import SHIPPED
from swarm_mj.policies.index.weights import by_name, flat, from_names, from_tensors
from swarm_mj.policies.stored import read_weights

FILE = Path(__file__).parents[2] / "training" / "shipped_index.py"


@pytest.fixture(scope="module")
def recipe():
    return runpy.run_path(str(FILE))


def test_the_mix_has_what_would_drift_otherwise(recipe):
    training = recipe["TRAINING"]
    missions = training.kinds
    assert {each.task for each in missions} == {"stationary", "random-walk", "flocking"}
    assert {each.range_ratio for each in missions} >= {0.2, 0.25, 0.5, 1.0}
    assert max(each.num_robots for each in missions) == 200
    assert any(each.arena == "blocks" for each in missions)
    assert training.policy == "index-csma"


def test_a_short_search_writes_its_numbers_and_how_they_were_found(recipe, tmp_path, monkeypatch):
    small = replace(
        recipe["TRAINING"],
        mission=paper("stationary", num_robots=4, num_windows=10),
        other_missions=(paper("flocking", num_robots=5, num_windows=10),),
        missions=2,
        train_windows=(),
        evaluate_every=200,
        held_out=2,
    )
    make = recipe["ShippedIndex"]
    monkeypatch.setitem(make.__call__.__globals__, "TRAINING", small)
    out = tmp_path / "numbers.toml"
    assert make(minutes=0.01, run=tmp_path / "run", out=out)() == 0
    said = tomllib.loads(out.read_text())
    assert said["made"]["seed"] == small.seed
    tensors, _ = read_weights(tmp_path / "run")
    found = flat(from_tensors(tensors))
    assert flat(from_names(said["weights"])) == pytest.approx(found, rel=1e-4)
    assert make(minutes=0.02, run=tmp_path / "run", out=out)() == 0  # goes on


def test_the_shipped_file_is_one_that_the_recipe_writes():
    said = tomllib.loads(SHIPPED.read_text())
    assert said.keys() == {"made", "weights"}
    assert by_name(from_names(said["weights"])).keys() == said["weights"].keys()
