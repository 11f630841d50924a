"""`swarm-mj train`: what it prints, writes, refuses, and how it goes on."""

import itertools
import re
import shlex
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from forks import files

from swarm_mj.cli import main
from swarm_mj.learning import held_out
from swarm_mj.learning.index_session import IndexSession
from swarm_mj.learning.run_folder import read_run
from swarm_mj.learning.train import TrainingSession
from swarm_mj.policies.stored import read_policy
from swarm_mj.replay import view
from swarm_mj.replay.read import windows
from swarm_mj.system import packages

MISSIONS = ("--robots", "4", "--windows", "12", "--range-ratio", "1", "--missions", "4")
PPO = ("--rollout-windows", "32", "--minibatches", "10")
SMALL = (*MISSIONS, *PPO, "--latent", "4", "--held-out", "2", "--evaluate-every", "128")
ROLLOUT = 128  # decisions: 4 missions for 32 windows


def train(*arguments):
    """Runs the command in this process, in the folder that it is in."""
    torch.set_num_threads(1)
    return main(["train", *map(str, arguments)])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder with a finished run in `runs/whole`, and the process that made it."""
    folder = tmp_path_factory.mktemp("whole")
    command = [sys.executable, "-m", "swarm_mj", "train", "--out", "runs/whole", *SMALL]
    done = subprocess.run(
        [*command, "--budget", "256", "--replay-every", "200"],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    return folder, done


def test_a_run_prints_its_evaluations_and_what_it_came_to(whole):
    _, done = whole
    assert done.returncode == 0, done.stderr
    lines = done.stderr.strip().splitlines()
    assert len(lines) == 3, "something warns"
    for line, decisions in zip(lines, (0, 128, 256), strict=True):
        assert line.split()[:2] == [f"{decisions}", "decisions"]
        assert "held-out age" in line
    for row in ("policy kept", "spatial-tdma", "lookahead-oracle", "decisions", "minutes"):
        assert row in done.stdout
    assert "runs/whole: credit per robot, stationary, 4 robots" in done.stdout


@pytest.mark.usefixtures("here")
def test_an_index_is_trained_interrupted_and_flown_by_the_same_commands(here, capsys):
    """Ctrl-C waits for the generation: 12 candidates in a mission of each of two sizes."""
    index = ("--policy", "index-csma", "--robots", 4, 6, "--windows", 12, "--range-ratio", 1)
    small = ("--missions", 2, "--held-out", 2, "--evaluate-every", 288, "--budget", 864)
    with ctrl_c_at("_report", 20, of=IndexSession):
        assert train("--out", "run", *index, *small) == 130
    said = capsys.readouterr().err
    assert "Interrupted: finishing this generation, then all is kept" in said
    assert train("--out", "run", "--resume", "--budget", 864) == 0
    said = capsys.readouterr().out
    assert "run: index-csma by evolution, stationary, 4, 6 robots" in said
    for label in ("Fly:", "Evaluate:", "Go on:"):
        (line,) = (line for line in said.splitlines() if line.startswith(label))
        arguments = shlex.split(line.removeprefix(label))[1:]
        extra = {"Fly:": ["--no-record"], "Evaluate:": ["--episodes", "2"], "Go on:": []}[label]
        assert main([*arguments, *extra]) == 0
    assert main(["curves", "run"]) == 0
    assert (here / "run" / "curve.csv").exists()


@pytest.mark.usefixtures("here")
def test_a_logger_that_fails_is_said_and_the_run_ends_well(here, capsys):
    """What it has heard before, it keeps."""
    (here / "my_logger.py").write_text(
        "class Mine:\n"
        "    def start(self, settings, folder): print('started', folder, file=open('l', 'w'))\n"
        "    def log(self, row, decisions): raise OSError('no disk')\n"
        "    def finish(self): pass\n"
    )
    assert train("--out", "run", *SMALL, "--budget", 128, "--logger", "my_logger:Mine") == 0
    assert (here / "l").read_text() == "started run\n"
    said = capsys.readouterr().err
    assert said.count("The logger Mine failed (OSError: no disk); the run goes on without it.") == 1
    assert train("--out", "more", *SMALL, "--budget", 128, "--logger", "my_logger:Other") == 2
    assert not (here / "more").exists()


def test_a_run_leaves_what_it_says(whole):
    folder, _ = whole
    left = [name for name in files(folder) if "tfevents" not in name]
    assert left == [
        *(f"runs/whole/{name}" for name in ("checkpoint.pt", "curve.csv")),
        "runs/whole/policy.safetensors",
        *(f"runs/whole/replays/decisions-000000{n}.rrd" for n in ("000", "256")),
        "runs/whole/settings.json",
    ]
    assert len(windows(folder / "runs/whole/replays/decisions-000000256.rrd")) == 12
    _, config = read_policy(folder / "runs/whole")
    assert config.training["command"].startswith("swarm-mj train --out runs/whole --robots 4 ")
    assert read_run(folder / "runs/whole").limits.decisions == 256


@pytest.mark.parametrize("label", ["Fly:", "Evaluate:", "Go on:"])
def test_the_commands_that_it_prints_work(whole, monkeypatch, capsys, label):
    folder, done = whole
    monkeypatch.chdir(folder)
    (line,) = (line for line in done.stdout.splitlines() if line.startswith(label))
    arguments = shlex.split(line.removeprefix(label))[1:]
    extra = {"Fly:": ["--no-record"], "Evaluate:": ["--episodes", "2"], "Go on:": []}[label]
    assert main([*arguments, *extra]) == 0
    capsys.readouterr()


@contextmanager
def ctrl_c_at(method, *calls, of=TrainingSession):
    """Presses Ctrl-C in certain windows of the training, or of its evaluations."""
    original, count = getattr(of, method), itertools.count(1)

    def pressing(session, *arguments):
        if next(count) in calls:
            signal.raise_signal(signal.SIGINT)
        return original(session, *arguments)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(of, method, pressing)
        yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_the_device_is_kept_until_another_is_named(monkeypatch, capsys):
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    for given, kept in (
        (("--device", "cpu", *SMALL, "--budget", 128), "cpu"),
        (("--resume",), "cpu"),
        (("--resume", "--device", "auto", "--budget", 256), "auto"),
    ):
        assert train("--out", "r", *given) == 0
        assert read_run(Path("r")).device == kept
    assert train("--out", "r", "--resume", "--device", "cuda") == 2
    assert "torch finds no CUDA device on this machine" in capsys.readouterr().err
    assert read_run(Path("r")).device == "auto"


@pytest.mark.usefixtures("here")
def test_ctrl_c_finishes_the_rollout_and_tells_how_to_go_on(capsys):
    with ctrl_c_at("_on_step", 40):
        assert train("--out", "r", *SMALL, "--budget", 512) == 130
    printed = capsys.readouterr()
    assert "Interrupted: finishing this rollout, then all is kept; Ctrl-C again" in printed.err
    assert "Interrupted after 256 decisions; all is kept." in printed.err
    assert "train --out r --resume\n" in printed.out
    assert train("--out", "r", "--resume") == 0
    printed = capsys.readouterr()
    assert [line.split()[0] for line in printed.err.splitlines()] == ["256", "384", "512"]


def test_ctrl_c_in_an_evaluation_leaves_it_for_later(here, capsys):
    with ctrl_c_at("_report", 5):
        assert train("--out", "r", *SMALL, "--budget", 128) == 130
    assert "none yet" in capsys.readouterr().out
    assert train("--out", "r", "--resume") == 0
    assert (here / "r" / "policy.safetensors").exists()


@pytest.mark.slow
def test_a_second_ctrl_c_breaks_off_and_leaves_nothing_half_done(here, capsys):
    with ctrl_c_at("_on_step", 40, 45):
        assert train("--out", "r", *SMALL, "--budget", 256) == 130
    printed = capsys.readouterr()
    assert "Broken off; the last checkpoint is kept." in printed.err
    assert "train --out r --resume\n" in printed.err
    assert "Traceback" not in printed.err
    assert not [path for path in (here / "r").iterdir() if path.name.startswith(".")]
    assert train("--out", "r", "--resume") == 0


def test_ctrl_c_while_it_is_being_prepared_leaves_nothing(here, monkeypatch, capsys):
    def interrupted(*_arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr("swarm_mj.cli.train_settings.asked_settings", interrupted)
    assert train("--out", "r", *SMALL) == 130
    assert "interrupted" in capsys.readouterr().err
    assert files(here) == []


@pytest.mark.slow
def test_limits_are_kept_and_may_be_moved(here, capsys):
    train("--out", "r", *SMALL, "--budget", 128)
    train("--out", "r", "--resume", "--budget", 256, "--replay-every", 256)
    limits = read_run(here / "r").limits
    assert (limits.decisions, limits.replay_every) == (256, 256)
    assert len(list((here / "r" / "replays").iterdir())) == 1 + 1
    train("--out", "r", "--resume", "--minutes", 1e-6)
    limits = read_run(here / "r").limits
    assert (limits.decisions, limits.minutes) == (None, 1e-6)
    assert read_run(here / "r").command.endswith("--evaluate-every 128 --budget 128")
    said = capsys.readouterr().err
    assert "Nothing was left to train: the run made 256 decisions in " in said
    assert " of 1e-06 minutes. Raise --budget or --minutes, which count in all" in said


@pytest.mark.usefixtures("here")
def test_credit_team_trains_a_flock_for_its_velocities(capsys):
    options = ("--credit", "team", "--task", "flocking", "--reward", "velocity-variance")
    assert train("--out", "r", *SMALL, *options, "--budget", 1) == 0
    assert "m²/s²" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.usefixtures("here")
def test_a_run_of_several_sizes_in_a_folder_of_odd_letters_is_kept_and_quoted(capsys):
    out = Path("runs") / "a [red] b"
    several = ("--robots", 3, 4, 5, "--windows", 12, "--range-ratio", 1, "--latent", 4)
    assert train("--out", out, *several, "--held-out", 1, "--budget", 1) == 0
    printed = capsys.readouterr().out
    assert "runs/a [red] b: credit per robot, stationary, 3, 4, 5 robots" in printed
    assert "train --out 'runs/a [red] b' --resume" in printed


@pytest.fixture
def viewer(monkeypatch):
    """A viewer that keeps its recordings to itself, and fails when it is closed after the run."""
    seen = SimpleNamespace(num_shown=0, num_waits=0)

    def connect(_recording, _address):
        seen.num_shown += 1

    def wait():
        seen.num_waits += 1
        return 1

    @contextmanager
    def opened(_where):
        process = SimpleNamespace(wait=wait, poll=lambda: None)
        yield view.LiveViewer(process=process, address="rerun+http://127.0.0.1:9/proxy", page="P")

    monkeypatch.setattr(view, "live_viewer", opened)
    monkeypatch.setattr("rerun.RecordingStream.connect_grpc", connect)
    return seen


@pytest.mark.usefixtures("here")
def test_a_run_that_is_shown_waits_for_its_viewer_in_the_end(viewer, capsys):
    assert train("--out", "r", *SMALL, "--budget", 128, "--live", "web") == 0
    assert (viewer.num_shown, viewer.num_waits) == (2, 1)
    printed = capsys.readouterr()
    assert "Open P\nCtrl-C ends it." in printed.out
    assert printed.out.endswith("The viewer stays at P\nCtrl-C ends it.\n")
    assert "policy kept" in printed.out
    assert train("--out", "r", "--resume", "--live", "web") == 0
    assert (viewer.num_shown, viewer.num_waits) == (3, 2)
    assert "Nothing was left to train" in capsys.readouterr().err


@pytest.mark.usefixtures("here")
def test_ctrl_c_ends_a_run_that_is_shown_as_any_other(viewer, capsys):
    with ctrl_c_at("_on_step", 40):
        assert train("--out", "r", *SMALL, "--budget", 512, "--live", "web") == 130
    assert (viewer.num_shown, viewer.num_waits) == (2, 0)
    assert "Interrupted after 256 decisions; all is kept." in capsys.readouterr().err
    assert read_run(Path("r")).limits.decisions == 512
    assert train("--out", "r", "--resume", "--budget", 384) == 0


@pytest.mark.usefixtures("here")
def test_ctrl_c_while_a_mission_is_shown_finishes_the_rollout(viewer, monkeypatch, capsys):
    flies = held_out.record_first

    def pressing(*arguments):
        signal.raise_signal(signal.SIGINT)
        return flies(*arguments)

    monkeypatch.setattr(held_out, "record_first", pressing)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    assert train("--out", "r", *SMALL, "--budget", 512, "--live", "web") == 130
    signal.signal(signal.SIGINT, before)
    assert (viewer.num_shown, viewer.num_waits) == (0, 0)
    assert "Interrupted after 0 decisions; all is kept." in capsys.readouterr().err
    assert len((Path("r") / "curve.csv").read_text().splitlines()) == 1 + 1


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--live",), "there is no display .*; --live web"),
        (("--live", "tv"), "live must be one of window, web, not 'tv'"),
        (("--live", "web", "--speed", "2"), "unrecognized arguments: --speed"),
        (("--live", "web", "--sweep", "a.toml"), "--live shows one training; leave it out of a"),
    ],
)
def test_what_cannot_be_shown_is_one_line(here, monkeypatch, capsys, options, message):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    try:
        code = train("--out", "r", *options)
    except SystemExit as ended:
        code = ended.code
    assert code == 2
    said = capsys.readouterr().err
    assert re.search(message, said)
    assert said.count("\n") == 1
    assert files(here) == []


def test_without_rerun_a_training_is_not_shown(here, monkeypatch, capsys):
    monkeypatch.setattr(packages, "is_installed", lambda _module: False)
    assert train("--out", "r", *SMALL, "--live", "web") != 0
    said = capsys.readouterr().err
    assert "a live replay needs rerun-sdk, which is not installed" in said
    assert "leave out --live" in said
    assert files(here) == []


def test_a_viewer_that_does_not_open_leaves_no_run(here, monkeypatch, capsys):
    monkeypatch.setattr(view, "VIEWER", (sys.executable, "-c", "raise SystemExit(3)"))
    assert train("--out", "r", *SMALL, "--live", "web") == 1
    assert "rerun's viewer ended as it was opened (exit code 3)" in capsys.readouterr().err
    assert files(here) == []
