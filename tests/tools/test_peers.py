"""The comparison of speeds, from arms that need nothing installed."""

import csv
import sys

import peers as tool
import peers_arms as arms_tool
import pytest
from peers_arms import Arm

from swarm_mj.system.exit_codes import BAD_INPUT, DONE
from swarm_mj.system.terminal import WorkBar


def arm(key, step, missions=1):
    """An arm of made-up steps."""
    return Arm(arm=key, name=key, missions=missions, has="nothing", version="1", step=step)


@pytest.fixture
def without_vmas(monkeypatch):
    """Nobody has installed VMAS; few missions, because a thousand take seconds to make."""
    monkeypatch.setitem(sys.modules, "vmas", None)
    monkeypatch.setattr(arms_tool, "SIDE_BY_SIDE", (1, 2))


@pytest.mark.usefixtures("without_vmas")
def test_what_is_here_is_measured_and_what_is_absent_is_named(tmp_path, capsys):
    out = tmp_path / "peers.csv"
    assert tool.main(["--rounds", "2", "--seconds", "0.001", "--out", str(out)]) == DONE
    with out.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["arm"] for row in rows] == [
        "swarm_mj_1",
        "swarm_mj_2",
        "swarm_mj_env_1",
        "swarm_mj_env_2",
        "mujoco_1",
    ]
    assert tuple(rows[0]) == tool.COLUMNS
    for row in rows:
        least, median, most = (
            float(row[name]) for name in ("least", "agent_steps_per_s", "greatest")
        )
        assert 0.0 < least <= median <= most
    said = " ".join(capsys.readouterr().err.split())
    assert "VMAS is left out: " in said
    assert "make bench-peers installs it" in said
    assert "the authors' environment is left out: git clone https://github.com/" in said


def test_arms_take_turns_in_each_round(monkeypatch):
    monkeypatch.setattr(tool.time, "thread_time", iter(range(1000)).__next__)  # a call takes 1 s
    order = []
    first = arm("first", lambda: order.append("first"))
    second = arm("second", lambda: order.append("second"), missions=32)
    with WorkBar("Measuring", 6) as bar:
        found = tool.rates([first, second], rounds=3, seconds=0.5, bar=bar)
    assert order[4:] == ["first", "second"] * 3
    # One step of 40 agents a second, and of 32 times 40.
    assert found == {"first": [40.0] * 3, "second": [1280.0] * 3}


def test_a_row_has_the_median_and_the_ends():
    first = arm("first", lambda: None)
    [row] = tool.rows_of([first], {"first": [5.0, 1.0, 2.0]})
    assert (row["least"], row["agent_steps_per_s"], row["greatest"]) == (1.0, 2.0, 5.0)


@pytest.mark.usefixtures("without_vmas")
def test_a_folder_without_the_authors_code_is_refused(tmp_path, capsys):
    out = tmp_path / "peers.csv"
    arguments = ["--authors", str(tmp_path), "--rounds", "1", "--out", str(out)]
    assert tool.main(arguments) == BAD_INPUT
    assert "no aoi_envs/Mobile.py in it; git clone" in capsys.readouterr().err
    assert not out.exists()
