"""What is written is whole or was never there: full disks, kills, links and inputs as outputs."""

import os
import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from damage import RESULTS, ROOT
from file_limits import no_larger_files
from tiny_policies import save_tiny

from swarm_mj.cli import main
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay.read import check_replay
from swarm_mj.replay.recorder import Recorder
from swarm_mj.replay.write import write_replay
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

WALK = str(RESULTS / "paper-random-walk.csv")
SMALL = ("--robots", "7", "--windows", "12", "--range-ratio", "0.5")
ENDS_S = 10.0  # the longest that a writer that cannot write may take to say so


def names(folder):
    """All that a folder holds, hidden files included."""
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


@pytest.fixture(scope="module")
def small_disk(tmp_path_factory):
    """A file system of 256 kB."""
    place = tmp_path_factory.mktemp("disk")
    command = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", place]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("this machine's user may not mount file systems")
    yield place
    subprocess.run(["umount", place], check=True)


@pytest.fixture(scope="module")
def flown():
    """A small flight's log."""
    mission = paper("flocking", num_robots=12, num_windows=60)
    swarm = Swarm(mission, [1])
    recorder = Recorder(swarm)
    for window in rollout(swarm, make_policy("planner", mission)):
        recorder.add(window)
    return recorder.log()


def said_in_one_line(capsys, path, reason):
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    assert str(path) in lines[0], lines[0]
    assert reason in lines[0], lines[0]


@pytest.mark.fault("replays on full disks")
def test_a_replay_on_a_full_disk_leaves_the_old_one(flown, small_disk, tries):
    """Faults 1 and 2: wherever the disk is full, at once or after some of the replay."""
    path, filler = small_disk / "a.rrd", small_disk / "filler"
    write_replay(flown, {"seed": 1}, small_disk.parent / "whole.rrd")
    needed = (small_disk.parent / "whole.rrd").stat().st_size
    path.write_bytes(b"old")
    free = os.statvfs(small_disk).f_bavail * 4096
    assert needed > 10_000
    for kept in np.linspace(0, 160_000, tries(12)).astype(int):
        filler.write_bytes(bytes(max(0, free - kept)))
        start_s = time.monotonic()
        if kept > needed + 8192:
            write_replay(flown, {"seed": 1}, path)
            check_replay(path)
            path.write_bytes(b"old")
        else:
            with pytest.raises(OSError, match=r"a\.rrd could not be written: No space left"):
                write_replay(flown, {"seed": 1}, path)
        assert time.monotonic() - start_s < ENDS_S
        assert path.read_bytes() == b"old"
        assert names(small_disk) == ["a.rrd", "filler"]
    filler.unlink()


