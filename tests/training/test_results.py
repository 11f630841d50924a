"""All tables are flown from their study files, once, at one commit."""

import csv
from pathlib import Path

import pandas as pd
import pytest
import results as program
from results_table import TABLES

from swarm_mj.evaluation.results_files import read_results
from swarm_mj.system.exit_codes import DONE, INTERRUPTED
from swarm_mj.system.packages import commit

ROOT = Path(__file__).parents[2]
# Studies of fewer missions than the paper's 100: those that take longest.
SMALLER = {
    *("bodies", "ceiling", "elsewhere", "falls", "impairments", "position-noise"),
    *("converging-teams", "large-teams", "large-teams-small"),
}


@pytest.fixture(autouse=True)
def _in_the_checkout(monkeypatch):
    """Studies name policies by their places in it."""
    monkeypatch.chdir(ROOT)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The smallest study's tables, flown as a smoke test."""
    folder, before = tmp_path_factory.mktemp("made"), Path.cwd()
    assert fly(folder) == DONE
    assert Path.cwd() == before
    return folder


def fly(folder, *more):
    where = ("--results", str(folder), "--jobs", "1")
    return program.main(["--scale", "smoke", "--studies", "classics", *where, *more])


def test_a_table_has_each_policy_in_each_regime_and_a_row_for_each_mission(made):
    rows = read_results(made / "classics.csv")
    study = program.study_of("classics")
    assert [(row.task, row.policy) for row in rows] == [(r.task, p) for r, p in study.pairs]
    assert {(row.num_windows, row.episodes, row.seed) for row in rows} == {(12, 2, study.seed)}
    assert {row.commit for row in rows} == {commit()}
    ages = pd.read_parquet(made / "classics.parquet")["aoi"].to_numpy().reshape(len(rows), 2)
    assert list(ages.mean(axis=1)) == pytest.approx([row.aoi_mean for row in rows])
    assert not list((made / "drafts").iterdir())


def test_what_is_there_of_this_commit_is_kept(made, capsys, monkeypatch):
    before = (made / "classics.csv").stat().st_mtime_ns
    assert fly(made) == DONE
    assert "is there; --force flies it again" in capsys.readouterr().err
    assert (made / "classics.csv").stat().st_mtime_ns == before
    seen = []
    monkeypatch.setattr(program, "run_study", lambda *given: seen.append(given) or INTERRUPTED)
    monkeypatch.setattr(program, "commit", lambda: "of another code")
    assert fly(made) == INTERRUPTED
    assert len(seen) == 1


def test_an_interrupted_study_leaves_no_table(tmp_path, monkeypatch):
    monkeypatch.setattr(program, "run_study", lambda *_: INTERRUPTED)
    assert fly(tmp_path) == INTERRUPTED
    assert not list(tmp_path.glob("*.csv"))


def test_all_that_no_study_describes_is_flown_by_a_function():
    assert program.FLOWN_BY.keys() == set(program.OTHERS)


@pytest.mark.parametrize("name", program.STUDIES)
def test_every_study_can_be_read_and_says_its_missions(name):
    study = program.study_of(name)
    assert study.seed in (4500, 6200, 6300, 6400, 980_000)  # never those of tuning or training
    assert study.pairs


def test_policies_fly_as_many_missions_as_the_papers():
    episodes = {name: program.study_of(name).episodes for name in program.STUDIES}
    assert {name for name, number in episodes.items() if number != 100} == SMALLER


@pytest.mark.parametrize("table", TABLES)
def test_every_table_of_the_docs_is_of_results_that_are_flown(table):
    spec = TABLES[table]
    parts = (spec, *spec.get("columns", ()), *spec.get("rows", ()), *spec.get("more", ()))
    named = [part["results"] for part in parts if isinstance(part, dict) and "results" in part]
    names = {name for each in named for name in ([each] if isinstance(each, str) else each)}
    known = {*program.STUDIES, *program.OTHERS, "published", "peers", "exact", "converging-late"}
    assert {name for name in names if not name.startswith("reproduce/")} <= known


@pytest.mark.slow
@pytest.mark.parametrize("name", program.STUDIES)
def test_a_committed_table_has_all_rows_of_its_study(name):
    with (ROOT / "training" / "results" / f"{name}.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    study = program.study_of(name)
    assert [row["policy"] for row in rows] == [policy for _, policy in study.pairs]
    assert {row["episodes"] for row in rows} == {str(study.episodes)}
    assert (ROOT / "training" / "results" / f"{name}.parquet").exists()
