"""The experiment behind `gnn` writes where it is told to, and goes on with runs that have begun."""

import runpy
from pathlib import Path

import pytest

FILE = Path(__file__).parents[2] / "training" / "shipped_gnn.py"


@pytest.fixture
def experiment(monkeypatch):
    """The experiment's names, and its commands; instead of working, each leaves a run's files."""
    seen = []

    def command(arguments):
        seen.append(arguments)
        if arguments[0] == "train":
            run = Path(arguments[arguments.index("--out") + 1])
            run.mkdir(parents=True, exist_ok=True)
            (run / "settings.json").write_text("{}")
            (run / "curve.csv").write_text("decisions,aoi\n")
        return 130 if "broken" in " ".join(arguments) else 0

    names = runpy.run_path(str(FILE))
    monkeypatch.setitem(names["_run"].__globals__, "swarm_mj", command)
    return names["ShippedGnn"], seen


def test_curves_and_results_go_where_the_options_say(experiment, tmp_path):
    make, seen = experiment
    for resumed in (False, True):
        assert make(runs=tmp_path / "runs", results=tmp_path / "results")() == 0
        trainings = [each for each in seen[-5:] if each[0] == "train"]
        assert ["--resume" in each for each in trainings] == [resumed] * 2
        assert seen[-1][-2:] == [str(tmp_path / "results" / "candidates-flocks.csv"), "--force"]
    names = sorted(path.name for path in (tmp_path / "results").iterdir())
    assert names == ["rest-curve.csv", "walk-curve.csv"]


@pytest.mark.slow
def test_a_command_that_fails_ends_the_experiment_with_its_code(experiment, tmp_path):
    make, seen = experiment
    assert make(runs=tmp_path / "broken", results=tmp_path)() == 130
    assert len(seen) == 1
