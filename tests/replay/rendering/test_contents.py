"""What a live swarm's picture shows, against the swarm."""

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.replay import palette
from swarm_mj.replay.mismatch import radio_snapshot
from swarm_mj.replay.rendering.contents import contents_of
from swarm_mj.simulation.swarm import Swarm


@pytest.fixture
def swarm():
    return Swarm(paper("flocking", num_robots=8, num_windows=20, failure_fraction=0.25), [3, 4])


def test_before_the_first_window_everyone_is_grey_but_the_white_observer(swarm):
    contents = contents_of(swarm, 1, observer=2)
    np.testing.assert_array_equal(contents.position_m, swarm.states.position_m[1])
    np.testing.assert_array_equal(contents.velocity_mps, swarm.states.velocity_mps[1])
    expected = np.tile(np.array(palette.UNKNOWN), (8, 1))
    expected[2] = palette.EGO
    np.testing.assert_array_equal(contents.colour, expected)
    assert len(contents.start_m) == 0


def test_packets_are_those_of_the_last_window(swarm):
    """Robot 0 asks 1, which answers, if they decode each other; whoever else hears overhears."""
    recipient = np.tile(np.arange(8), (2, 1))
    recipient[:, 0] = 1
    swarm.step_with_recipients(recipient)
    contents = contents_of(swarm, 0)
    request, response = swarm.phases
    where = swarm.states.position_m[0]
    expected = []
    for phase in (request, response):
        for j in range(8):
            i = phase.heard[0, j]
            if i != j:
                expected.append((*where[i], *where[j]))
    colours = {tuple(colour) for colour in contents.packet_colour.tolist()}
    if request.heard[0, 1] == 0:
        assert palette.DELIVERED in colours
        assert palette.LOST not in colours
        drawn = np.hstack([contents.start_m, contents.end_m]).tolist()
        np.testing.assert_allclose(sorted(map(tuple, drawn)), sorted(expected))
    else:
        assert palette.LOST in colours


def test_a_broadcast_leads_to_all_who_hear_it(swarm):
    policy = make_policy("random-flooding", swarm.mission, 0.3)
    for _ in range(4):
        swarm.step(policy)
    contents = contents_of(swarm, 1)
    num_heard = sum(int(np.sum(phase.heard[1] != np.arange(8))) for phase in swarm.phases)
    assert len(contents.start_m) == num_heard
    assert {tuple(colour) for colour in contents.packet_colour.tolist()} <= {palette.BROADCAST}


def test_links_that_surprise_are_seen_and_who_is_cut_off():
    mission = paper("random-walk", num_robots=10, arena="blocks", shadowing_db=6.0)
    city = Swarm(mission, [3, 4])
    for _ in range(60):
        city.move()
    seen, contents = radio_snapshot(city, 1), contents_of(city, 1, observer=2)
    kinds = seen.mismatch.by_kind
    ends = kinds["too_weak"].sender.tolist() + kinds["too_weak"].receiver.tolist()
    assert ends.count(2) > 0
    assert len(contents.lines_m) == 4 * ends.count(2) + len(kinds["unbelieved"].row)
    np.testing.assert_array_equal(contents.is_cut_off, seen.group != seen.group[2])


def test_robots_that_failed_are_dark(swarm):
    policy = make_policy("tdma", swarm.mission)
    for _ in range(12):
        swarm.step(policy)
    is_off = ~swarm.states.is_active[0]
    assert np.sum(is_off) == 2
    is_dark = np.all(contents_of(swarm).colour == palette.SWITCHED_OFF, axis=1)
    np.testing.assert_array_equal(is_dark, is_off)


def test_bright_is_fresh(swarm):
    policy = make_policy("tdma", swarm.mission)
    for _ in range(9):
        swarm.step(policy)
    brightness = contents_of(swarm, full_scale=9.0).colour.astype(float).sum(axis=1)[1:]
    age = (swarm.now[0] - swarm.buffers.timestamp[0, 0])[1:]
    is_known = swarm.buffers.is_known[0, 0, 1:]
    assert np.sum(is_known) > 3
    order = np.argsort(age[is_known])
    assert np.all(np.diff(brightness[is_known][order]) <= 0.0)


def test_what_is_not_there_is_refused(swarm):
    with pytest.raises(ValueError, match="observer must be from 0 to 7, not 8"):
        contents_of(swarm, observer=8)
    with pytest.raises(ValueError, match="index must be from 0 to 1, not 2"):
        contents_of(swarm, 2)
