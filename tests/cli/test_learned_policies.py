"""Learned policies where the others are: flown, evaluated, resumed, drawn."""

import json

import pytest
from tiny_policies import save_tiny

from swarm_mj.cli import main
from swarm_mj.evaluation.batch import fly_batch
from swarm_mj.evaluation.flying import progress_path, start_progress
from swarm_mj.evaluation.results_files import read_results
from swarm_mj.evaluation.study import Study
from swarm_mj.mission import paper
from swarm_mj.replay.read import windows

pytestmark = pytest.mark.usefixtures("runs")
SMALL = ("--robots", "5", "--windows", "12", "--range-ratio", "0.5")


@pytest.fixture
def runs(tmp_path, monkeypatch):
    """A working directory with two trained policies."""
    monkeypatch.chdir(tmp_path)
    save_tiny(tmp_path / "runs" / "x" / "policy", "extended")
    save_tiny(tmp_path / "runs" / "y" / "policy", "paper", seed=2)
    return tmp_path / "runs"


def test_a_flight_is_recorded_and_summed_up(succeed, tmp_path):
    done = succeed("fly", *SMALL, "--policy", "runs/x/policy", "--json", "s.json")
    assert done.stderr.strip() == ""
    assert "flocking, runs/x/policy, 5 robots" in done.stdout
    (replay,) = (tmp_path / "replays").iterdir()
    assert replay.name.startswith("flocking-x-seed1-")
    assert len(windows(replay)) == 12
    config = json.loads((tmp_path / "s.json").read_text())["config"]
    assert config["policy"] == "runs/x/policy"
    assert config["receptive_field"] == 1
    assert config["is_deterministic"] is False
    assert len(config["digest"]) == 12


@pytest.mark.parametrize(
    ("folder", "policy"), [(".", "runs/y"), ("runs", "y"), ("runs/y", "."), ("runs/x", "../y/")]
)
def test_a_replay_is_named_after_the_policys_directory(tmp_path, monkeypatch, folder, policy):
    monkeypatch.chdir(tmp_path / folder)
    assert main(["fly", *SMALL, "--policy", policy]) == 0
    (replay,) = (tmp_path / folder / "replays").iterdir()
    assert replay.name.startswith("flocking-y-seed1-")


def test_the_mode_is_flown_on_request(runs):
    costs = []
    for name, options in {"a": [], "b": ["--deterministic"], "c": ["--deterministic"]}.items():
        flown = ["fly", *SMALL, "--policy", "runs/x/policy", "--no-record", *options]
        assert main([*flown, "--seed", "2", "--json", f"{name}.json"]) == 0
        costs.append(json.loads((runs.parent / f"{name}.json").read_text()))
        del costs[-1]["wall_seconds"]
    drawn, mode, again = costs
    assert mode == again
    assert drawn["packets_attempted"] != mode["packets_attempted"]


REFUSED = {
    "fly --policy runs/z": "there is no policy runs/z; name a .safetensors file",
    "fly --policy runs": "runs holds policies; name one of them: runs/x/policy.saf",
    "fly --policy runs/y --probability 0.1": "takes no transmission probab",
    "fly --policy mst --deterministic": "applies to learned policies only, not to mst",
    "evaluate --policy mst --deterministic": "none is among mst; leave it out",
    "evaluate --policy runs/y --baseline runs/x": "not 'runs/x'; add it to them",
}


@pytest.mark.parametrize("line", REFUSED)
def test_bad_input_is_one_clear_line(refusal, line):
    assert REFUSED[line] in refusal(*line.split())


@pytest.mark.slow
def test_an_evaluation_beside_other_policies(capsys, tmp_path):
    """The same numbers from one process and from two; names as typed, without what is too much."""
    policies = ["--policy", "runs/x/policy", "runs/y", "mst", "runs/y", "--baseline", "runs/y"]
    for jobs in ("1", "2"):
        evaluated = ["evaluate", *SMALL, *policies, "--episodes", "30", "--jobs", jobs]
        assert main([*evaluated, "--csv", f"{jobs}.csv", "--json", f"{jobs}.json"]) == 0
    for kind in ("csv", "json"):
        one, two = ((tmp_path / f"{jobs}.{kind}").read_bytes() for jobs in "12")
        assert one == two
    results = read_results(tmp_path / "1.csv")
    assert [result.policy for result in results] == ["runs/x/policy", "runs/y", "mst"]
    assert {result.baseline for result in results} == {"runs/y"}
    assert [result.probability is None for result in results] == [True, True, False]
    configs = [json.loads(result.config) for result in results]
    assert [config.get("receptive_field") for config in configs] == [1, 1, None]
    assert configs[0]["digest"] != configs[1]["digest"]
    assert "runs/x/policy" in capsys.readouterr().out


def test_deterministic_learned_policies_fly_beside_others(tmp_path):
    options = ["--policy", "runs/y", "mst", "--episodes", "2", "--deterministic", "--csv", "r.csv"]
    assert main(["evaluate", *SMALL, *options]) == 0
    configs = [json.loads(result.config) for result in read_results(tmp_path / "r.csv")]
    assert [config.get("is_deterministic") for config in configs] == [True, None]


def test_a_resumed_evaluation_is_of_the_same_weights(capsys, runs, tmp_path):
    """An evaluation that only began: its progress file holds what it depends on."""
    evaluated = ["evaluate", *SMALL, "--policy", "runs/y", "--episodes", "2", "--csv", "r.csv"]
    progress = progress_path(tmp_path / "r.csv")
    study = Study(
        policies=("runs/y",),
        regimes=(paper("flocking", num_robots=5, num_windows=12, range_ratio=0.5),),
        episodes=2,
    )
    start_progress(progress, study.header())
    save_tiny(runs / "y" / "policy", "paper", seed=3)
    assert main([*evaluated, "--resume"]) == 2
    assert "is of another evaluation: its digest is" in capsys.readouterr().err
    save_tiny(runs / "y" / "policy", "paper", seed=2)
    assert main([*evaluated, "--resume"]) == 0
    assert not progress.exists()


def test_weights_that_change_amid_an_evaluation_are_noticed(runs):
    """Training may replace the policy meanwhile; a result is of one policy."""
    mission = paper("stationary", num_robots=5, num_windows=3)
    study = Study(policies=("runs/y",), regimes=(mission,), episodes=1)
    fly_batch(study.batches[0])
    before = study.config("runs/y", mission)
    save_tiny(runs / "y" / "policy", "paper", seed=3)
    with pytest.raises(ValueError, match="policy runs/y has changed since the evaluation began"):
        fly_batch(study.batches[0])
    assert study.config("runs/y", mission) == before
