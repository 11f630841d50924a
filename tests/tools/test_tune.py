"""Tuning in small, and the tool as a process."""

import signal
import subprocess
import sys
import time
from functools import partial
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from swarm_mj.mission import paper, reference
from swarm_mj.policies.registry import POLICIES, make_policy
from swarm_mj.policies.tuning import read_table
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.writing import owned

TOOL = Path(__file__).parent.parent.parent / "tools" / "tune.py"
QUICK = ("--episodes", "2", "--windows", "3")


@pytest.fixture(scope="module")
def tool():
    return import_module("tune")


@pytest.fixture
def run(forks, tmp_path):
    """Runs the tool in an empty folder; returns the finished process."""
    return partial(forks.run, tmp_path, TOOL)


def search(tool, grid, make=paper):
    return tool.Search(policy="mst", mission=make("stationary"), grid=grid)


def with_ages(tool, monkeypatch, age_of):
    """Lets `age_of` say what a probability costs; returns the list of those flown."""
    flown = []

    def ages(_search, probability, _seeds):
        flown.append(probability)
        return age_of(probability) + np.array([-1.0, 0.0, 4.0])

    monkeypatch.setattr(tool, "ages", ages)
    return flown


def test_iv_c_ages_are_those_of_the_flights(tool):
    mission = paper("flocking", num_robots=5, range_ratio=1.0, num_windows=9)
    one = tool.Search(policy="gossip", mission=mission, grid=(0.3,))
    expected = summarise(list(rollout(Swarm(mission, [3, 4]), make_policy("gossip", mission, 0.3))))
    np.testing.assert_allclose(tool.ages(one, 0.3, [3, 4]), expected.aoi_mean, rtol=1e-12)


@pytest.mark.parametrize("guess", [0.1, 0.3, 0.7])
@pytest.mark.parametrize("best", [0.1, 0.4, 0.7])
def test_the_walk_ends_at_the_least_age(tool, monkeypatch, guess, best):
    """From wherever it starts, of an age that falls and then rises; nothing is flown twice."""
    grid = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    flown = with_ages(tool, monkeypatch, lambda p: 30.0 + (p - best) ** 2)
    row = tool.tune(search(tool, grid), range(7, 10), guess)
    assert row.probability == best
    assert len(flown) == len(set(flown))
    neighbours = {p for p in grid if 0.05 < abs(p - best) < 0.15}
    assert neighbours <= set(flown)


def test_iv_c_the_authors_grid_is_flown_whole(tool, monkeypatch):
    """So that no dip on the way hides the best."""
    assert tool.AUTHORS_GRID == (0.04, 0.06, 0.08, 0.1, 0.12, 0.15)
    flown = with_ages(tool, monkeypatch, lambda p: 5.0 if p == 0.15 else 6.0 + abs(p - 0.06))
    row = tool.tune(search(tool, tool.AUTHORS_GRID), range(3), 0.06)
    assert row.probability == 0.15
    assert sorted(flown) == list(tool.AUTHORS_GRID)


def test_iv_c_every_probability_has_its_grid_the_authors_where_numbers_are_published(tool):
    for policy in ("random-flooding", "mst"):
        assert tool.grid_of(policy, "reference") == tool.AUTHORS_GRID
        assert set(tool.AUTHORS_GRID) < set(tool.grid_of(policy, "paper"))
        assert min(tool.grid_of(policy, "paper")) == 0.01
    for policy in ("aloha", "csma", "gossip"):
        assert tool.grid_of(policy, "paper") == tool.grid_of(policy, "reference")
    parameters = {name: make_policy(name, paper()).parameters for name in POLICIES}
    assert list(tool.HAVE_PROBABILITY) == [n for n in POLICIES if "probability" in parameters[n]]
    for one in tool.searches(tool.HAVE_PROBABILITY, 500):
        assert list(one.grid) == sorted(set(one.grid))


