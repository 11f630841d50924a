"""The proof that a refactoring changed nothing, in small; no digest of another machine counts."""

import json
from importlib import import_module

import numpy as np
import pytest

from swarm_mj import POLICIES

FLOWN = ("two-robots-tdma", "three-robots-mst", "own-policy-broadcasts")


@pytest.fixture(scope="module")
def tool():
    return import_module("same")


@pytest.fixture(autouse=True)
def _one_process(tool, monkeypatch, tmp_path):
    """Lets the tool work in this process, which has imported what it needs."""
    monkeypatch.chdir(tmp_path)

    def do_all(tasks, _jobs, _console):
        return {name: trace for task in tasks for name, trace in tool.traces_of(task).items()}

    monkeypatch.setattr(tool, "do_all", do_all)


@pytest.fixture
def golden(tool, tmp_path):
    """A file of some flights' digests, just written."""
    path = tmp_path / "golden.json"
    assert tool.main(["--write", "--golden", str(path), "--only", *FLOWN]) == 0
    return path


def compared(tool, golden, capsys, *options):
    """The exit code and the lines of a comparison."""
    capsys.readouterr()
    code = tool.main(["--golden", str(golden), "--only", *FLOWN, *options])
    return code, capsys.readouterr().err.splitlines()


def with_other_digits(golden, name, place):
    """Changes two digits of a trace, as other code would have."""
    stored = json.loads(golden.read_text())
    whole, steps = stored["traces"][name].split()
    other = "00" if steps[place : place + 2] != "00" else "11"
    stored["traces"][name] = f"{'0' * len(whole)} {steps[:place]}{other}{steps[place + 2 :]}"
    golden.write_text(json.dumps(stored))


def test_the_same_flights_have_the_same_digests(tool, golden, capsys):
    assert compared(tool, golden, capsys) == (0, ["3 of 3 are equal to those of golden.json."])


def test_the_flight_and_its_first_other_window_are_named(tool, golden, capsys):
    """Window 7 is the thirteenth digit and the one after it."""
    with_other_digits(golden, "three-robots-mst", 12)
    code, lines = compared(tool, golden, capsys)
    assert code == 1
    assert lines == [
        "three-robots-mst moved first in window 7; 1 of 40 differ",
        "2 of 3 are equal to those of golden.json.",
    ]


def test_a_change_of_the_last_digit_moves_its_window(tool):
    """The steps after it stay, as each has a digest of its own."""

    def trace(numbers):
        tracer = tool.Tracer()
        for number in numbers:
            tracer.add(np.array([1.0, number]), None, "m")
        return tracer.trace

    numbers = [0.5, 1.5, 2.5, 3.5]
    moved = [0.5, np.nextafter(1.5, 2.0), 2.5, 3.5]
    assert tool.difference("a", trace(numbers), trace(moved)).startswith("moved first in window 2;")
    assert trace(np.array(numbers)) == trace(numbers)
    assert tool.Tracer().trace != trace(numbers)


@pytest.mark.parametrize("value", [np.int32(7), np.int64(7)])
def test_how_wide_a_number_is_stored_is_no_change(tool, value):
    tracer, other = tool.Tracer(), tool.Tracer()
    tracer.add(np.array([value]))
    other.add(np.array([7], dtype=np.int16))
    assert tracer.trace == other.trace


def test_another_machine_is_named(tool, golden, capsys):
    stored = json.loads(golden.read_text())
    stored["machine"]["numpy"] = "0.1"
    golden.write_text(json.dumps(stored))
    with_other_digits(golden, "two-robots-tdma", 0)
    code, lines = compared(tool, golden, capsys)
    assert code == 1
    assert lines[0].startswith("two-robots-tdma moved first in window 1;")
    assert lines[2].startswith("That was written on another machine: numpy 0.1 there, ")
    assert "--against" in lines[3]


def test_a_flight_that_fails_is_named_and_stops_no_other(tool, golden, capsys, monkeypatch):
    broken = tool.FLIGHTS["three-robots-mst"]
    monkeypatch.setitem(broken.fields, "num_robots", 1)
    code, lines = compared(tool, golden, capsys)
    assert code == 1
    assert lines[0].startswith("three-robots-mst failed: ValueError: number of robots")
    assert lines[1] == "2 of 3 are equal to those of golden.json."
    before = golden.read_bytes()
    assert compared(tool, golden, capsys, "--write")[0] == 1
    assert golden.read_bytes() == before


def test_writing_some_keeps_the_others(tool, golden):
    before = json.loads(golden.read_text())
    with_other_digits(golden, FLOWN[0], 0)
    with_other_digits(golden, FLOWN[1], 0)
    assert tool.main(["--write", "--golden", str(golden), "--only", FLOWN[0]]) == 0
    after = json.loads(golden.read_text())
    assert list(after["traces"]) == list(before["traces"])
    assert after["traces"][FLOWN[0]] == before["traces"][FLOWN[0]]
    assert after["traces"][FLOWN[1]] != before["traces"][FLOWN[1]]


def test_ctrl_c_leaves_the_digests_as_they_were(tool, golden, capsys, monkeypatch):
    before = golden.read_bytes()

    def interrupted(_tasks, _jobs, _console):
        raise KeyboardInterrupt

    monkeypatch.setattr(tool, "do_all", interrupted)
    assert compared(tool, golden, capsys, "--write")[0] == 130
    assert golden.read_bytes() == before
    assert [path.name for path in golden.parent.iterdir()] == [golden.name]


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--only", "no-such"], "no flight is named no-such"),
        (["--golden", "no-such.json"], "no-such.json is not there"),
        (["--against", "no-such"], "git rev-parse"),
    ],
)
def test_bad_input_is_one_clear_line(tool, capsys, options, complaint):
    assert tool.main(options) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert complaint in lines[0]


def test_every_policy_flies_every_task(tool):
    flown = {(each.policy, each.task) for each in tool.FLIGHTS.values()}
    tasks = ("stationary", "random-walk", "flocking")
    assert {(policy, task) for policy in POLICIES for task in tasks} <= flown


def test_the_committed_digests_are_those_of_all_tasks(tool):
    """In the order of the tasks, so that a new one changes one line."""
    names = [name.partition(": ")[0] for name in tool.read(tool.GOLDEN)["traces"]]
    assert list(dict.fromkeys(names)) == tool.all_tasks()
