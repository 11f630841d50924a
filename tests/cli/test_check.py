"""`swarm-mj check` as a process: what it prints, writes and refuses, and its exit codes."""

import json
from itertools import islice

import pytest
from tiny_policies import tiny_config

from swarm_mj import check_convergence
from swarm_mj.cli import check, main, parse
from swarm_mj.cli.check import MOST_JOBS
from swarm_mj.evaluation.convergence import converging
from swarm_mj.mission import paper
from swarm_mj.policies import registry
from swarm_mj.policies.gnn.own_networks import load_network, make_network
from swarm_mj.policies.policy_config import GnnShape
from swarm_mj.policies.stored import save_gnn
from swarm_mj.system.terminal import num_cores

SMALL = ("--robots", "8", "--windows", "60", "--range-ratio", "0.5", "--policy", "tdma")
CONTROLLER = """
import numpy as np

class Rest:
    cost_name, cost_unit = "mean speed", "m/s"
    def __call__(self, buffers, states):
        return -states.velocity_mps
    def cost(self, states):
        return np.linalg.norm(states.velocity_mps, axis=2).mean(axis=1)
"""


@pytest.mark.parametrize(
    ("claim", "code", "verdict"),
    [
        (("--within", "5", "--share", "0.5"), 0, "holds"),
        (("--within", "0.5", "--share", "0.5"), 3, "does not hold"),
        (("--within", "5", "--share", "0.97", "--episodes", "10"), 4, "not decided"),
    ],
)
def test_the_exit_code_is_the_verdict(swarm_mj, tmp_path, claim, code, verdict):
    done = swarm_mj("check", "flocking", *SMALL, *claim, "--json", "a.json", "--plot", "a.svg")
    assert done.returncode == code, done.stderr
    assert f"verdict:    {verdict}\n" in done.stdout
    assert ("More missions (--episodes) may decide" in done.stderr) == (verdict == "not decided")
    assert done.stdout.endswith("Wrote a.json\nWrote a.svg\n")
    told = json.loads((tmp_path / "a.json").read_text())
    assert told["verdict"] == verdict
    assert (tmp_path / "a.svg").read_bytes().startswith(b"<?xml")


def test_the_task_and_the_claim_have_defaults():
    _, options = parse(["check"])
    assert options.mission == paper("flocking")
    assert options.policy == "planner"
    assert (options.goal.within_s, options.goal.share, options.goal.level) == (10.0, 0.8, 0.95)
    assert options.goal.below is None
    assert options.jobs == min(num_cores(), MOST_JOBS)
    assert parse(["check", "random-walk"])[1].mission.task == "random-walk"


def test_a_controller_of_one_s_own_is_checked_by_its_cost(succeed, refusal, tmp_path):
    (tmp_path / "mine.py").write_text(CONTROLLER)
    line = ("check", "flocking", *SMALL, "--controller", "mine:Rest", "--within", "5")
    done = succeed(*line, "--below", "1", "--unit", "m/s")
    assert "converged:  mean speed below 1 m/s, for good" in done.stdout
    assert "is in m/s, not m" in refusal(*line, "--below", "1", "--unit", "m")
    assert "say below which number of it" in refusal(*line)


@pytest.mark.parametrize(("task", "is_said"), [("stationary", False), ("random-walk", True)])
def test_only_a_policy_that_flies_as_another_is_said_to(capsys, here, monkeypatch, task, is_said):
    """Without a payload, robots at rest agree on a plan all the same."""
    monkeypatch.syspath_prepend(str(here))
    (here / "resting.py").write_text(CONTROLLER)
    line = ["check", task, "--robots", "4", "--windows", "20", "--payload", "none"]
    goal = ["--within", "1", "--below", "1", "--episodes", "1", "--jobs", "1"]
    main([*line, *goal, "--controller", "resting:Rest"])
    assert (registry.FLOWN_AS in capsys.readouterr().err.replace("\n", " ")) == is_said


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (("--within", "7"), "is after the missions' end at 6 s; fly at least 70 windows"),
        (("--share", "95"), "share must be a number from 0.001 to 0.999, not 95"),
        (("--unit", "m"), "unit m is that of below"),
        (("--policy", "polcy"), "polcy"),
        (("--json", "a.csv"), "--json must"),
    ],
)
def test_what_is_wrong_is_refused_before_the_flight(refusal, line, message):
    assert message in refusal("check", "flocking", *SMALL, *line)


@pytest.mark.parametrize("name", ["random-walk", "stationary"])
def test_tasks_without_a_cost_are_refused(refusal, name):
    assert f"{name} has no cost" in refusal("check", name, *SMALL)


@pytest.mark.parametrize(
    ("num_batches", "said"),
    [(0, "Interrupted before the first"), (2, "Interrupted after 50 missions; these are shown")],
)
def test_an_interrupted_check_shows_what_it_knows(monkeypatch, capsys, here, num_batches, said):
    """Its claim is true just so, and would take thousands of missions."""

    def interrupted(study, goal, engine):
        yield from islice(converging(study, goal, engine), num_batches)
        raise KeyboardInterrupt

    monkeypatch.setattr(check, "converging", interrupted)
    line = ["check", "flocking", *SMALL, "--within", "5", "--share", "0.98", "--jobs", "1"]
    assert main([*line, "--json", "a.json"]) == 130
    printed = capsys.readouterr()
    assert said in printed.err
    assert ("verdict:    not decided" in printed.out) == (num_batches > 0)
    assert (here / "a.json").exists() == (num_batches > 0)


def test_a_policy_may_decide_by_a_network_of_ones_own(tmp_path):
    name = "tiny_networks:Plain"
    load_network(name)
    network = make_network(GnnShape(num_features=8), name)
    path = save_gnn(tmp_path / "mine", network, tiny_config(network, "paper", own_network=name))
    _, options = parse(["check", "flocking", "--policy", str(path), "--network", name])
    assert options.study.networks == (name,)
    arguments = {"num_robots": 4, "num_windows": 100, "max_missions": 2, "num_jobs": 1}
    found = check_convergence("flocking", policy=path, networks=name, **arguments)
    assert found.num_missions == 2