@pytest.mark.fault("replays on full disks")
def test_a_flight_whose_replay_finds_no_place_says_so(here, capsys):
    """Fault 1: exit code 1, one line, the old replay and the table of what was flown."""
    assert main(["fly", *SMALL, "--record", "a.rrd"]) == 0
    old = Path("a.rrd").read_bytes()
    capsys.readouterr()
    with no_larger_files(len(old) // 2):
        assert main(["fly", *SMALL, "--seed", "2", "--record", "a.rrd", "--force", "--yes"]) == 1
    printed = capsys.readouterr()
    assert printed.err.strip().endswith("a.rrd could not be written: File too large")
    assert "age of information" in printed.out.lower()
    assert "Open the replay" not in printed.out
    assert Path("a.rrd").read_bytes() == old
    assert names(here) == ["a.rrd"]


EVALUATE = ["evaluate", *SMALL, "--policy", "tdma", "--episodes", "2"]
FIGURE = ["figures", WALK, "--figure", "fig5", "--out", ".", "--format"]
# What writes a kind of file, whatever is estimated, and the file.
WRITTEN = {
    "replay": (["fly", *SMALL, "--record", "a.rrd", "--yes"], "a.rrd"),
    "summary": (["fly", *SMALL, "--no-record", "--json", "a.json"], "a.json"),
    "scene": (["scene", "--robots", "5", "--range-ratio", "0.5", "--out", "a.xml"], "a.xml"),
    "csv": ([*EVALUATE, "--csv", "a.csv"], "a.csv"),
    "json": ([*EVALUATE, "--json", "a.json"], "a.json"),
    "svg": ([*FIGURE, "svg"], "fig5"),
    "png": ([*FIGURE, "png"], "fig5"),
}


@pytest.mark.slow
@pytest.mark.fault("outputs on full disks")
@pytest.mark.parametrize("kind", WRITTEN)
def test_no_kind_of_output_is_left_in_part(here, capsys, kind):
    """Fault 1, of all kinds: nothing is there, and no work is done if not a page can be written."""
    arguments, name = WRITTEN[kind]
    for most in (0, 6000) if kind in ("replay", "svg", "png") else (0,):  # others are small
        with no_larger_files(most):
            assert main(arguments) == 1
        said_in_one_line(capsys, name, "File too large")
        assert names(here) == []


@pytest.mark.fault("outputs on full disks")
def test_a_training_on_a_full_disk_ends_and_goes_on(here, capsys):
    """Fault 1, of checkpoints: one line, the last checkpoint stays, and the run ends as ever."""
    run = ["--robots", "4", "--windows", "12", "--range-ratio", "1", "--missions", "4"]
    run += ["--held-out", "2", "--evaluate-every", "128", "--latent", "4"]
    assert main(["train", "--out", "r", *run, "--budget", "64"]) == 0
    kept = (here / "r" / "checkpoint.pt").read_bytes()
    capsys.readouterr()
    with no_larger_files(len(kept) // 2):
        assert main(["train", "--out", "r", "--resume", "--budget", "128", "--yes"]) == 1
    assert "could not be written: File too large" in capsys.readouterr().err.splitlines()[-1]
    assert (here / "r" / "checkpoint.pt").read_bytes() == kept
    assert not [name for name in names(here) if name.endswith(".part")]
    assert main(["train", "--out", "r", "--resume", "--budget", "128"]) == 0


@pytest.mark.slow
@pytest.mark.fault("memory and threads of replays")
def test_replays_leave_no_threads_and_no_memory(flown, tmp_path, tries):
    """Fault 10."""

    def used():
        lines = Path("/proc/self/status").read_text().splitlines()
        fields = dict(line.split(":", 1) for line in lines)
        return int(fields["Threads"]), int(fields["VmRSS"].split()[0]) / 1024

    if not Path("/proc/self/status").exists():
        pytest.skip("this machine does not tell its threads")
    for _ in range(3):
        write_replay(flown, {"seed": 1}, tmp_path / "a.rrd")
    threads, mib = used()
    num_tries = tries(20)
    for _ in range(num_tries):
        write_replay(flown, {"seed": 1}, tmp_path / "a.rrd")
    more_threads, more_mib = np.subtract(used(), (threads, mib))
    assert more_threads <= 0
    assert more_mib < 20 + 0.2 * num_tries


# Writes a file, and dies before its Nth step on the disk.
WRITE_AND_DIE = """
import os, signal, sys
from pathlib import Path
from swarm_mj.system.writing import write_bytes
last, folder = int(sys.argv[1]), sys.argv[2]
steps = 0
def die(event, arguments):
    global steps
    if event in ("open", "os.rename", "os.remove", "os.rmdir", "os.mkdir", "os.truncate"):
        if folder in str(arguments[0]):
            steps += 1
            if steps > last:
                os.kill(os.getpid(), signal.SIGKILL)
sys.addaudithook(die)
content = sys.argv[3].encode() * 5000
write_bytes(Path(folder, "file"), content)
sys.exit(0)
"""


@pytest.mark.fault("kills at each step")
def test_a_kill_at_any_step_leaves_what_was_or_what_is_new(forks, tmp_path, record_property):
    """Fault 24: and the next to write there sweeps what is left."""
    program = tmp_path / "program.py"
    program.write_text(WRITE_AND_DIE)
    place = tmp_path / "place"
    assert forks.run(tmp_path, program, 10**6, place, "old").returncode == 0
    was = "old"
    for last in range(60):
        new = f"{last:03}"
        died = forks.run(tmp_path, program, last, place, new).returncode
        now = (place / "file").read_text()
        assert now in (new * 5000, was * 5000 if last == 0 else now[:3] * 5000)
        was = now[:3]
        if died == 0:
            break
    assert died == 0
    assert names(place) == ["file"]
    record_property("tries", last + 1)


# Flies, and sends itself a signal when anything is then written as far as the disk.
FLY_AND_SIGNAL = """
import os, sys
from swarm_mj.cli import fly, main
fsync, run = os.fsync, fly.fly_mission
def told(number):
    os.kill(os.getpid(), int(sys.argv[1]))
    fsync(number)
def flown(*arguments, **options):
    done = run(*arguments, **options)
    os.fsync = told
    return done
fly.fly_mission = flown
sys.exit(main(sys.argv[2:]))
"""


@pytest.mark.fault("kills at each step")
@pytest.mark.parametrize("end", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_while_writing_leaves_no_part(forks, tmp_path, end):
    """Fault 24: sent by the writer to itself in the middle of each kind of file."""
    program, place = tmp_path / "program.py", tmp_path / "place"
    program.write_text(FLY_AND_SIGNAL)
    place.mkdir()
    done = forks.run(place, program, int(end), "fly", *SMALL, "--record", "a.rrd")
    assert done.returncode in (0, 130), done.stderr
    assert names(place) in ([], ["a.rrd"])
    if names(place):
        check_replay(place / "a.rrd")


LOOPED = {  # programs and commands with an output that is a link to itself
    "fly": ["swarm_mj", "fly", *SMALL, "--record", "loop.rrd", "--force"],
    "summary": ["swarm_mj", "fly", *SMALL, "--no-record", "--json", "loop.json", "--force"],
    "evaluate": ["swarm_mj", "evaluate", *SMALL, "--csv", "loop.csv", "--force"],
    "progress": ["swarm_mj", "evaluate", *SMALL, "--json", "o.json", "--force"],
    "figures": ["swarm_mj", "figures", WALK, "--out", "loop", "--force"],
    "scene": ["swarm_mj", "scene", "--out", "loop.xml", "--force"],
    "train": ["swarm_mj", "train", "--out", "loop", "--budget", "1"],
    "tune": [ROOT / "tools" / "tune.py", "--episodes", "2", "--windows", "3", "--out", "loop.csv"],
    "readme figure": [ROOT / "training" / "readme_figure.py", "--out", "loop"],
    "results": [ROOT / "training" / "results.py", "--results", "loop"],
}


@pytest.mark.fault("outputs that cannot be")
@pytest.mark.parametrize("program", LOOPED)
def test_links_that_lead_in_circles_are_told_before_the_work(forks, tmp_path, program):
    """Faults 12, 19 and 21."""
    endings = ("rrd", "json", "csv", "xml", "svg")
    loops = ["loop", "o.json.progress", *(f"loop.{ending}" for ending in endings)]
    for name in loops:
        (tmp_path / name).symlink_to(name)
    done = forks.run(tmp_path, *LOOPED[program])
    assert done.returncode == 2, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1, done.stderr
    assert "Too many levels of symbolic links" in done.stderr
    assert names(tmp_path) == sorted(loops)


@pytest.mark.fault("outputs that cannot be")
@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["--json", "o.json", "--csv", "o.json.progress"], "must be named *.csv"),  # fault 13
        (["--csv", "a.csv", "--policy", "p", "--force"], None),
        (["--json", "p/s.json", "--policy", "./p", "--force"], "is an input, or part of one"),
        (["--csv", "pipe.csv"], "is a device or a pipe"),
    ],
)
def test_outputs_are_no_inputs_and_no_progress(here, capsys, arguments, complaint):
    """Fault 13: two outputs are two files, and none is what is read."""
    save_tiny(here / "p" / "policy", "paper")
    (here / "p" / "s.json").write_text("{}")
    os.mkfifo(here / "pipe.csv")
    before = (here / "p" / "policy.safetensors").read_bytes()
    code = main(["evaluate", *SMALL, "--episodes", "2", *arguments])
    assert code == (0 if complaint is None else 2)
    if complaint:
        said_in_one_line(capsys, "", complaint)
        assert "o.json" not in names(here)
    assert (here / "p" / "policy.safetensors").read_bytes() == before
    assert (here / "p" / "s.json").read_text() == "{}"