def test_a_row_says_what_was_measured(tool, monkeypatch):
    """Three missions of 29, 30 and 34 windows: mean 31, standard error 1.5275."""
    with_ages(tool, monkeypatch, lambda _: 30.0)
    row = tool.tune(search(tool, (0.2,), reference), range(7, 10), 0.2)
    assert (row.policy, row.preset, row.task) == ("mst", "reference", "stationary")
    assert (row.num_robots, row.range_ratio, row.velocity_ratio) == (40, 0.25, 0.15)
    assert (row.episodes, row.first_seed) == (3, 7)
    assert row.aoi_mean == 31.0
    assert row.aoi_sem == pytest.approx(stats.sem([29.0, 30.0, 34.0]), abs=5e-5)


def test_the_next_search_starts_where_the_last_ended(tool, monkeypatch, capsys):
    """The best at a grid's end is reported."""
    grid = (0.1, 0.2, 0.3, 0.4, 0.5)
    flown = with_ages(tool, monkeypatch, lambda p: abs(p - 0.4))
    work = [search(tool, grid), search(tool, grid), search(tool, (0.6, 0.7, 0.8))]
    rows = tool._tune_all(work, range(3), tool.Console(soft_wrap=True))
    assert "mst paper stationary, 40 robots, range 0.25" in capsys.readouterr().out
    assert [row.probability for row in rows] == [0.4, 0.4, 0.6]
    assert flown == [0.3, 0.2, 0.4, 0.5, 0.4, 0.3, 0.5, 0.7, 0.6, 0.8]


@pytest.mark.slow
def test_one_policy_alone_keeps_the_rows_of_the_others(tool, run, tmp_path):
    path = tmp_path / "tuned.csv"
    tool.write_table(read_table(tool.TABLE), path)
    done = run("--policy", "gossip", *QUICK, "--seed", "8", "--out", path)
    assert done.returncode == 0, done.stderr
    assert "28 of 140 probabilities tuned" in done.stderr
    with owned(path):
        done = run("--policy", "mst", *QUICK, "--out", path)
    assert done.returncode == 2
    assert "is being written by process" in done.stderr
    before, after = read_table(tool.TABLE), read_table(path)
    assert after[:112] == before[:112]
    assert {(row.policy, row.first_seed) for row in after[112:]} == {("gossip", 8)}


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--policy", "tdma"], "one of random-flooding, mst, aloha, csma, gossip, not 'tdma'"),
        (["--episodes", "1"], "episodes must be a whole number from 2 to 10000, not 1"),
        (["--seed", "-1"], "seeds must be"),
        (["--windows", "0"], "number of windows must be"),
        (["--out", "."], ". is a folder"),
        (["--policy", "mst", "--out", "missing.csv"], "missing.csv"),
    ],
)
def test_bad_input_is_one_clear_line_and_leaves_nothing(run, tmp_path, arguments, complaint):
    out = [] if "--out" in arguments else ["--out", "a.csv"]
    done = run(*QUICK, *out, *arguments)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


# Tunes as the tool does, and tells by a file when it is well under way.
TUNE_AND_TELL = f"""
import runpy, signal, sys
from pathlib import Path
from swarm_mj.simulation import swarm
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored
step = swarm.Swarm.step
def told(self, policy):
    Path("under-way").touch()
    return step(self, policy)
swarm.Swarm.step = told
runpy.run_path({str(TOOL)!r}, run_name="__main__")
"""


@pytest.mark.slow
def test_ctrl_c_leaves_the_table_as_it_was(tmp_path):
    table = tmp_path / "a.csv"
    table.write_text("precious")
    tuning = subprocess.Popen(
        [sys.executable, "-c", TUNE_AND_TELL, "--out", "a.csv"],
        cwd=tmp_path, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while tuning.poll() is None and not (tmp_path / "under-way").exists():
        time.sleep(0.01)
    tuning.send_signal(signal.SIGINT)
    _, errors = tuning.communicate(timeout=120)
    assert tuning.returncode == 130, errors
    assert "interrupted" in errors
    assert table.read_text() == "precious"
    assert {path.name for path in tmp_path.iterdir()} == {"a.csv", "under-way"}
