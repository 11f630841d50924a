"""What Windows lacks is missed by nothing that flies, records, evaluates and trains.

It is taken away here; Windows itself is not tried. There no open file can be renamed or removed,
and a locked one cannot be written: what guards against that is tried as far as Linux shows it.
"""

import subprocess

import pytest

from swarm_mj.system.processes import PYTHON

# Before any module of the package: libraries keep what they take at their import.
WITHOUT = """
import os, signal, subprocess, sys, types
import multiprocessing.popen_spawn_posix, multiprocessing.resource_tracker
import filelock, psutil, torch
for name in ("fcntl", "resource", "termios", "pwd", "grp"):
    sys.modules[name] = None
for module, names in (
    (signal, ("SIGHUP", "SIGPIPE")),
    (os, ("killpg", "getuid", "geteuid", "sched_getaffinity")),
):
    for name in names:
        if hasattr(module, name):
            delattr(module, name)
# Libraries need these on Linux: the package alone does not find them.
nonblock, cloexec = os.O_NONBLOCK, os.O_CLOEXEC
del os.O_NONBLOCK, os.O_CLOEXEC
import swarm_mj.evaluation.engines, swarm_mj.system.reading
os.O_NONBLOCK, os.O_CLOEXEC = nonblock, cloexec
masks = types.SimpleNamespace(**vars(signal))
del masks.pthread_sigmask
swarm_mj.evaluation.engines.signal = masks
start = subprocess.Popen.__init__
def without_a_shell(self, command, *rest, **how):
    if command and command[0] == "sh":
        raise FileNotFoundError("sh")
    start(self, command, *rest, **how)
subprocess.Popen.__init__ = without_a_shell
"""
FLY = """
import swarm_mj
run = swarm_mj.fly(num_robots=5, num_windows=20)
run.save("flight.rrd")
"""


def python(program, folder):
    command = [*PYTHON, "-c", WITHOUT + program]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)


def files(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_it_flies_and_records(tmp_path):
    done = python(FLY, tmp_path)
    assert done.returncode == 0, done.stderr
    assert files(tmp_path) == ["flight.rrd"]


COMMANDS = {
    "fly": ["fly", "--robots", "5", "--windows", "20", "--record", "a.rrd"],
    "evaluate": [
        "evaluate",
        "--robots",
        "5",
        "--windows",
        "20",
        "--episodes",
        "4",
        "--jobs",
        "2",
        "--csv",
        "a.csv",
    ],
    "train": ["train", "--robots", "5", "--windows", "50", "--budget", "100", "--out", "a"],
}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_commands_work_and_leave_what_they_say(tmp_path, name):
    program = (
        f"from swarm_mj.__main__ import run; import sys; sys.argv[1:] = {COMMANDS[name]}; run()"
    )
    done = python(program, tmp_path)
    assert done.returncode == 0, done.stderr
    hidden = [name for name in files(tmp_path) if name.startswith(".")]
    assert hidden == []
