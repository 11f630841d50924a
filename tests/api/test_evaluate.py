"""Python finds what `swarm-mj evaluate` finds, to the last digit."""

import json
import re
from textwrap import dedent

import numpy as np
import pytest
from tiny_policies import save_tiny

import swarm_mj
from swarm_mj.api import evaluate as module
from swarm_mj.cli import main
from swarm_mj.evaluation.results import COLUMNS

SHORT = {"num_robots": 6, "num_windows": 20, "range_ratio": 0.5}
OPTIONS = ("--robots", "6", "--windows", "20", "--range-ratio", "0.5")


@pytest.fixture(scope="module")
def found():
    return swarm_mj.evaluate(
        ["tdma", "round-robin"], task="random-walk", num_missions=3, seed=2000, **SHORT
    )


@pytest.mark.parametrize("ending", ["csv", "json"])
def test_it_is_what_the_command_line_finds(here, found, ending):
    line = ["evaluate", "--policy", "tdma", "round-robin", "--task", "random-walk", *OPTIONS]
    assert main([*line, "--episodes", "3", "--seed", "2000", f"--{ending}", f"told.{ending}"]) == 0
    found.save(f"ours.{ending}")
    assert (here / f"ours.{ending}").read_text() == (here / f"told.{ending}").read_text()


def test_each_policy_has_its_numbers(found):
    assert list(found.summary) == ["tdma", "round-robin"]
    by_mission = found.to_dataframe(by_mission=True)
    assert list(by_mission.seed) == [2000, 2001, 2002] * 2
    means = by_mission.groupby("policy").aoi.mean()
    for policy in found.summary:
        assert found.summary[policy].aoi_mean == pytest.approx(means[policy])
    assert found.to_dataframe().aoi_mean.tolist() == [
        found.summary[policy].aoi_mean for policy in found.summary
    ]


def test_what_each_mission_s_task_cost_is_in_the_table_too(here):
    found = swarm_mj.evaluate("tdma", task="flocking", num_missions=2, **SHORT)
    found.save("found.json")
    (told,) = json.loads((here / "found.json").read_text())["results"]
    table = found.to_dataframe(by_mission=True)
    assert table.task_cost.tolist() == told["episode_task_cost"]
    assert table.task_cost.mean() == pytest.approx(found.summary.tdma.task_cost_mean)


def test_it_agrees_with_flights_one_by_one(found):
    ages = [
        swarm_mj.fly("random-walk", policy="tdma", seed=seed, record=False, **SHORT)
        for seed in (2000, 2001, 2002)
    ]
    mean = np.mean([run.summary.aoi_mean for run in ages])
    assert found.summary.tdma.aoi_mean == pytest.approx(mean)


def test_a_baseline_may_be_a_path_as_policies_may(here):
    save_tiny(here / "own")
    for typed in ("././own.safetensors", here / "own.safetensors"):
        found = swarm_mj.evaluate(["tdma", typed], num_missions=2, baseline=typed, **SHORT)
        tdma, own = (each.result for each in found.results)
        assert tdma.baseline == own.policy == own.baseline


def test_it_shows_itself_as_the_table(found, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")  # as a notebook's server does
    assert "\x1b" not in repr(found)
    assert repr(found).startswith("random-walk, preset paper: 6 robots")
    assert "round-robin" in repr(found)
    assert "round-robin" in found._repr_html_()


@pytest.mark.parametrize(
    ("policy", "keywords", "complaint"),
    [
        ("tdmaa", {}, "did you mean tdma?"),
        (
            "tdma",
            {"num_mission": 3},
            "evaluate got an unexpected keyword argument 'num_mission'; did you mean num_missions?",
        ),
        ("tdma", {"num_missions": 0}, "num_missions must be a whole number from 1 to 100000, not"),
        ("gnn", {"features": "mine:Feat"}, "on the features mine:Feat; leave them out"),
        ("tdma", {"num_jobs": 0}, "num_jobs must be a whole number from 1 to 256, not 0"),
        ("tdma", {"engine": "rya"}, "engine must be one of local, ray, slurm, not 'rya'; did you"),
        ("tdma", {"baseline": "mst"}, "baseline must be one of the policies evaluated"),
    ],
)
def test_what_is_wrong_is_told(policy, keywords, complaint):
    with pytest.raises((TypeError, ValueError)) as refused:
        swarm_mj.evaluate(policy, **keywords)
    assert complaint in str(refused.value)


def test_other_endings_are_refused(found, tmp_path):
    with pytest.raises(ValueError, match=r"must be named \*.csv or \*.json"):
        found.save(tmp_path / "a.rrd")


def test_what_is_not_installed_is_told_before_the_work(monkeypatch):
    monkeypatch.setattr("swarm_mj.system.packages.find_spec", lambda _module: None)
    words = r"an evaluation needs scipy, .* pip install 'scipy"
    with pytest.raises(ModuleNotFoundError, match=words):
        module.evaluate("tdma", num_missions=1, **SHORT)


def test_a_table_begins_with_what_one_looks_for(found):
    columns = list(found.to_dataframe().columns)
    assert columns[:4] == ["policy", "num_robots", "aoi_mean", "aoi_sem"]
    assert columns[-3:] == ["aoi_ci_low", "aoi_ci_high", "packets_per_window"]
    assert sorted(columns) == sorted(COLUMNS)


@pytest.mark.parametrize("documented", [swarm_mj.fly, swarm_mj.evaluate, swarm_mj.Evaluation])
@pytest.mark.usefixtures("here")
def test_the_examples_of_docstrings_run(capsys, documented):
    (example,) = re.findall(r"```python\n(.*?)```", documented.__doc__, re.DOTALL)
    exec(dedent(example), {})
    assert capsys.readouterr().out
