"""Results are of missions that chose nothing: no constant, no probability, no policy.

What missions chose stands in `training/seeds.toml`. A number that was chosen on the missions that
judge it flatters itself.
"""

import csv
import tomllib
from pathlib import Path

import pytest

from swarm_mj.envs.mission_batch import FIRST_TRAINING_SEED, LAST_TRAINING_SEED
from swarm_mj.learning.settings import CHOICE_SEED, HELD_OUT_SEED, TEST_SEED
from swarm_mj.policies.tuning import TABLE

ROOT = Path(__file__).parents[1]
CHOICES = tomllib.loads((ROOT / "training/seeds.toml").read_text())["choices"]
STUDIES = sorted(ROOT.glob("training/studies/*.toml")) + sorted(ROOT.glob("assets/studies/*.toml"))
RESULTS = sorted((ROOT / "training/results").rglob("*.csv"))


def chosen(first):
    """The entries that begin with a seed."""
    return [choice for choice in CHOICES if choice["first"] == first]


def ranges(path):
    """The missions of a file: pairs of the first seed and the one after the last."""
    if path.suffix == ".toml":
        study = tomllib.loads(path.read_text())["study"]
        return {(study["seed"], study["seed"] + study["episodes"])}
    with path.open() as lines:
        rows = [row for row in csv.DictReader(lines) if row.get("seed")]
    return {(int(row["seed"]), int(row["seed"]) + int(row.get("episodes") or 1)) for row in rows}


def chose_something(path):
    """Whether any mission of a file chose anything."""
    for first, end in ranges(path):
        for choice in CHOICES:
            if first < choice["first"] + choice["num"] and choice["first"] < end:
                return True
    return False


def test_no_result_has_missions_that_chose_something():
    found = set()
    for path in (*STUDIES, *RESULTS):
        if chose_something(path):
            found.add(str(path.relative_to(ROOT)))
    assert not found


@pytest.mark.parametrize(("seed", "is_chosen"), [(1999, True), (2008, False), (4500, False)])
def test_a_table_with_one_mission_that_chose_is_found(tmp_path, seed, is_chosen):
    table = tmp_path / "table.csv"
    table.write_text(f"policy,seed,episodes\ntdma,{seed},2\n")
    assert chose_something(table) == is_chosen


def test_seeds_of_results_are_read():
    """Of a study, of a table of missions side by side, and of one of single missions."""
    assert ranges(ROOT / "training/studies/ceiling.toml") == {(4500, 4520)}
    assert ranges(ROOT / "training/results/ceiling.csv") == {(4500, 4520)}
    assert (4519, 4520) in ranges(ROOT / "training/results/floor.csv")


@pytest.mark.parametrize("choice", CHOICES, ids=lambda choice: choice["chose"])
def test_choices_say_where_they_are_said(choice):
    assert choice.keys() == {"first", "num", "chose", "said"}
    assert choice["num"] > 0
    assert (ROOT / choice["said"]).is_file()


def test_the_list_agrees_with_the_code():
    (held_out,) = chosen(HELD_OUT_SEED)
    assert HELD_OUT_SEED < CHOICE_SEED < TEST_SEED == HELD_OUT_SEED + held_out["num"]
    (training,) = chosen(FIRST_TRAINING_SEED)
    assert FIRST_TRAINING_SEED + training["num"] == LAST_TRAINING_SEED
    with TABLE.open() as lines:
        rows = list(csv.DictReader(lines))
    for row in rows:
        (tuned,) = chosen(int(row["first_seed"]))
        assert int(row["episodes"]) <= tuned["num"]
