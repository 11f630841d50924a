"""What surrounds a command: its locale and terminal, folders, the network, and its twin."""

import csv
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

ROBOTS = ("--robots", "4", "--windows", "3")
TDMA = ("--policy", "tdma")
COMMANDS = {
    "fly": ("fly", *ROBOTS, *TDMA, "--no-record", "--json", "a.json"),
    "evaluate": ("evaluate", *ROBOTS, *TDMA, "--episodes", "2", "--wide", "--csv", "a.csv"),
    "policies": ("policies", "planner"),
}
SURROUNDINGS = {
    "C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "narrow": {"TERM": "dumb", "COLUMNS": "20", "LINES": "3"},
    "odd": {"TERM": "", "COLUMNS": "many", "LC_ALL": "xx_YY.nothing", "FORCE_COLOR": "1"},
}
# Runs a command in a child, which is forked after all is loaded, with some environment.
IN_SURROUNDINGS = """
import os, runpy, sys
names = sys.argv[1].split(chr(31))
os.environ.update(dict(each.split("=", 1) for each in names))
sys.argv = ["swarm-mj", *sys.argv[2:]]
runpy.run_module("swarm_mj", run_name="__main__")
"""


@pytest.fixture
def script(tmp_path):
    """Writes a program outside of the folder that the commands run in."""

    def write(text):
        path = tmp_path.with_suffix(".py")
        path.write_text(text)
        return path

    return write


@pytest.mark.slow
@pytest.mark.fault("odd machine: terminals")
@pytest.mark.parametrize("kind", SURROUNDINGS)
@pytest.mark.parametrize("command", COMMANDS)
def test_any_locale_and_terminal_will_do(forks, script, tmp_path, kind, command):
    """Whatever is set, the work is done, nothing is complained of, and files are whole."""
    given = chr(31).join(f"{name}={value}" for name, value in SURROUNDINGS[kind].items())
    done = forks.run(tmp_path, script(IN_SURROUNDINGS), given, *COMMANDS[command])
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    assert "error" not in done.stderr.lower()
    if command == "evaluate":
        with (tmp_path / "a.csv").open(encoding="utf-8") as file:
            (row,) = csv.DictReader(file)
        assert row["policy"] == "tdma"


@pytest.mark.fault("odd machine: terminals")
def test_a_new_process_in_the_c_locale_flies(tmp_path):
    """The locale is read once, when Python starts, so this one is not forked."""
    name = "\u00fc\u4e2d.json"
    done = subprocess.run(
        [sys.executable, "-m", "swarm_mj", "fly", *ROBOTS, *TDMA, "--no-record", "--json", name],
        cwd=tmp_path,
        env={**os.environ, **SURROUNDINGS["C"], "PYTHONPATH": os.getcwd()},
        capture_output=True,
        check=False,
    )
    said = done.stderr.decode()
    # Where the file system is ASCII only, the name is refused in a line, before the flight.
    assert done.returncode in (0, 2), said
    assert "Traceback" not in said
    assert len(list(tmp_path.iterdir())) == (done.returncode == 0)


READ_ONLY = {
    "replay": ("fly", *ROBOTS, *TDMA, "--record", "shut/a.rrd"),
    "summary": ("fly", *ROBOTS, *TDMA, "--no-record", "--json", "shut/a.json"),
    "results": ("evaluate", *ROBOTS, *TDMA, "--episodes", "1", "--csv", "shut/a.csv"),
    "scene": ("scene", "--robots", "3", "--out", "shut/a.xml"),
    "training": ("train", "--out", "shut/run", *ROBOTS, "--budget", "1"),
}
# Makes a folder refuse to be written to, even by root, who may write to all that is read-only.
REFUSES = """
import errno, os, runpy, sys
def refuse(event, arguments):
    if event == "os.mkdir" or (event == "open" and arguments[2] & (os.O_WRONLY | os.O_RDWR)):
        if "/shut/" in os.path.abspath(str(arguments[0])):
            raise OSError(fault, os.strerror(fault))
fault = getattr(errno, sys.argv[1])
sys.addaudithook(refuse)
sys.argv = ["swarm-mj", *sys.argv[2:]]
runpy.run_module("swarm_mj", run_name="__main__")
"""