WALLS = """<mujoco><worldbody>
<geom name="wall" type="box" size="1 20 5" pos="30 0 5" group="1"/></worldbody></mujoco>
"""
GAINS = "x1_m,y1_m,x2_m,y2_m,gain_db\n" + "".join(f"0,0,{n},0,-60\n" for n in range(1, 10))
OWN = """from swarm_mj.policies.centralised import RoundRobin
class Mine(RoundRobin):
    about = None
"""
STUDY = """[study]
policies = ["tdma"]
episodes = 1
[mission]
num_robots = 5
num_windows = 12
range_ratio = 1
"""
READ = {  # files that commands read, and what each holds
    "a.xml": WALLS,
    "g.csv": GAINS,
    "mine.py": OWN,
    "s.toml": STUDY,
    "walk.csv": Path(WALK).read_text(encoding="utf-8"),
}
# What would write over an input: through its own name, where the output may have it, or a link.
OVER_INPUTS = {
    "table": ["evaluate", *SMALL, "--channel", "table:g.csv", "--csv", "g.csv"],
    "table, link": ["evaluate", *SMALL, "--channel", "table:g.csv", "--json", "to-g.csv.json"],
    "table of a flight": ["fly", *SMALL, "--channel", "table:g.csv", "--json", "to-g.csv.json"],
    "arena": ["scene", "--arena", "./a.xml", "--out", "a.xml"],
    "arena, link": ["scene", "--arena", "a.xml", "--out", "to-a.xml.xml"],
    "arena of a flight": ["fly", *SMALL, "--arena", "a.xml", "--json", "to-a.xml.json"],
    "arena of an evaluation": ["evaluate", *SMALL, "--arena", "a.xml", "--csv", "to-a.xml.csv"],
    "study": ["study", "run", "s.toml", "--csv", "to-s.toml.csv"],
    "chart of a study": ["study", "run", "s.toml", "--plot", "to-s.toml.svg"],
    "own policy": ["fly", *SMALL, "--policy", "mine:Mine", "--json", "to-mine.py.json"],
    "own policies": ["evaluate", *SMALL, "--policy", "mine:Mine", "--json", "to-mine.py.json"],
    "results": ["figures", "walk.csv", "--figure", "fig5", "--format", "svg", "--out", "figures"],
}


