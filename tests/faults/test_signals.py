"""Signals at random moments leave what a Ctrl-C leaves; a reader that goes away leaves all."""

import random
import signal
from pathlib import Path

import pytest
from left_over import signalled
from tries import tries

from swarm_mj.replay.read import check_replay

RESULTS = Path(__file__).parent.parent.parent / "training" / "results" / "paper-random-walk.csv"
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
FIGURES = ("figures", RESULTS, "--out", "figures", "--figure", "fig5")


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def hidden(folder):
    return [name for name in files(folder) if "/." in f"/{name}"]


def random_tries(forks, folder, wishes, most_s, *arguments):
    """Runs `swarm-mj` in fresh folders, sent signals at random moments."""
    rng = random.Random(str((wishes, arguments[0])))
    for number in range(tries(1)):
        own = folder / str(number)
        own.mkdir()
        done, _ = signalled(forks, own, wishes, rng.uniform(0.0, most_s), "swarm_mj", *arguments)
        assert done.returncode in (0, 130), done.stderr
        assert "Traceback" not in done.stderr
        assert not hidden(own)
        yield own, done


@pytest.mark.fault("signals")
@pytest.mark.parametrize("wishes", WISHES, ids=str)
def test_a_flight_leaves_a_whole_replay(forks, tmp_path, record_property, wishes):
    """Fault 24: SIGTERM and SIGHUP left part files; a second hang-up is no second Ctrl-C."""
    for folder, done in random_tries(forks, tmp_path, wishes, 2.0, *FLIGHT):
        left = files(folder)
        assert left in (["a.json", "a.rrd"], []), done.stderr
        if left:
            check_replay(folder / "a.rrd")
    record_property("tries", tries(1))


@pytest.mark.fault("signals")
@pytest.mark.parametrize("wishes", WISHES, ids=str)
def test_an_evaluation_can_be_resumed(forks, tmp_path, record_property, wishes):
    """Fault 24."""
    for folder, _ in random_tries(forks, tmp_path, wishes, 1.2, *EVALUATION):
        assert set(files(folder)) in (set(), {"r.json.progress"}, {"r.csv", "r.json"})
        if not (folder / "r.json").exists():
            done = forks.run(folder, "swarm_mj", *EVALUATION, "--resume")
            assert done.returncode == 0, done.stderr
    record_property("tries", tries(1))


@pytest.mark.fault("signals")
def test_a_training_can_be_resumed(forks, tmp_path, record_property):
    """Fault 24."""
    for folder, done in random_tries(
        forks, tmp_path, (signal.SIGTERM,), 6.0, *TRAINING, "--budget", 10_000
    ):
        if (folder / "run" / "settings.json").exists():
            done = forks.run(folder, "swarm_mj", *TRAINING[:3], "--resume", "--budget", 1)
            assert done.returncode == 0, done.stderr
    record_property("tries", tries(1))


@pytest.mark.fault("signals")
def test_figures_leave_no_parts(forks, tmp_path, record_property):
    """Fault 24, of what is written outside of any flight."""
    for _ in random_tries(forks, tmp_path, (signal.SIGTERM,), 2.0, *FIGURES):
        pass
    record_property("tries", tries(1))


@pytest.mark.fault("signals")
def test_under_nohup_the_work_goes_on(forks, tmp_path):
    """What ignores hang-ups when it is started still does."""
    arguments = ("swarm_mj", *EVALUATION)
    done, _ = signalled(forks, tmp_path, HUNG_UP, 0.5, *arguments, ignored=[signal.SIGHUP])
    assert done.returncode == 0, done.stderr
    assert files(tmp_path) == ["r.csv", "r.json"]


# Runs `swarm-mj` with standard streams whose reader has gone.
UNREAD = """
import os, pty, sys
from swarm_mj.cli import main
if __name__ == "__main__":
    reader, writer = getattr({"os": os, "pty": pty}[sys.argv[1]], sys.argv[2])()
    os.dup2(writer, 1)
    os.dup2(writer, 2)
    os.close(writer)
    os.close(reader)
    sys.exit(main(sys.argv[3:]))
"""


@pytest.mark.fault("readers that go away")
@pytest.mark.parametrize("kind", [("os", "pipe"), ("pty", "openpty")], ids=str)
@pytest.mark.parametrize(
    ("arguments", "left"),
    [
        (EVALUATION, ["r.csv", "r.json"]),
        ((*FLIGHT[:4], 50, *FLIGHT[5:]), ["a.json", "a.rrd"]),
        (("--help",), []),
        (("--version",), []),
    ],
)
def test_a_reader_that_goes_away_is_no_error(forks, tmp_path, kind, arguments, left):
    """Fault 28: a closed pipe gave exit 1; a closed terminal ended the work."""
    script = tmp_path.with_suffix(".py")
    script.write_text(UNREAD)
    assert forks.run(tmp_path, script, *kind, *arguments).returncode == 0
    assert files(tmp_path) == left


# Runs `swarm-mj` with some of its standard streams on a full disk.
FULL = """
import os, sys
from swarm_mj.cli import main
if __name__ == "__main__":
    for number in sys.argv[1]:
        os.dup2(os.open("/dev/full", os.O_WRONLY), int(number))
    sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.fault("streams on a full disk")
@pytest.mark.parametrize(
    ("numbers", "arguments", "left"),
    [
        ("1", BRIEF_EVALUATION, ["r.csv", "r.json"]),
        ("1", (*FLIGHT[:4], 50, *FLIGHT[5:]), ["a.json", "a.rrd"]),
        ("12", (*FLIGHT[:4], 50, *FLIGHT[5:]), ["a.json", "a.rrd"]),
        ("1", ("--version",), []),
    ],
)
def test_streams_on_a_full_disk_end_no_work(forks, tmp_path, numbers, arguments, left):
    """It was two tracebacks and exit 120, and a flight was lost."""
    script = tmp_path.with_suffix(".py")
    script.write_text(FULL)
    done = forks.run(tmp_path, script, numbers, *arguments)
    assert done.returncode == 1
    told = "swarm-mj: error: not all output was written: No space left on device"
    assert done.stderr.splitlines() == ([] if "2" in numbers else [told])
    assert files(tmp_path) == left
