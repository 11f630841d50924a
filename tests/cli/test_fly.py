"""`swarm-mj fly` as a process: what it prints, writes, refuses, and leaves when interrupted."""

import json
import os
import re
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from forks import files

from swarm_mj.cli import fly, main, parse
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.tuning import tuned_probability
from swarm_mj.replay import write
from swarm_mj.replay.read import check_replay, windows
from swarm_mj.simulation.rollout import rollout, summarise
from swarm_mj.simulation.swarm import Swarm

SHORT = ("--windows", "20", "--robots", "6", "--range-ratio", "0.5")


def test_the_default_flight_leaves_a_replay_of_the_default_mission(succeed, tmp_path):
    done = succeed("fly")
    (replay,) = (tmp_path / "replays").iterdir()
    assert re.search(rf"replay (--web )?replays/{re.escape(replay.name)}\n", done.stdout)
    assert "flocking, planner, 40 robots" in done.stdout
    assert len(windows(replay)) == 500
    assert replay.stat().st_size < 5e6


def test_a_summary_is_what_the_library_computes(succeed, tmp_path):
    succeed(
        "fly", *SHORT, "--task", "random-walk", "--policy", "random-flooding", "--seed", 7,
        "--probability", 0.2, "--no-record", "--json", "out/summary.json",
    )  # fmt: skip
    assert files(tmp_path) == ["out/summary.json"]
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    mission = paper("random-walk", num_robots=6, num_windows=20, range_ratio=0.5)
    policy = make_policy("random-flooding", mission, 0.2)
    expected = summarise(list(rollout(Swarm(mission, [7]), policy)))
    for name in ("aoi_mean", "velocity_variance_mean", "packets_sent", "packets_heard"):
        assert summary[name] == getattr(expected, name)[0] > 0
    for fate in ("attempted", "delivered", "lost", "overheard", "answered"):
        assert summary[f"packets_{fate}"] is None  # a broadcast has no addressee
    config = {"num_robots": 6, "seed": 7, "probability": 0.2}
    assert {name: summary["config"][name] for name in config} == config
    assert summary["config"]["version"]
    assert summary["wall_seconds"] > 0
    assert (summary["interrupted"], summary["replay"]) == (False, None)


REFUSED = {
    "--robots 1": "a whole number from 2 to 1000 [robots], not 1",
    "--robots many": "argument --robots: invalid int value: 'many'",
    "--range-ratio 0": "range ratio must be a number from 0.01 to 10 [of 1 km], not 0",
    "--policy magic": "policy must be one of random-flooding, round-robin, mst",
    "--policy mst --probability 1.5": "probability must be a number from 0 to 1, not 1.5",
    "--policy round-robin --probability 0.1": "takes no transmission probability",
    "--seed -1": "not [-1]",
    "--seed 18446744073709551616": "from 0 to 9223372036854775807",
    "--observer 40": "observer must be from 0 to 39, not 40",
    "--range-ratio 0.02": "too sparse",
    "--record replay.txt": "must be named *.rrd",
    "--json .": "--json . is a folder; name a file",
    "--record a.rrd --json ./a.rrd": "same file",
    "--no-record --view": "--view needs a replay",
    "--no-record --record a.rrd": "not allowed with",
    "--bit-rate fast": "argument --bit-rate: name bits per second, 250k, 1M or none",
    "--policy tdma --bit-rate 2k": "16 bytes for a single entry, but a slot holds 12 bytes at",
    "--wings 2": "unrecognized arguments: --wings 2",
}


@pytest.mark.parametrize("options", REFUSED)
def test_bad_input_is_one_clear_line_and_leaves_nothing(refusal, options):
    assert REFUSED[options] in refusal("fly", *options.split())


def test_an_output_below_a_file_is_refused_before_the_flight(refusal, tmp_path):
    (tmp_path / "replays").write_text("kept")
    assert "cannot be written" in refusal("fly", *SHORT, "--record", "replays/a.rrd")
    line = refusal("fly", *SHORT)  # a replay that nobody named has a way out
    assert "error: the replay replays/flocking-planner-seed1-" in line
    assert line.endswith("name another place with --record, or leave it out with --no-record")
    assert (tmp_path / "replays").read_text() == "kept"


def test_odd_names_are_kept_and_the_summary_names_the_tuned_probability(succeed, tmp_path):
    """Not that of the tiny mission which is flown ahead to compile."""
    outputs = ("--record", "a [red] b.rrd", "--json", "s.json")
    done = succeed("fly", *SHORT, "--policy", "mst", "--observer", 2, *outputs)
    assert "'a [red] b.rrd'\n" in done.stdout
    assert files(tmp_path) == ["a [red] b.rrd", "s.json"]
    config = json.loads((tmp_path / "s.json").read_text())["config"]
    mission = paper("flocking", num_robots=6, range_ratio=0.5)
    assert config["probability"] == tuned_probability("mst", mission)
    assert config["observer"] == 2


