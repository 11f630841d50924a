"""The movements of a replay, read back by the rules of ns-2's traces."""

import csv
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from swarm_mj.replay.read import read_footage

TOOL = Path(__file__).parent.parent.parent / "tools" / "mobility.py"
START = re.compile(r"^\$node_\((\d+)\) set ([XYZ])_ (\S+)$")
LEG = re.compile(r'^\$ns_ at (\S+) "\$node_\((\d+)\) setdest (\S+) (\S+) (\S+)"$')


@pytest.fixture(scope="module")
def flown(forks, tmp_path_factory):
    """A folder with the replay of a walk."""
    folder = tmp_path_factory.mktemp("replay")
    fly = ("fly", "--task", "random-walk", "--robots", 6, "--windows", 30, "--record", "a.rrd")
    done = forks.run(folder, "swarm_mj", *fly)
    assert done.returncode == 0, done.stderr
    return folder


@pytest.fixture
def written(forks, flown):
    """Runs the tool; returns the text of the file that it wrote."""
    run = partial(forks.run, flown, TOOL)

    def text_of(name):
        done = run("a.rrd", "--out", name, "--force")
        assert done.returncode == 0, done.stderr
        return (flown / name).read_text()

    return text_of


@pytest.mark.slow
def test_a_trace_leads_every_robot_to_where_it_was_to_a_millimetre(written, flown):
    """Each leg begins where the one before ended, and takes a window of 0.1 s at its speed."""
    footage = read_footage(flown / "a.rrd")
    lines = written("a.tcl").splitlines()
    place = np.zeros((6, 3))
    for line in lines[:18]:
        ((robot, axis, value),) = START.findall(line)
        place[int(robot), "XYZ".index(axis)] = float(value)
    np.testing.assert_allclose(place[:, :2], footage.position_m[0], atol=1e-3)
    legs = [tuple(map(float, *LEG.findall(line))) for line in lines[18:]]
    assert len(legs) == 6 * (len(footage.window) - 1)
    for begin_s, robot, x, y, speed in legs:
        target = np.array([x, y, 0.0])
        way = np.linalg.norm(target - place[int(robot)])
        assert way == pytest.approx(speed * 0.1, abs=1e-4)
        place[int(robot)] = target
        k = round((begin_s + 0.1) / 0.1) - footage.window[0]
        np.testing.assert_allclose(target[:2], footage.position_m[k, int(robot)], atol=1e-3)


@pytest.mark.slow
def test_a_table_has_a_row_for_each_robot_and_window(written, flown):
    footage = read_footage(flown / "a.rrd")
    rows = list(csv.DictReader(written("a.csv").splitlines()))
    assert len(rows) == 6 * len(footage.window)
    found = np.array([[float(row["x_m"]), float(row["y_m"])] for row in rows])
    np.testing.assert_allclose(found.reshape(-1, 6, 2), footage.position_m, atol=1e-3)
    assert float(rows[-1]["time_s"]) == pytest.approx(0.1 * footage.window[-1])


def test_other_kinds_of_files_are_refused(forks, flown):
    done = forks.run(flown, TOOL, "a.rrd", "--out", "a.xyz")
    assert done.returncode == 2
    assert ".tcl" in done.stderr
