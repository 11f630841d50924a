"""The committed results are what this code makes of their missions, policies and seeds."""

import csv
import json
from dataclasses import fields
from pathlib import Path

import pytest

from swarm_mj.cli.mission_options import mission_flags
from swarm_mj.mission import Mission

pytestmark = pytest.mark.slow

FILE = Path(__file__).parents[2] / "training" / "results" / "paper-random-walk.csv"
CHEAP = (
    *("tdma", "round-robin", "mst", "random-flooding", "spatial-tdma", "sotdma", "planner"),
    *("index-csma", "gnn"),
)


def read(path):
    """Of the cheap policies in teams of ten: each row's cells by their columns."""
    with path.open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["num_robots"] == "10"]
    return {row["policy"]: row for row in rows if row["policy"] in CHEAP}


@pytest.fixture(scope="module")
def committed():
    return read(FILE)


@pytest.fixture(scope="module")
def made(committed, forks, tmp_path_factory):
    """The same rows, of the same missions, as this code makes them."""
    row, folder = next(iter(committed.values())), tmp_path_factory.mktemp("made")
    config = json.loads(row["config"])
    known = {spec.name for spec in fields(Mission)} & config.keys()  # others were added since
    mission = Mission(**{name: config[name] for name in known})
    done = forks.run(
        *(folder, "swarm_mj", "evaluate", "--csv", "r.csv", *mission_flags(mission).split()),
        *("--policy", *committed, "--baseline", row["baseline"]),
        *("--episodes", row["episodes"], "--seed", row["seed"]),
    )
    assert done.returncode == 0, done.stderr
    return read(folder / "r.csv")


@pytest.mark.parametrize("policy", CHEAP)
def test_a_committed_row_is_what_its_command_makes(committed, made, policy):
    row, again = committed[policy], made[policy]
    assert row.keys() <= again.keys()  # columns may have been added since
    for column in row.keys() - {"version", "commit", "config"}:
        try:
            expected = pytest.approx(float(again[column]), rel=1e-9)
        except ValueError:  # a name, or nothing
            assert row[column] == again[column], column
        else:
            assert float(row[column]) == expected, column
    assert json.loads(row["config"]).items() <= json.loads(again["config"]).items()
