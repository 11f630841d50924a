"""The example of a policy of your own: it trains, goes on, writes weights, and flies by name."""

import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from residual_gnn import train as module
from residual_gnn import training_run
from residual_gnn.policy import ResidualPolicy
from residual_gnn.stored import SHIPPED, load_weights, save_weights

from swarm_mj.cli import main, script
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy

TINY = ["--robots", "6", "--windows", "100", "--held-out", "1", "--places", "2", "--together", "1"]


@pytest.mark.slow
def test_a_run_trains_goes_on_and_its_weights_fly(tmp_path, monkeypatch):
    """Each improvement takes half a minute of a clock that only the training looks at."""
    monkeypatch.setattr(module, "KINDS", {"30 % erased": {"erasure": 0.3}})
    ticks = iter(range(0, 10**6, 30))
    monkeypatch.setattr(training_run, "time", SimpleNamespace(monotonic=lambda: next(ticks)))
    run = tmp_path / "run"
    for minutes, improvements in (("0.5", [0, 1]), ("1.5", [0, 1, 3])):
        options = [*TINY, "--out", str(run), "--minutes", minutes]
        assert script(module.Residual, module.Residual.__call__, options) == 0
        with (run / training_run.CURVE).open() as file:
            rows = list(csv.DictReader(file))
        assert [int(row["improvements"]) for row in rows] == improvements
    trained = training_run.Run(module.Residual(**_tiny()).training(), run)
    save_weights(tmp_path / "mine.safetensors", trained._weights(trained._network), "# Mine")
    loaded = load_weights(tmp_path / "mine.safetensors")
    shipped = load_weights(SHIPPED)
    assert loaded.arrays.keys() == shipped.arrays.keys()
    assert any(np.any(array) for array in loaded.arrays.values())


def _tiny():
    pairs = zip(TINY[::2], TINY[1::2], strict=True)
    return {name.removeprefix("--").replace("-", "_"): int(value) for name, value in pairs}


@pytest.mark.slow
def test_the_weights_correct_the_plan_of_a_stationary_team(tmp_path, monkeypatch):
    """The plan alone is that of `planner` without payload."""
    monkeypatch.syspath_prepend(str(SHIPPED.parents[1]))
    policies = ["residual_gnn:policy", "planner --payload none"]
    options = ["--task", "stationary", "--fading", "rayleigh", "--robots", "20", "--windows", "300"]
    out = tmp_path / "out.json"
    assert (
        main(["evaluate", "--policy", *policies, "--episodes", "8", *options, "--json", str(out)])
        == 0
    )
    corrected, plan = (each["aoi_mean"] for each in json.loads(out.read_text())["results"])
    assert corrected < 0.95 * plan


def test_teams_that_move_are_refused():
    with pytest.raises(ValueError, match="those of flocking move; add --task stationary"):
        make_policy("residual_gnn:policy", paper("flocking"))
    policy = make_policy("residual_gnn:policy", paper("stationary"))
    assert isinstance(policy, ResidualPolicy)
