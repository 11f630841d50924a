"""Signals at random moments leave what a Ctrl-C leaves; a reader that goes away leaves all."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from damage import RESULTS
from left_over import signalled

from swarm_mj.replay.read import check_replay

HUNG_UP = (signal.SIGHUP, signal.SIGHUP)  # as a terminal that is closed does it
WISHES = ((signal.SIGTERM,), HUNG_UP)
FLIGHT = ("fly", "--robots", 6, "--windows", 1500, "--record", "a.rrd", "--json", "a.json")
SMALL = ("--policy", "tdma", "mst", "--robots", 10, "--windows", 50, "--episodes", 50)
EVALUATION = ("evaluate", *SMALL, "--json", "r.json", "--csv", "r.csv")
BRIEF_EVALUATION = tuple(5 if value == 50 else value for value in EVALUATION)
TRAINING = (
    *("train", "--out", "run", "--robots", 3, "--windows", 20, "--missions", 4, "--latent", 4),
    *("--held-out", 2, "--evaluate-every", 128),
)
FIGURES = ("figures", RESULTS / "paper-random-walk.csv", "--out", "figures", "--figure", "fig5")


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


@pytest.fixture
def random_tries(forks, tmp_path, tries):
    """Runs `swarm-mj` in fresh folders, sent signals at random moments; yields what is left."""

    def runs(wishes, most_s, *arguments):
        rng = random.Random(str((wishes, arguments[0])))
        for number in range(tries(1)):
            own = tmp_path / str(number)
            own.mkdir()
            moment_s = rng.uniform(0.0, most_s)
            done, _ = signalled(forks, own, wishes, moment_s, "swarm_mj", *arguments)
            assert done.returncode in (0, 130), done.stderr
            assert "Traceback" not in done.stderr
            assert not [name for name in files(own) if "/." in f"/{name}"]
            yield own, files(own)

    return runs


@pytest.mark.fault("signals")
@pytest.mark.parametrize("wishes", WISHES, ids=str)
def test_a_flight_leaves_a_whole_replay(random_tries, wishes):
    """Fault 24: SIGTERM and SIGHUP left part files; a second hang-up is no second Ctrl-C."""
    for folder, left in random_tries(wishes, 2.0, *FLIGHT):
        assert left in (["a.json", "a.rrd"], [])
        if left:
            check_replay(folder / "a.rrd")


@pytest.mark.fault("signals")
@pytest.mark.parametrize("wishes", WISHES, ids=str)
def test_an_evaluation_can_be_resumed(forks, random_tries, wishes):
    """Fault 24."""
    for folder, left in random_tries(wishes, 1.2, *EVALUATION):
        assert left in ([], ["r.json.progress"], ["r.csv", "r.json"])
        if "r.json" not in left:
            done = forks.run(folder, "swarm_mj", *EVALUATION, "--resume")
            assert done.returncode == 0, done.stderr


@pytest.mark.fault("signals")
def test_a_training_can_be_resumed(forks, random_tries):
    """Fault 24."""
    for folder, left in random_tries((signal.SIGTERM,), 6.0, *TRAINING, "--budget", 10_000):
        if "run/settings.json" in left:
            done = forks.run(folder, "swarm_mj", *TRAINING[:3], "--resume", "--budget", 1)
            assert done.returncode == 0, done.stderr


def pressed(folder, delay_s, *arguments):
    """Runs a command that gets Ctrl-C so long after it began; returns its end."""
    with subprocess.Popen(
        [sys.executable, "-m", "swarm_mj", *map(str, arguments)],
        cwd=folder,
        env=os.environ | {"PYTHONPROFILEIMPORTTIME": "1"},  # which says when it has begun
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        while not process.stderr.readline().endswith(" swarm_mj.system.interrupt\n"):
            assert process.poll() is None
        time.sleep(delay_s)
        process.send_signal(signal.SIGINT)
        said = process.communicate(timeout=100.0)[1]
        lines = [line for line in said.splitlines() if not line.startswith("import time:")]
    return process.returncode, "\n".join(lines)


@pytest.mark.fault("signals")
@pytest.mark.parametrize("command", ["train", "film"])
def test_a_real_ctrl_c_is_heard_from_the_first_moment_on(forks, tmp_path, tries, command):
    """A training went on to its end; a film ended with -2, and was there."""
    flown = tmp_path / "flown"
    flown.mkdir()
    film = ("replay", flown / "a.rrd", "--video", "film.mp4")
    arguments = (*TRAINING, "--budget", 10_000) if command == "train" else film
    if command == "film":
        assert forks.run(flown, "swarm_mj", *FLIGHT).returncode == 0
    rng = random.Random(command)
    for number in range(tries(4)):
        own = tmp_path / str(number)
        own.mkdir()
        # Until the command line is read, the signal ends the process as it does any other.
        code, said = pressed(own, rng.uniform(0.0, 1.0 if number % 2 else 0.3), *arguments)
        assert code in (130, -signal.SIGINT), said
        assert "Traceback" not in said
        left = files(own)
        assert left == [] or "run/settings.json" in left, left


# Runs `swarm-mj`, and hangs up while it imports a module; the exception is lost in a `__del__`.
SWALLOWED = """
import builtins, runpy, signal, sys
class Swallows:
    def __del__(self):
        signal.raise_signal(signal.SIGHUP)