@pytest.mark.fault("outputs that cannot be")
@pytest.mark.parametrize("command", READ_ONLY)
@pytest.mark.parametrize(("fault", "code"), [("EROFS", 1), ("EACCES", 2)])
def test_a_read_only_folder_is_told_before_the_work(forks, script, tmp_path, command, fault, code):
    """A disk that takes nothing is the machine's fault; a folder one may not write to is not."""
    (tmp_path / "shut").mkdir()
    done = forks.run(tmp_path, script(REFUSES), fault, *READ_ONLY[command])
    assert done.returncode == code, done.stderr
    assert len(done.stderr.splitlines()) == 1, done.stderr
    assert "shut" in done.stderr
    assert not done.stdout
    assert not list((tmp_path / "shut").iterdir())


# Runs a command in a process that ends when it, or a library, looks for another machine.
ALONE = """
import os, runpy, sys
def look(event, arguments):
    if event in ("socket.connect", "socket.getaddrinfo", "socket.sendto", "socket.gethostbyname"):
        if event != "socket.connect" or isinstance(arguments[1], tuple):  # a path is this machine
            os.write(2, f"looked for {arguments}\\n".encode())
            os._exit(77)
sys.addaudithook(look)
sys.argv = ["swarm-mj", *sys.argv[1:]]
runpy.run_module("swarm_mj", run_name="__main__")
"""


@pytest.mark.fault("telemetry of dependencies")
@pytest.mark.parametrize("outputs", [("--record", "a.rrd", "--json", "a.json"), ("--no-record",)])
def test_no_flight_looks_for_another_machine(forks, script, tmp_path, outputs):
    done = forks.run(tmp_path, script(ALONE), "fly", *ROBOTS, *TDMA, *outputs)
    assert done.returncode == 0, done.stderr


@pytest.mark.fault("telemetry of dependencies")
def test_a_look_for_another_machine_is_noticed(forks, script, tmp_path):
    """The test above would see it."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        text = f"import socket; socket.create_connection(('127.0.0.1', {port}))"
        (tmp_path / "curious.py").write_text(f"{text}\ndef Mine(mission): pass\n")
        named = ("--policy", "curious:Mine", "--no-record")
        done = forks.run(tmp_path, script(ALONE), "fly", *ROBOTS, *named)
    assert done.returncode == 77


@pytest.mark.slow
@pytest.mark.fault("one output, one process")
def test_of_two_at_once_one_writes_and_the_other_is_refused(tmp_path, tries):
    """Two real processes, which begin together: what is left is whole, and one's own."""
    for _ in range(tries(1)):
        for path in tmp_path.iterdir():
            path.unlink()
        twins: list[subprocess.Popen] = []
        for seed in ("1000", "2000"):
            asked = ("evaluate", *ROBOTS, *TDMA, "--episodes", "30", "--csv", "a.csv", "--force")
            twin = subprocess.Popen(
                [sys.executable, "-m", "swarm_mj", *asked, "--seed", seed],
                cwd=tmp_path,
                env={**os.environ, "PYTHONPATH": os.getcwd()},
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                text=True,
            )
            twins.append(twin)
        said = [twin.communicate(timeout=100.0)[1] for twin in twins]
        codes = [twin.returncode for twin in twins]
        assert sorted(codes) in ([0, 0], [0, 2]), said
        assert "Traceback" not in "".join(said)
        assert os.listdir(tmp_path) == ["a.csv"]
        with Path(tmp_path, "a.csv").open(encoding="utf-8") as file:
            (row,) = csv.DictReader(file)
        if 2 in codes:
            assert "is being written by process" in said[codes.index(2)]
            assert int(row["seed"]) == (1000, 2000)[codes.index(0)]
