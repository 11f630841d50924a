"""The learning experiments write where they are told to, and go on with runs that have begun."""

import importlib
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent.parent.parent / "training"


@pytest.fixture
def calls(monkeypatch):
    """The experiment's commands; instead of working, each leaves the files of a run."""
    monkeypatch.syspath_prepend(str(FOLDER))
    learning = importlib.import_module("learning")
    seen = []

    def command(arguments):
        seen.append(arguments)
        if arguments[0] == "train":
            run = Path(arguments[arguments.index("--out") + 1])
            run.mkdir(parents=True, exist_ok=True)
            (run / "settings.json").write_text("{}")
            (run / "curve.csv").write_text("decisions,aoi\n")
        return 130 if "broken" in " ".join(arguments) else 0

    monkeypatch.setattr(learning, "swarm_mj", command)
    return seen


def test_curves_and_results_go_where_the_options_say(calls, tmp_path):
    team_sizes = importlib.import_module("team_sizes")
    where = ["--runs", str(tmp_path / "runs"), "--results", str(tmp_path / "results")]
    for resume in ([], ["--resume"]):
        assert team_sizes.run(team_sizes.TeamSizes, [*where, "--flown-with", "5", "6"]) == 0
        train, evaluate = calls[-2:]
        assert ("--resume" in train) == bool(resume)
        assert evaluate[-2:] == [str(tmp_path / "results" / "trained-on-20.csv"), "--force"]
    names = [path.name for path in (tmp_path / "results").iterdir()]
    assert names == ["robot-20-seed0-curve.csv"]


def test_a_command_that_fails_ends_the_experiment_with_its_code(calls, tmp_path):
    team_sizes = importlib.import_module("team_sizes")
    assert team_sizes.run(team_sizes.TeamSizes, ["--runs", str(tmp_path / "broken")]) == 130
    assert len(calls) == 1
