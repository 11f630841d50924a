"""Python finds what `swarm-mj check` finds."""

import json

import pytest

import swarm_mj
from swarm_mj.cli import main

SHORT = {"num_robots": 8, "num_windows": 60, "range_ratio": 0.5}
OPTIONS = ("--robots", "8", "--windows", "60", "--range-ratio", "0.5")


def test_it_is_what_the_command_line_finds_however_many_fly_at_once(here):
    found = swarm_mj.check_convergence(policy="tdma", within_s=5, share=0.5, **SHORT)
    line = ["check", "flocking", "--policy", "tdma", "--within", "5", "--share", "0.5", *OPTIONS]
    assert main([*line, "--jobs", "1", "--json", "told.json"]) == 0
    told = json.loads((here / "told.json").read_text())
    assert told == json.loads(json.dumps(found.report()))
    assert found


def test_a_claim_fails_a_test_that_asserts_it_and_says_why():
    with pytest.raises(AssertionError, match="verdict:    does not hold"):
        assert swarm_mj.check_convergence(policy="tdma", within_s=0.5, share=0.5, **SHORT)


@pytest.mark.parametrize(
    ("arguments", "kind", "message"),
    [
        ({"within_s": 60.0}, ValueError, "within 60 s is after the missions' end at 6 s"),
        ({"max_missions": 0}, ValueError, "max_missions must be a whole number from 1 to 100000"),
        ({"num_jobs": 0}, ValueError, "num_jobs must be"),
        ({"polcy": "tdma"}, TypeError, "polcy.*did you mean policy"),
        ({"task": "random-walk"}, ValueError, "random-walk has no cost"),
    ],
)
def test_what_is_wrong_is_said_in_a_line(arguments, kind, message):
    with pytest.raises(kind, match=message):
        swarm_mj.check_convergence(**SHORT | arguments)
