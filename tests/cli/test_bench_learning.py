"""The learning bench measures what it says; how fast is not tested, for machines are shared."""

import pytest

from swarm_mj.cli import bench_simulation
from swarm_mj.cli.bench_learning import learning_rows


@pytest.mark.slow
def test_networks_are_timed_alone_and_by_the_batch_and_both_kinds_of_credit_train(monkeypatch):
    monkeypatch.setattr(bench_simulation, "REPETITIONS", 1)
    rows = list(learning_rows(num_robots=4, seconds=0.05))
    for first, missions in ((0, "1 mission"), (2, "32 missions")):
        forward, backward = rows[first : first + 2]
        assert forward.name == f"the paper's network, {missions}: team decisions"
        assert 0.0 < backward.value < forward.value
    named = {row.name: row.value for row in rows}
    for features in ("turns", "extended"):
        assert named[f"{features} features, 32 missions, in windows"] > 0.0
    assert named["a step of make_vec, 32 missions, default features, in windows"] > 0.0
    for name in ("--credit robot", "--credit team"):
        assert named[f"train {name}: team decisions"] > 0.0
    for whose in ("--credit robot", "the paper"):
        assert named[f"one robot's decision, network of {whose}"] > 0.0
