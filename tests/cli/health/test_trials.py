"""Trials end with what the program said, however it ends."""

import pytest

from swarm_mj.cli.health import trials
from swarm_mj.cli.health.trials import RENDERING, TRIALS, Trial, tried


@pytest.mark.parametrize(
    ("program", "is_needed", "state", "found"),
    [
        ("print('hello'); print('fine')", False, "ok", "fine"),
        ("raise SystemExit('no driver')", False, "absent", "no driver"),
        ("raise SystemExit('no driver')", True, "broken", "no driver"),
        ("raise SystemExit('a word ' * 99)", False, "absent", "a word " * 56 + "a ..."),
        ("import os; os.abort()", True, "broken", "it said nothing"),
        ("import time; time.sleep(60)", False, "absent", "not within 0.3 s"),
        ("import os; print(os.environ['SAID'])", False, "ok", "by its variables"),
    ],
)
def test_what_came_of_a_trial(monkeypatch, program, is_needed, state, found):
    if "sleep" in program:
        monkeypatch.setattr(trials, "LONGEST_S", 0.3)
    variables = {"SAID": "by its variables"}
    trial = Trial("group", "name", ("-c", program), "mend it", variables, is_needed)
    monkeypatch.setattr(trials, "TRIALS", (trial,))
    (outcome,) = tried()
    assert (outcome.state, outcome.found) == (state, found)
    assert outcome.mend == ("" if state == "ok" else "mend it")


def test_each_way_to_render_is_tried_by_its_own_name():
    ways = {each.name: each.variables for each in TRIALS if each.group == RENDERING}
    assert ways == {f"MUJOCO_GL={way}": {"MUJOCO_GL": way} for way in ("egl", "osmesa", "glfw")}
    assert [each.name for each in TRIALS if each.is_needed] == ["three robots fly"]


def test_trials_run_nothing_of_the_folder_here(monkeypatch, trapped):
    trial = Trial("group", "name", ("-c", "import numpy; print(numpy.pi)"), "mend it")
    monkeypatch.setattr(trials, "TRIALS", (trial,))
    (outcome,) = tried()
    assert outcome.found.startswith("3.14")
    assert not trapped.exists()