left = sys.argv[1:2]
importing = builtins.__import__
def imports(name, *arguments, **options):
    module = importing(name, *arguments, **options)
    if name in left:
        left.clear()
        Swallows()
    return module
builtins.__import__ = imports
sys.argv = ["swarm-mj", *sys.argv[2:]]
runpy.run_module("swarm_mj", run_name="__main__")
"""
COMPARISON = ("study", "compare", "m.parquet", "m.parquet")
LATE = {  # what a command loads only when it has begun, and what makes the command's input
    "swarm_mj.evaluation.figures.style": (FIGURES, None),
    "swarm_mj.evaluation.missions_table": (COMPARISON, (*BRIEF_EVALUATION[:-4], "--parquet")),
    "swarm_mj.api.charts": (("curves", "run", "--plot", "c.svg"), TRAINING),
}


@pytest.mark.slow
@pytest.mark.fault("signals")
@pytest.mark.parametrize("module", LATE)
def test_a_hang_up_that_a_module_swallows_while_it_loads_ends_the_command(forks, tmp_path, module):
    """Fault 3: they drew, wrote or compared to their end, which they then called interrupted."""
    command, before = LATE[module]
    if before:
        ending = ("m.parquet",) if before[-1] == "--parquet" else ("--budget", 128)
        assert forks.run(tmp_path, "swarm_mj", *before, *ending).returncode == 0
    script = tmp_path.with_suffix(".py")
    script.write_text(SWALLOWED)
    was = files(tmp_path)
    done = forks.run(tmp_path, script, module, *command)
    assert done.returncode == 130, done.stderr
    assert "Traceback" not in done.stderr
    assert "means over missions" not in done.stdout
    assert files(tmp_path) == was


@pytest.mark.fault("signals")
def test_figures_leave_no_parts(random_tries):
    """Fault 24, of what is written outside of any flight."""
    assert list(random_tries((signal.SIGTERM,), 2.0, *FIGURES))


@pytest.mark.fault("signals")
def test_under_nohup_the_work_goes_on(forks, tmp_path):
    """What ignores hang-ups when it is started still does."""
    arguments = ("swarm_mj", *EVALUATION)
    done, _ = signalled(forks, tmp_path, HUNG_UP, 0.5, *arguments, ignored=[signal.SIGHUP])
    assert done.returncode == 0, done.stderr
    assert files(tmp_path) == ["r.csv", "r.json"]


# Runs `swarm-mj` with standard streams whose reader has gone, or that are on a full disk.
UNHEARD = """
import os, pty, sys
from swarm_mj.cli import main
if __name__ == "__main__":
    kind, numbers = sys.argv[1:3]
    if kind == "full":
        writer = os.open("/dev/full", os.O_WRONLY)
    else:
        reader, writer = os.pipe() if kind == "pipe" else pty.openpty()
        os.close(reader)
    for number in numbers:
        os.dup2(writer, int(number))
    os.close(writer)
    sys.exit(main(sys.argv[3:]))
"""
SHORT = (*FLIGHT[:4], 50, *FLIGHT[5:])
FLOWN, EVALUATED = ["a.json", "a.rrd"], ["r.csv", "r.json"]


@pytest.fixture
def unheard(forks, tmp_path):
    """Runs `swarm-mj` with such streams."""
    script = tmp_path.with_suffix(".py")
    script.write_text(UNHEARD)
    return lambda *arguments: forks.run(tmp_path, script, *arguments)


@pytest.mark.slow
@pytest.mark.fault("readers that go away")
@pytest.mark.parametrize("kind", ["pipe", "terminal"])
@pytest.mark.parametrize(
    ("arguments", "left"),
    [(EVALUATION, EVALUATED), (SHORT, FLOWN), (("--help",), []), (("--version",), [])],
)
def test_a_reader_that_goes_away_is_no_error(unheard, tmp_path, kind, arguments, left):
    """Fault 28: a closed pipe gave exit 1; a closed terminal ended the work."""
    assert unheard(kind, "12", *arguments).returncode == 0
    assert files(tmp_path) == left


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.fault("streams on a full disk")
@pytest.mark.parametrize(
    ("numbers", "arguments", "left"),
    [
        ("1", BRIEF_EVALUATION, EVALUATED),
        ("1", SHORT, FLOWN),
        ("12", SHORT, FLOWN),
        ("1", ("--version",), []),
    ],
)
def test_streams_on_a_full_disk_end_no_work(unheard, tmp_path, numbers, arguments, left):
    """It was two tracebacks and exit 120, and a flight was lost."""
    done = unheard("full", numbers, *arguments)
    assert done.returncode == 1
    told = "swarm-mj: error: not all output was written: No space left on device"
    assert done.stderr.splitlines()[-1:] == ([] if "2" in numbers else [told])  # after notes
    assert files(tmp_path) == left
