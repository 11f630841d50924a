"""What the benchmark prints, and what it refuses."""

import json
import mmap

import pytest

from swarm_mj.cli import bench_bodies, bench_decisions, bench_learning, bench_simulation, main
from swarm_mj.cli.bench import noise
from swarm_mj.cli.bench_simulation import Row


@pytest.mark.slow
def test_bench_prints_the_whole_and_its_parts(succeed, tmp_path):
    short = ("--seconds", 0.1, "--episodes", 1, "--no-learning", "--json", "b.json")
    done = succeed("bench", "--missions", 1, 3, *short)
    for row in ("windows simulated per second", "plain MuJoCo step", "radio delivers", "decides"):
        assert row in done.stdout
    tables = json.loads((tmp_path / "b.json").read_text())["tables"]
    rows = [row for table in tables for row in table["rows"]]
    assert all(row["name"] in done.stdout and min(row["values"]) > 0.0 for row in rows)
    assert [table["columns"] for table in tables[:3]] == [
        ["1", "3"],
        [""],
        ["walking", "stationary"],
    ]
    for row in ("Evaluation: 1 random walks", "round-robin, mst, --jobs 2", "greedy-oracle"):
        assert row in done.stdout
    assert "Learning" not in done.stdout
    assert tables[-1]["title"].startswith("Robots with bodies: 40 quadrotors")
    assert tables[-1]["columns"] == ["8", "32"]
    noise, written = done.stdout.splitlines()[-2:]
    assert "noise: the plain step was measured 6 times, from" in noise
    assert written == "Wrote b.json"


@pytest.fixture
def quick(monkeypatch, here):
    """A bench whose slow sections take no time; every policy decides in 1234.56 µs."""
    monkeypatch.setattr(bench_bodies, "body_rows", lambda *_: iter([Row("window", 3.5)]))
    row = Row("train --credit team", 12.34, "{:.1f} / s")
    monkeypatch.setattr(bench_learning, "learning_rows", lambda **_: iter([row]))
    decided = lambda _, names, __: [Row(name, 1234.56, "{:,.1f} µs") for name in names]  # noqa: E731
    monkeypatch.setattr(bench_decisions, "decision_rows", decided)
    return here


QUICK = ("bench", "--missions", "1", "--seconds", "0.1", "--episodes", "0")


@pytest.mark.slow
def test_bench_shows_learning_and_leaves_the_evaluation_out(quick, capsys):
    assert main([*QUICK, "--json", "new/b.json"]) == 0
    printed = capsys.readouterr().out
    assert "Evaluation" not in printed
    said = " ".join(printed.split())
    assert "train --credit team │ 12.3 / s" in said
    assert "gnn │ 1,234.6 µs │ 1,234.6 µs" in said
    written = json.loads((quick / "new" / "b.json").read_text())
    assert (written["threads"], written["seconds"]) == (1, 0.1)
    assert len(written["noise"]["plain_step_us"]) == 6  # before, and after each table
    *_, decided, learned, _bodies = written["tables"]
    assert decided["columns"] == ["walking", "stationary"]
    gnn = {"name": "gnn", "values": [1234.56, 1234.56], "unit": "µs"}
    assert gnn in decided["rows"]
    assert learned["rows"] == [{"name": "train --credit team", "values": [12.34], "unit": "/ s"}]


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("flag", "name", "robots"),
    [("--json", "b.json", ()), ("--plot", "b.svg", ("--robots", "100", "200"))],
)
def test_an_existing_file_needs_force(teams, capsys, flag, name, robots):
    (teams / name).write_text("precious")
    assert main([*QUICK, *robots, flag, name]) == 2
    assert f"{flag} {name} exists; name another, or replace it with" in capsys.readouterr().err
    assert (teams / name).read_text() == "precious"
    assert main([*QUICK, *robots, flag, name, "--force"]) == 0
    assert (teams / name).read_text() != "precious"


@pytest.mark.usefixtures("quick")
def test_no_network_decides_without_learning(capsys):
    assert main([*QUICK, "--no-learning"]) == 0
    printed = capsys.readouterr().out
    assert "greedy-oracle" in printed
    assert "gnn" not in printed


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (("--json", "b.txt"), "--json must be named *.json, not b.txt"),
        (("--json", "."), "--json . is a folder; name a file"),
        (("--json", "/proc/no/b.json"), "--json /proc/no/b.json cannot be written"),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(refusal, line, said):
    assert said in refusal("bench", *line)


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


def test_a_team_takes_a_page_of_memory_though_the_peak_stays(monkeypatch, capsys):
    monkeypatch.setattr(bench_simulation, "peak_memory", lambda: 300_000_000)
    bench_simulation.measure(num_robots=3, seconds=0.01)
    measured = json.loads(capsys.readouterr().out)
    assert measured["process, MB"] == 300.0
    assert measured["team, MB"] == mmap.PAGESIZE / 1e6


def test_teams_of_several_sizes_show_their_growth(teams, capsys):
    sizes = ("400", "10", "200", "100", "300")
    chart = ("--plot", "growth.png", "--json", "growth.json", "--seconds", "0.1")
    assert main(["bench", "--robots", *sizes, *chart]) == 0
    printed = capsys.readouterr()
    said = " ".join(printed.out.split())
    assert "the 3 largest teams: window, ms: N^1.50 and team, MB: N^2.00" in said
    assert "robots ┃ 10 ┃ 100 ┃ 200 ┃ 300" in said
    assert "400 robots are left out: too large" in printed.err
    assert "Evaluation" not in said
    assert sorted(path.name for path in teams.iterdir()) == ["growth.json", "growth.png"]
    (table,) = json.loads((teams / "growth.json").read_text())["tables"]
    assert table["columns"] == ["10", "100", "200", "300"]
    assert [row["values"][1] for row in table["rows"]] == pytest.approx([2e3, 3e4])


@pytest.mark.parametrize("line", [("--plot", "a.svg"), ("--robots", "10", "400")])
def test_one_team_shows_no_growth(teams, capsys, line):
    assert main(["bench", *line, "--seconds", "0.1"]) == 2
    assert "growth needs two teams or more that fit" in capsys.readouterr().err
    assert not list(teams.iterdir())
