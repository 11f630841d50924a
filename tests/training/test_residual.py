"""The experiment behind `residual-gnn`, on the smallest missions."""

import csv
from dataclasses import fields
from types import SimpleNamespace

import pytest
import residual
from residual import Residual
from residual_gnn.policy import ResidualPolicy
from residual_gnn.stored import read_residual
from residual_gnn.training import train as training_module
from residual_gnn.training.train import CHECKPOINT, CURVE

from swarm_mj.cli import script
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm
from swarm_mj.system.provenance import commit

TINY = ["--robots", "6", "--windows", "100", "--held-out", "1", "--places", "2", "--together", "1"]
POLICY = "policy.safetensors"


@pytest.fixture(autouse=True)
def _small(monkeypatch, tmp_path):
    """One kind of missions; each improvement takes half a minute; nothing is really shipped."""
    monkeypatch.setattr(residual, "KINDS", {"30 % erased": {"erasure": 0.3}})
    ticks = iter(range(0, 10**6, 30))
    monkeypatch.setattr(training_module, "time", SimpleNamespace(monotonic=lambda: next(ticks)))
    monkeypatch.setattr(residual, "POLICIES", tmp_path / "policies")


def run(folder, *options):
    """The exit code."""
    return script(Residual, Residual.__call__, [*TINY, "--out", str(folder / "run"), *options])


def curve(folder):
    with (folder / "run" / CURVE).open() as file:
        return list(csv.DictReader(file))


def choose(monkeypatch, at):
    """The network that was made after so many improvements is the best."""

    def chosen(run):
        first = next(iter(run.progress.best))
        weights = run._weights(run._network)
        return at, weights, {first: 1.0, 1: 0.9 if at else 1.1}

    monkeypatch.setattr(residual.Run, "choose", chosen)


def test_a_run_leaves_a_policy_that_flies_and_goes_on_when_it_is_called_again(
    tmp_path, monkeypatch, capfd
):
    choose(monkeypatch, 1)
    assert run(tmp_path, "--minutes", "0.5") == 0
    names = {path.name for path in (tmp_path / "run").iterdir()}
    assert names == {CHECKPOINT, CURVE, POLICY}
    said = capfd.readouterr().err
    assert "run stands at 0 improvements" in said
    assert "    1 improvements, 0.5 min: 30 % erased " in said
    mission = paper("stationary", num_robots=6, num_windows=10)
    policy = make_policy(str(tmp_path / "run" / POLICY), mission)
    assert isinstance(policy, ResidualPolicy)
    assert len(list(rollout(Swarm(mission, [1]), policy))) == 10

    assert run(tmp_path, "--minutes", "1.5") == 0
    said = capfd.readouterr().err
    assert "run stands at 1 improvements" in said
    assert [int(row["improvements"]) for row in curve(tmp_path)] == [0, 1, 3]
    assert not (tmp_path / "policies").exists()


def card(folder):
    """What stands in the policy's metadata, read as safetensors files are."""
    content = (folder / "run" / POLICY).read_bytes()
    return content[8 : 8 + int.from_bytes(content[:8], "little")].decode()


def test_its_card_names_the_command_the_commit_and_the_choice(tmp_path, monkeypatch):
    choose(monkeypatch, 1)
    assert run(tmp_path, "--minutes", "0.5", "--seed", "1234567") == 0
    said = card(tmp_path).replace("\\\\n", "\n")
    command = (
        "    python training/residual.py --minutes 0.5 --seed 1234567 --robots 6 --windows 100 "
        "--together 1 --places 2 --held-out 1\n"
    )
    assert command in said
    assert f"Commit {commit()}." in said
    assert "- learning_rate: 0.0007\n" in said
    assert "- 30 % erased: `--erasure 0.3`\n" in said
    assert "- 0 improvements: 1.000" in said
    assert said.count("(this one)") == 1


def test_the_command_of_a_card_makes_the_same_training():
    made = Residual(
        minutes=12.5, seed=2**31, learning_rate=1.23456789e-3, corrects_turns=True, epochs=3
    )
    typed = made._command().split()[2:]
    seen = []
    assert script(Residual, lambda options: seen.append(options) or 0, typed) == 0
    assert seen == [made]
    assert Residual()._command() == "python training/residual.py"


def test_a_network_that_beats_the_rule_is_shipped_with_its_card(tmp_path, monkeypatch):
    choose(monkeypatch, 1)
    assert run(tmp_path, "--minutes", "0.5", "--ship") == 0
    shipped = tmp_path / "policies" / "residual-gnn"
    assert (
        shipped.with_suffix(".safetensors").read_bytes() == (tmp_path / "run" / POLICY).read_bytes()
    )
    assert read_residual(shipped.with_suffix(".safetensors")).width == 32
    written = shipped.with_suffix(".md").read_text()
    assert "- 1 improvements: 0.900 (this one)\n" in written
    assert all(len(line) <= 200 for line in written.splitlines())


def test_a_network_that_does_not_is_not(tmp_path, monkeypatch, capfd):
    choose(monkeypatch, 0)
    assert run(tmp_path, "--minutes", "0.5", "--ship") == 0
    assert "the rule alone is best, so nothing is written or shipped" in capfd.readouterr().err
    assert not (tmp_path / "run" / POLICY).exists()
    assert not (tmp_path / "policies").exists()


def test_one_that_is_interrupted_leaves_nothing_half_written_and_goes_on(
    tmp_path, monkeypatch, capfd
):
    def interrupted(*_):
        raise KeyboardInterrupt

    choose(monkeypatch, 1)

    with monkeypatch.context() as patched:
        patched.setattr(residual, "save_residual", interrupted)
        assert run(tmp_path, "--minutes", "0.5") == 130
    assert {path.name for path in (tmp_path / "run").iterdir()} == {CHECKPOINT, CURVE}
    assert capfd.readouterr().err.endswith("residual: interrupted\n")
    assert run(tmp_path, "--minutes", "0.5") == 0
    assert "run stands at 1 improvements" in capfd.readouterr().err


def test_another_runs_folder_is_refused_in_a_line(tmp_path, capfd):
    assert run(tmp_path, "--minutes", "0.5") == 0
    before = {path: path.read_bytes() for path in (tmp_path / "run").iterdir()}
    capfd.readouterr()
    assert run(tmp_path, "--minutes", "0.5", "--seed", "1") == 2
    last = capfd.readouterr().err.splitlines()[-1]
    assert last.startswith(f"residual: error: checkpoint {tmp_path / 'run' / CHECKPOINT} is not")
    assert last.endswith("begin a new run with another --out")
    assert {path: path.read_bytes() for path in (tmp_path / "run").iterdir()} == before


def test_its_help_says_how_a_run_goes_on(capfd):
    assert script(Residual, Residual.__call__, ["--help"]) == 0
    said = " ".join(capfd.readouterr().out.split())
    for spec in fields(Residual):
        assert f"--{spec.name.replace('_', '-')}" in said
    assert "one that has begun goes on, with the same options but for the minutes" in said
