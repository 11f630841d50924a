"""What the benchmark prints, and what it refuses."""

import pytest

from swarm_mj.cli import bench_learning, main
from swarm_mj.cli.bench import noise
from swarm_mj.cli.bench_simulation import Row


@pytest.mark.slow
def test_bench_prints_the_whole_and_its_parts(succeed):
    short = ("--seconds", 0.1, "--episodes", 1, "--no-learning")
    done = succeed("bench", "--missions", 1, 3, *short)
    for row in ("windows simulated per second", "plain MuJoCo step", "radio delivers", "decides"):
        assert row in done.stdout
    for row in ("Evaluation: 1 random walks", "round-robin, mst, --jobs 2", "greedy-oracle"):
        assert row in done.stdout
    assert "Learning" not in done.stdout
    assert "noise: the plain step was measured 4 times, from" in done.stdout.splitlines()[-1]


def test_bench_shows_learning_and_leaves_the_evaluation_out(monkeypatch, capsys):
    row = Row("train --credit team", 12.34, "{:.1f} / s")
    monkeypatch.setattr(bench_learning, "learning_rows", lambda **_: iter([row]))
    assert main(["bench", "--missions", "1", "--seconds", "0.1", "--episodes", "0"]) == 0
    printed = capsys.readouterr().out
    assert "Evaluation" not in printed
    assert "train --credit team │ 12.3 / s" in " ".join(printed.split())


def test_noise_is_the_spread_of_what_should_be_the_same():
    assert noise([4.0, 4.4, 4.2]).startswith(
        "noise: the plain step was measured 3 times, from 4.00 to 4.40 µs. Other numbers, too, may "
        "be off by 10%"
    )
    assert noise([4.0, 4.4]).endswith("10%.")
    assert noise([4.0, 6.0]).endswith("50%; the machine was busy, so measure again when it is not.")