@pytest.mark.parametrize(("flag", "name"), [("--record", "a.rrd"), ("--json", "a.json")])
def test_an_existing_file_needs_force(succeed, refusal, tmp_path, flag, name):
    path = tmp_path / name
    path.write_text("precious")
    line = refusal("fly", *SHORT, flag, path)
    assert f"{flag} {path} exists; name another, or replace it with --force" in line
    assert path.read_text() == "precious"
    succeed("fly", *SHORT, flag, path, "--force")
    check_replay(path) if flag == "--record" else json.loads(path.read_text())


def test_viewing_needs_a_display_and_says_so_first(tmp_path):
    bare = {key: value for key, value in os.environ.items() if "DISPLAY" not in key}
    done = subprocess.run(
        [sys.executable, "-m", "swarm_mj", "fly", *SHORT, "--view"],
        cwd=tmp_path, env=bare, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "no display" in done.stderr
    assert files(tmp_path) == []


def test_the_next_commands_fit_the_mission_and_the_screen(monkeypatch):
    mission, path = paper("random-walk", num_robots=9), Path("a b.rrd")
    options = fly.FlyOptions(mission=mission, policy="runs/my own", channel="my:Radio")
    monkeypatch.setattr("swarm_mj.replay.view.sys.platform", "linux")
    for display, way in ((":1", ""), ("", "--web ")):
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        told = dict(fly._next_commands(options, path))
        assert told["Open the replay:"].endswith(f"swarm-mj replay {way}'a b.rrd'")
    assert told["Compare some:"].endswith(
        "evaluate --policy 'runs/my own' planner tdma random-flooding --episodes 5 "
        "--task random-walk --robots 9 --channel my:Radio"
    )
    assert "Open the replay:" not in dict(fly._next_commands(options, None))
    for line in told.values():
        run, _ = parse(shlex.split(line)[1:])
        assert callable(run)


# Flies as `swarm-mj` does, and tells by a file when the flight is well under way.
FLY_AND_TELL = """
import signal, sys
from pathlib import Path
from swarm_mj.api import fly as flight
from swarm_mj.cli import main
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have had it ignored
windows = flight.rollout
def told(*arguments):
    for count, window in enumerate(windows(*arguments)):
        if count == 40:
            Path("under-way").touch()
        yield window
flight.rollout = told
sys.exit(main(sys.argv[1:]))
"""


def test_ctrl_c_leaves_a_readable_replay_of_what_was_flown(tmp_path):
    outputs = ["--record", "cut.rrd", "--json", "cut.json"]
    flight = subprocess.Popen(
        [sys.executable, "-c", FLY_AND_TELL, "fly", "--windows", "100000", "--seed", "3", *outputs],
        cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    while flight.poll() is None and not (tmp_path / "under-way").exists():
        time.sleep(0.01)
    flight.send_signal(signal.SIGINT)
    output, errors = flight.communicate(timeout=120)
    assert flight.returncode == 130, errors
    flown = windows(tmp_path / "cut.rrd")
    np.testing.assert_array_equal(flown, np.arange(1, len(flown) + 1))
    assert 40 < len(flown) < 100_000
    assert f"Interrupted after {len(flown)} of 100000 windows" in errors
    assert f"{len(flown)} in" in output
    summary = json.loads((tmp_path / "cut.json").read_text())
    assert (summary["interrupted"], summary["num_windows"]) == (True, len(flown))
    assert files(tmp_path) == ["cut.json", "cut.rrd", "under-way"]


@pytest.mark.parametrize("lost", ["a.rrd", "a.json"])
def test_a_file_that_fails_takes_nothing_else_with_it(tmp_path, monkeypatch, capsys, lost):
    def fails(*_):
        raise OSError(f"{lost} could not be written: No space left on device")

    monkeypatch.chdir(tmp_path)
    places = {"a.rrd": (write, "write_replay"), "a.json": (fly, "write_json")}
    monkeypatch.setattr(*places[lost], fails)
    assert main(["fly", *SHORT, "--record", "a.rrd", "--json", "a.json"]) == 1
    assert files(tmp_path) == sorted({"a.json", "a.rrd"} - {lost})
    said = capsys.readouterr()
    assert "flocking, planner, 6 robots" in said.out
    assert said.err == f"swarm-mj: error: {lost} could not be written: No space left on device\n"
