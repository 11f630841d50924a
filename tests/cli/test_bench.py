"""What the benchmark prints, and what it refuses."""

import pytest

from swarm_mj.cli import bench_learning, bench_simulation, main
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


@pytest.fixture
def teams(monkeypatch, here):
    """Teams that grow by known powers from 100 robots on; 400 robots do not fit."""

    def rows(num_robots, _):
        if num_robots == 400:
            raise ValueError("too large")
        small = 5.0 if num_robots < 100 else 0.0
        yield Row("window, ms", small + 2.0 * num_robots**1.5, "{:,.1f}")
        yield Row("team, MB", small + 3.0 * num_robots**2.0, "{:,.1f}")

    monkeypatch.setattr(bench_simulation, "team_rows", rows)
    return here


def test_teams_of_several_sizes_show_their_growth(teams, capsys):
    sizes = ("400", "10", "200", "100", "300")
    chart = ("--plot", "growth.png", "--seconds", "0.1")
    assert main(["bench", "--robots", *sizes, *chart]) == 0
    printed = capsys.readouterr()
    said = " ".join(printed.out.split())
    assert "the 3 largest teams: window, ms: N^1.50 and team, MB: N^2.00" in said
    assert "robots ┃ 10 ┃ 100 ┃ 200 ┃ 300" in said
    assert "400 robots are left out: too large" in printed.err
    assert "Evaluation" not in said
    assert [path.name for path in teams.iterdir()] == ["growth.png"]


@pytest.mark.parametrize("line", [("--plot", "a.svg"), ("--robots", "10", "400")])
def test_one_team_shows_no_growth(teams, capsys, line):
    assert main(["bench", *line, "--seconds", "0.1"]) == 2
    assert "growth needs two teams or more that fit" in capsys.readouterr().err
    assert not list(teams.iterdir())
