"""Processes that end with the one that started them; tests/faults/ kills that one."""

import subprocess
import sys
import time

import pytest

from swarm_mj.system.processes import attempt, guard, running

# Starts a child of its own, says that it has, and waits for it.
FAMILY = """
import subprocess, sys
child = "import time; print('up', flush=True); time.sleep(600)"
sys.exit(subprocess.call([sys.executable, "-c", child]))
"""


def test_a_program_ends_with_its_block_and_takes_its_children_along(tmp_path):
    with (tmp_path / "said").open("w+") as said:
        with running([sys.executable, "-c", FAMILY], output=said) as process:
            while not (tmp_path / "said").read_text():
                time.sleep(0.01)
            assert process.poll() is None
        assert process.returncode < 0


def test_a_program_s_own_end_and_what_it_says_are_told(tmp_path):
    with (tmp_path / "said").open("w+") as said:
        code = "import os, sys; print(os.environ['WORD']); sys.exit(3)"
        with running([sys.executable, "-c", code], environment={"WORD": "yes"}, output=said) as it:
            assert it.wait() == 3
    assert (tmp_path / "said").read_text() == "yes\n"


def test_a_program_that_nobody_waits_for_is_not_left():
    with pytest.raises(KeyError), running(["sleep", "600"]) as process:
        raise KeyError
    assert process.returncode < 0


def test_what_is_guarded_outlasts_the_block():
    with subprocess.Popen(["sleep", "600"]) as process:
        try:
            with guard() as watch:
                watch(process.pid)
            with pytest.raises(subprocess.TimeoutExpired):
                process.wait(timeout=0.2)
        finally:
            process.kill()


@pytest.mark.parametrize(
    ("program", "outcome"),
    [
        ("print('hello'); print('fine')", (True, "fine")),
        ("raise SystemExit('no driver')", (False, "no driver")),
        ("import os; os.abort()", (False, "it said nothing")),
        ("import time; time.sleep(60)", (False, "not within 0.3 s")),
        ("import os; print(os.environ['SAID'])", (True, "by its variables")),
    ],
)
def test_what_came_of_an_attempt(program, outcome):
    longest_s = 0.3 if "sleep" in program else 120.0
    assert attempt(program, {"SAID": "by its variables"}, longest_s=longest_s) == outcome


def test_an_attempt_runs_nothing_of_the_folder_here(trapped):
    works, said = attempt("import numpy; print(numpy.pi)")
    assert works
    assert said.startswith("3.14")
    assert not trapped.exists()
