"""The command line without a command, likely names, and how commands end."""

import ctypes
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from importlib import import_module
from pathlib import Path

import pytest

from swarm_mj.cli import BEGINNING, COMMANDS, _exit_code, main
from swarm_mj.system.exit_codes import INTERRUPTED


def test_nothing_typed_shows_where_to_begin(capsys):
    assert main([]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    for name, summary in COMMANDS.items():
        assert f"  {name} " in printed.err
        assert summary in printed.err
    assert {line.split()[0] for line in BEGINNING} <= set(COMMANDS)
    assert "swarm-mj fly " in printed.err
    assert max(map(len, printed.err.splitlines())) <= 80


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("flyy", "swarm-mj: error: there is no command 'flyy'; did you mean fly?"),
        ("xyz", "swarm-mj: error: there is no command 'xyz' (see"),
        ("-- fly", "swarm-mj: error: "),
        ("--versoin", "did you mean --version?"),
        ("fly --polcy tdma", "unrecognized arguments: --polcy tdma; did you mean --policy?"),
        ("fly --polcy=tdma", "did you mean --policy?"),
        (
            "fly --task flok",
            "stationary, random-walk, flocking, not 'flok'; did you mean flocking?",
        ),
        ("train --out r --credit tem", "did you mean team?"),
    ],
)
def test_a_slip_is_answered_with_the_likely_name(refusal, line, complaint):
    assert complaint in refusal(*line.split())


def test_the_version_is_told(swarm_mj):
    assert swarm_mj("--version").stdout.startswith("swarm-mj ")


@pytest.mark.parametrize("kind", [ValueError, ctypes.ArgumentError])
def test_what_a_library_makes_of_an_interruption_is_one(kind, capsys):
    """As matplotlib, which complains of a matrix, and ctypes, of an argument it did not convert."""

    def work():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(10.0)
        except KeyboardInterrupt:
            raise kind("a matrix") from None

    assert _exit_code("some", work) == INTERRUPTED
    assert capsys.readouterr().err == "some: interrupted\n"


def test_without_an_interruption_a_fault_of_the_code_is_raised():
    with pytest.raises(ZeroDivisionError):
        _exit_code("some", lambda: 1 // 0)


@pytest.mark.parametrize("command", ["bench", "doctor", "policies", "scene"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_an_interruption_that_is_swallowed_while_modules_load_ends_a_command(
    monkeypatch, capsys, command, number
):
    """Some modules catch every exception while they load, so commands ran on to their ends."""

    def loading(name):
        with suppress(KeyboardInterrupt):
            signal.raise_signal(number)
        return import_module(name)

    monkeypatch.setattr("swarm_mj.cli.importlib.import_module", loading)
    assert main([command]) == INTERRUPTED
    assert capsys.readouterr().out == ""


def test_a_command_runs_nothing_of_the_folder_here(trapped):
    """glfw, which MuJoCo imports, starts a Python in the current folder."""
    environment = dict(os.environ)
    environment.pop("MUJOCO_GL", None)  # MuJoCo then loads OpenGL
    program = Path(sys.executable).with_name("swarm-mj")
    command = [program, "scene", "--robots", "3", "--out", "a.xml"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert not trapped.exists()


def test_what_comes_after_a_command_is_as_before(monkeypatch, capsys):
    """Notebooks and programs that call `main` start Pythons of their own."""
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    assert main(["policies", "tdma"]) == 0
    assert "PYTHONSAFEPATH" not in os.environ
    assert capsys.readouterr().out
