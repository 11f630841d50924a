"""`swarm-mj fly`: what it prints, writes, refuses, and leaves when interrupted."""

import json
import re
import shlex
import signal
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from forks import files

from swarm_mj.api import flight
from swarm_mj.cli import fly, main, parse
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.policies.tuning import tuned_probability
from swarm_mj.replay import view, write
from swarm_mj.replay.read import check_replay, read_footage, windows
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


def test_without_rerun_a_flight_says_that_it_records_nothing(monkeypatch, tmp_path, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(fly, "is_installed", lambda module: module != "rerun")
    assert main(["fly", *SHORT]) == 0
    out, err = capsys.readouterr()
    assert err.count("\n") == 2  # the other line is a note on the planner of so small a team
    assert err.startswith("no replay is recorded: it needs rerun-sdk, which is not installed; pip")
    assert "flocking, planner, 6 robots" in out
    assert "Open the replay" not in out
    assert not list(tmp_path.iterdir())


def test_a_summary_is_what_the_library_computes(succeed, tmp_path):
    done = succeed(
        "fly", *SHORT, "--task", "random-walk", "--policy", "random-flooding", "--seed", 7,
        "--probability", 0.2, "--no-record", "--json", "out/summary.json",
    )  # fmt: skip
    assert done.stdout.count("Wrote") == done.stdout.count("Wrote out/summary.json\n") == 1
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
    "--robots 1": "a whole number from 2 to 10000 [robots], not 1",
    "--range-ratio 0": "range ratio must be a number from 0.01 to 10 [km], not 0",
    "--policy magic": "policy must be one of random-flooding, round-robin, mst",
    "--policy tdma planner": "planner; fly flies one policy, and `swarm-mj evaluate` compares sev",
    "--policy tdma,mst": "separate several by spaces: `swarm-mj evaluate --policy tdma mst`",
    "--policy round-robin --probability 0.1": "takes no transmission probability",
    "--robots forty": "--robots: name a whole number from 2 to 10000 [robots], not 'forty'",
    "--seed -1": "--seed must be a whole number from 0 to 9223372036854775807, not -1",
    "--seed 18446744073709551616": "from 0 to 9223372036854775807",
    "--observer 40": "observer must be from 0 to 39, not 40",
    "--observer 2 --no-record": "--observer is whose knowledge a replay shows; leave out --no-rec",
    "--range-ratio 0.02": "too sparse",
    "--record replay.txt": "must be named *.rrd",
    "--out a.rrd": "unrecognized arguments: --out a.rrd; did you mean --record?",
    "--scene lab.xml": "not 'lab.xml'; to use an MJCF file: --arena lab.xml",
    "--record a.rrd --json ./a.rrd": "same file",
    "--no-record --view": "--view needs a replay",
    "--no-record --record a.rrd": "not allowed with",
    "--bit-rate fast": "argument --bit-rate: name bits per second, 250k, 1M or none",
    "--policy tdma --bit-rate 2k": "16 bytes for a single entry, but a slot holds 12 bytes at",
    "--rician-k -1": "Rician K must be a number from 0 to 10000, not -1",
    "--arena blocks --physics exact": "choose physics contact, or arena open",
    "--preset urban --physics exact": "choose physics contact, or arena open (it is blocks)",
    "--collide --physics exact": "exact physics knows no collisions; choose physics",
}


@pytest.mark.parametrize("options", REFUSED)
def test_bad_input_is_one_clear_line_and_leaves_nothing(refusal, options):
    assert REFUSED[options] in refusal("fly", *options.split())


