"""The traces of an export, played by the rules of ns-2."""

import re

import numpy as np
import pytest

from swarm_mj.replay.export.ns2 import trace
from swarm_mj.replay.read import read_flown

START = re.compile(r"^\$node_\((\d+)\) set ([XYZ])_ (\S+)$")
LEG = re.compile(r'^\$ns_ at (\S+) "\$node_\((\d+)\) setdest (\S+) (\S+) (\S+)"$')


def played(content, num_robots):
    """Where each robot starts, and its legs: when they begin and end, from where to where."""
    start_m = np.full((num_robots, 3), np.nan)
    legs = [[] for _ in range(num_robots)]
    for line in content.decode().splitlines():
        if line.startswith("#"):
            continue
        if start := START.match(line):
            start_m[int(start[1]), "XYZ".index(start[2])] = float(start[3])
            continue
        begin_s, robot, x_m, y_m, speed_mps = map(float, LEG.match(line).groups())
        its = legs[int(robot)]
        from_m = its[-1][3] if its else start_m[int(robot), :2]
        to_m = np.array([x_m, y_m])
        end_s = begin_s + np.linalg.norm(to_m - from_m) / speed_mps
        its.append((begin_s, end_s, from_m, to_m))
    return start_m, legs


def place_m(start_m, legs, at_s):
    """Where a robot is."""
    where_m = start_m
    for begin_s, end_s, from_m, to_m in legs:
        if at_s <= begin_s:
            break
        share = min(1.0, (at_s - begin_s) / (end_s - begin_s))
        where_m = from_m + share * (to_m - from_m)
    return where_m


def test_each_robot_is_in_place_when_either_slot_of_a_window_begins(requests, two_way, nothing):
    """To a millimetre, 0 and 50 ms after the beginning of each window of 100 ms."""
    start_m, legs = played(trace(requests, nothing), 12)
    assert np.all(start_m[:, 2] == 0.0)
    for robot, its in enumerate(legs):
        assert len(its) == 29
        for k in range(30):
            for at_s in (0.1 * k, 0.1 * k + 0.05):
                found_m = place_m(start_m[robot, :2], its, at_s)
                expected_m = two_way.log.position_m[k, robot]
                np.testing.assert_allclose(found_m, expected_m, atol=1e-3)


def test_bodies_begin_at_their_heights_and_stay_there(bodies, high, nothing):
    """`setdest` has no third axis."""
    start_m, legs = played(trace(bodies, nothing), 12)
    np.testing.assert_allclose(start_m[:, 2], high.log.height_m[0], atol=1e-4)
    assert np.ptp(start_m[:, 2]) > 30.0
    assert all(len(its) == 29 for its in legs)


def test_robots_at_rest_have_no_legs(still_replay, nothing):
    content = trace(read_flown(still_replay), nothing).decode()
    assert "setdest" not in content
    assert content.count(" set X_ ") == 12


def test_comments_have_the_numbers_of_the_radio(requests, nothing):
    lines = trace(requests, nothing).decode().splitlines()
    about = [line for line in lines if line.startswith("#")]
    assert lines[: len(about)] == about
    assert about[0] == "# flocking, 12 robots, mst, seed 5"
    power_mw = float(re.search(r"power (\S+) mW", about[2])[1])
    assert power_mw == pytest.approx(7967, rel=1e-3)  # as docs/channels.md has it


def test_each_window_is_counted(requests):
    done = []
    trace(requests, lambda: done.append(1))
    assert len(done) == 30
