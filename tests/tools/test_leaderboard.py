"""The leaderboard, from made-up results."""

from dataclasses import asdict, replace

import leaderboard as tool
import pytest
from synthetic import result

from swarm_mj.cli.study import read_study
from swarm_mj.evaluation.results_files import write_results
from swarm_mj.system.exit_codes import DONE, INTERRUPTED

KINDS = tool.kinds_of_missions()


def row(policy, kind, **numbers):
    """A policy's result of one kind of mission."""
    mission = asdict(kind)
    others = {name: value for name, value in mission.items() if name not in ("preset", "task")}
    made = result(policy, kind.task, "paper", config=mission, **others, **numbers)
    return replace(made, preset=kind.preset)


@pytest.fixture
def board(tmp_path):
    """The lines of the leaderboard of policies by the mean age of each kind's missions."""

    def made(ages, **others):
        rows = []
        for policy, age in ages.items():
            for kind in KINDS.values():
                numbers = {"aoi_mean": age, "aoi_p95": 2.0 * age, "complete_share": 1.0} | others
                rows.append(row(policy, kind, **numbers))
        write_results(tmp_path / "benchmark.csv", rows)
        return [line.split(" | ") for line in tool.table(tmp_path).splitlines()]

    return made


def test_policies_stand_by_their_age_over_the_baselines_with_tails_and_information(board):
    _, _, first, second, third, *_ = board({"tdma": 10.0, "planner": 5.0, "csma": 20.0})
    assert first[:4] == ["| `planner`", "larger packets", "0.50", "5.0 (10)"]
    assert second[:3] == ["| `tdma`", "T, M, P", "1.00"]
    assert third[:3] == ["| `csma`", "T, M, P; senses", "2.00"]
    assert len(third) == 3 + len(KINDS) == 15


def test_missions_that_are_not_complete_are_said(board):
    _, _, first, *_ = board({"tdma": 10.0}, complete_share=0.5)
    assert first[3] == "10.0 (20), 50%"


def test_a_strangers_policy_is_listed_and_its_code_is_not_run(board):
    assert board({"tdma": 10.0, "their_file:Theirs": 9.0})[2][:3] == [
        "| `their_file:Theirs`",
        "see its code",
        "0.90",
    ]


def test_the_score_is_a_geometric_mean():
    def cells(*ages):
        return [{"aoi_mean": age} for age in ages]

    assert tool.score(cells(1.0, 16.0), cells(2.0, 2.0)) == pytest.approx(2.0)


def test_a_policy_that_lacks_a_kind_is_refused(tmp_path):
    write_results(tmp_path / "benchmark.csv", [row("tdma", KINDS["rest-40"])])
    with pytest.raises(ValueError, match="tdma has 0 results of rest-40-dense"):
        tool.table(tmp_path)


def test_the_benchmarks_missions_stay_as_they_are():
    """Results of years are compared: a kind of mission may be added, but not changed."""
    assert list(KINDS) == [
        "rest-40", "rest-40-dense", "rest-10", "walk-10", "walk-40", "walk-80", "flock-40",
        "blocks-20", "city-40", "fading-40", "loss-20", "failures-40",
    ]  # fmt: skip
    assert KINDS["rest-40-dense"] == replace(KINDS["rest-40"], range_ratio=1.0)
    assert KINDS["fading-40"] == replace(KINDS["rest-40"], fading="rayleigh")
    assert KINDS["failures-40"] == replace(KINDS["walk-40"], failure_fraction=0.3)
    assert {kind.num_windows for kind in KINDS.values()} == {500}


def test_the_leaderboard_is_written_from_what_is_flown(board, tmp_path, monkeypatch):
    board(dict.fromkeys(read_study("benchmark").policies, 10.0))
    (tmp_path / "training" / "results").mkdir(parents=True)
    (tmp_path / "benchmark.csv").rename(tmp_path / "training" / "results" / "benchmark.csv")
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    assert tool.main() == DONE
    text = (tmp_path / "training" / "leaderboard.md").read_text()
    assert text.startswith("# Leaderboard\n")
    assert "| `tdma` | T, M, P | 1.00 |" in text


def test_a_policy_that_was_added_since_is_not_left_out_silently(board, tmp_path):
    board({"tdma": 10.0})
    with pytest.raises(ValueError, match=r"lacks age-gain-csma, .*--policy age-gain-csma"):
        tool.check_all_flew(tmp_path)


def test_what_is_missing_is_flown_first(tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(tool, "ROOT", tmp_path)
    monkeypatch.setattr(tool, "swarm_mj", lambda command: asked.append(command) or INTERRUPTED)
    assert tool.main() == INTERRUPTED  # and no leaderboard
    assert asked[0][:3] == ["study", "run", "benchmark"]
    assert "--resume" in asked[0]
    assert not list(tmp_path.rglob("leaderboard.md"))