GEOM = '<geom name="pillar" type="box" size="20 20 5" pos="0 0 5" group="1"/>'
ARENAS = {  # what stands in a file, and what is wrong with it; more are in tests/physics/
    GEOM.replace("20 20 5", "2000 2000 5"): (
        "6 of 6 robots found no free space in 1000 draws over an area of 387 m by 387 m; choose an "
        "arena that leaves more room, or fewer robots"
    ),
    GEOM.replace("20 20 5", "20 wide 5"): "line 3",
    GEOM.replace("20 20 5", "20 0 5"): "size 1 must be positive in geom",
    '<geom type="mesh" mesh="hall"/>': "arena world.xml: Error: ",
    GEOM.replace("group", 'user="-3" group'): (
        "arena world.xml: the penetration loss of geom pillar must be 0 dB or more, not -3"
    ),
    f'<body name="cart"><joint type="slide"/>{GEOM}</body>': (
        "arena world.xml: cart has a joint, but obstacles stand still"
    ),
}


def write_arena(folder, geom):
    text = f"<mujoco>\n<worldbody>\n{geom}\n</worldbody>\n</mujoco>\n"
    (folder / "world.xml").write_text(text)


@pytest.mark.parametrize("geom", ARENAS)
def test_a_bad_arena_is_one_clear_line(refusal, tmp_path, geom):
    write_arena(tmp_path, geom)
    line = refusal("fly", "--robots", 6, "--windows", 3, "--arena", "world.xml")
    assert ARENAS[geom] in line


def test_a_hall_that_would_fill_a_smaller_teams_area_is_flown(succeed, tmp_path):
    """6 robots have 387 m by 387 m, and the 3 that compile ahead would have 274 m."""
    write_arena(tmp_path, GEOM.replace("20 20 5", "150 150 5"))
    succeed("fly", *SHORT, "--no-record", "--arena", "world.xml", "--policy", "tdma")


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


@pytest.mark.slow
@pytest.mark.parametrize(("flag", "name"), [("--record", "a.rrd"), ("--json", "a.json")])
def test_an_existing_file_needs_force(succeed, refusal, tmp_path, flag, name):
    path = tmp_path / name
    path.write_text("precious")
    line = refusal("fly", *SHORT, flag, path)
    assert f"{flag} {path} exists; name another, or replace it with --force" in line
    assert path.read_text() == "precious"
    succeed("fly", *SHORT, flag, path, "--force")
    check_replay(path) if flag == "--record" else json.loads(path.read_text())