@pytest.mark.fault("outputs that cannot be")
@pytest.mark.parametrize("case", OVER_INPUTS)
def test_no_input_of_any_kind_is_an_output(forks, tmp_path, case):
    """What an option names to be read is declared on the option, and kept by every command."""
    (tmp_path / "figures").mkdir()
    (tmp_path / "figures" / "fig5.svg").symlink_to(tmp_path / "walk.csv")
    for name, content in READ.items():
        (tmp_path / name).write_text(content, encoding="utf-8")
        for ending in ("csv", "json", "svg", "xml"):
            (tmp_path / f"to-{name}.{ending}").symlink_to(name)
    done = forks.run(tmp_path, "swarm_mj", *OVER_INPUTS[case], "--force")
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert "is an input, or part of one; name another" in done.stderr
    for name, content in READ.items():
        assert (tmp_path / name).read_text(encoding="utf-8") == content
    assert not list(tmp_path.glob("*.progress"))


@pytest.mark.fault("outputs that cannot be")
@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("old.png", "picture old.png exists; name another, or replace it with --force"),
        ("a.jpg", "picture must be named *.png, not a.jpg"),
        (".", "picture . is a folder"),
    ],
)
def test_a_picture_s_output_is_checked_first(forks, tmp_path, name, complaint):
    """Fault 21: before the replay is looked at, let alone the viewer started."""
    (tmp_path / "old.png").write_bytes(b"old")
    done = forks.run(tmp_path, ROOT / "tools" / "picture.py", "none.rrd", "--out", name)
    assert done.returncode == 2
    assert complaint in done.stderr
    assert (tmp_path / "old.png").read_bytes() == b"old"