def test_viewing_needs_a_display_and_says_so_first(here, monkeypatch, capsys):
    monkeypatch.setattr("swarm_mj.replay.view.sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    assert main(["fly", *SHORT, "--view"]) == 2
    assert "no display" in capsys.readouterr().err
    assert files(here) == []


def test_the_next_commands_fit_the_mission_and_the_screen(monkeypatch):
    mission, path = paper("random-walk", num_robots=9), Path("a b.rrd")
    own = {"policy": "runs/my own", "channel": "my:Radio", "features": ("my:A", "my:B")}
    options = fly.FlyOptions(mission=mission, **own)
    monkeypatch.setattr("swarm_mj.replay.view.sys.platform", "linux")
    for display, way in ((":1", ""), ("", "--web ")):
        monkeypatch.setenv("DISPLAY", display)
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        told = dict(fly._next_commands(options, path))
        assert told["Open the replay:"].endswith(f"swarm-mj replay {way}'a b.rrd'")
    assert told["Compare some:"].endswith(
        "evaluate --policy 'runs/my own' planner tdma random-flooding --episodes 5 "
        "--task random-walk --robots 9 --channel my:Radio --features my:A my:B"
    )
    assert "Open the replay:" not in dict(fly._next_commands(options, None))
    for line in told.values():
        run, _ = parse(shlex.split(line)[1:])
        assert callable(run)


def test_policies_whose_packets_do_not_fit_are_not_suggested():
    """Of 9 robots the planner's packets have 525 bytes; a slot holds 312 at 50 kbit/s, then 625."""
    for rate, names in ((50e3, "mst tdma random-flooding"), (100e3, "mst planner tdma random-")):
        mission = paper("random-walk", num_robots=9, bit_rate=rate)
        options = fly.FlyOptions(mission=mission, policy="mst")
        assert f" --policy {names}" in dict(fly._next_commands(options, None))["Compare some:"]


@pytest.mark.parametrize(("robots", "best"), [(80, "planner"), (81, "age-gain-csma")])
def test_the_policy_with_the_lowest_age_for_that_team_is_suggested(robots, best):
    options = fly.FlyOptions(mission=paper("random-walk", num_robots=robots), policy="tdma")
    told = dict(fly._next_commands(options, None))["Compare some:"]
    assert f" --policy tdma {best} random-flooding " in told


def test_ctrl_c_leaves_a_readable_replay_of_what_was_flown(here, monkeypatch, capsys):
    def pressed(*arguments):
        for count, window in enumerate(rollout(*arguments), start=1):
            if count == 15:
                signal.raise_signal(signal.SIGINT)
            yield window

    monkeypatch.setattr(flight, "rollout", pressed)
    outputs = ("--record", "cut.rrd", "--json", "cut.json")
    assert main(["fly", *SHORT, "--policy", "tdma", *outputs]) == 130
    said = capsys.readouterr()
    np.testing.assert_array_equal(windows(here / "cut.rrd"), np.arange(1, 16))
    assert said.err == "Interrupted after 15 of 20 windows.\n"
    assert "15 in" in said.out
    summary = json.loads((here / "cut.json").read_text())
    assert (summary["interrupted"], summary["num_windows"]) == (True, 15)
    assert files(here) == ["cut.json", "cut.rrd"]


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
    error = f"swarm-mj: error: {lost} could not be written: No space left on device"
    assert said.err.splitlines()[-1] == error


@pytest.fixture
def nowhere(monkeypatch):
    """A viewer that takes no data, and is closed after the flight."""

    @contextmanager
    def viewer(_where):
        process = SimpleNamespace(wait=lambda: 0)
        yield view.LiveViewer(process=process, address="rerun+http://127.0.0.1:9/proxy", page="")

    monkeypatch.setattr(view, "live_viewer", viewer)
    monkeypatch.setattr("rerun.RecordingStream.connect_grpc", lambda *_: None)


@pytest.mark.usefixtures("nowhere")
def test_a_live_flight_leaves_what_others_do(here, capsys):
    windows_flown = ("--windows", "60", "--robots", "6", "--policy", "tdma")
    assert main(["fly", *windows_flown, "--live", "web", "--record", "live.rrd"]) == 0
    assert "Open the replay" in capsys.readouterr().out
    assert main(["fly", *windows_flown, "--record", "plain.rrd"]) == 0
    found, expected = (read_footage(here / f"{name}.rrd") for name in ("live", "plain"))
    assert found.facts == expected.facts
    np.testing.assert_array_equal(found.position_m, expected.position_m)
    np.testing.assert_array_equal(found.known_age, expected.known_age)


@pytest.mark.usefixtures("nowhere")
def test_ctrl_c_keeps_what_a_live_flight_has_shown(here, monkeypatch, capsys):
    def some(swarm, *policy):
        for number, window in enumerate(rollout(swarm, *policy), start=1):
            if number == 40:
                signal.raise_signal(signal.SIGINT)
            yield window

    monkeypatch.setattr(flight, "rollout", some)
    assert main(["fly", "--robots", "6", "--live", "web", "--record", "a.rrd"]) == 130
    assert "Interrupted after 40 of 500 windows." in capsys.readouterr().err
    assert len(windows(here / "a.rrd")) == 40


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--live",), "there is no display .*; --live web"),
        (("--live", "tv"), "live must be one of window, web, not 'tv'"),
        (("--speed", "2"), "--speed 2 is of live flights; add --live"),
        (("--live", "web", "--speed", "fast"), "--speed"),
    ],
)
def test_what_cannot_be_shown_live_is_one_line(here, monkeypatch, capsys, options, message):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert status("fly", *SHORT, *options) == 2
    said = capsys.readouterr().err
    assert re.search(message, said)
    assert said.count("\n") == 1
    assert not list(here.iterdir())


def status(*line):
    """A command's exit code, also if its line could not be read."""
    try:
        return main(list(line))
    except SystemExit as ended:
        return ended.code
