"""Packets, against the costs' counts and a plain loop; mismatched links, by lone packets."""

from dataclasses import replace

import networkx
import numpy as np
import pytest
from antennas import links_db, write_rover
from mujoco import mjtGeom

from swarm_mj.mission import paper
from swarm_mj.physics.obstacles import OBSTACLE_GROUP
from swarm_mj.replay.links import (
    DASHES,
    EVERY,
    LINK,
    RISE,
    SEGMENTS,
    LinkMismatch,
    PacketPaths,
    arcs,
    by_kind,
    divided,
    radio_snapshot,
    shades,
    stride_of,
)
from swarm_mj.simulation.swarm import Swarm


def rows_of(packets):
    """Window, start and end of each packet, as tuples."""
    return [tuple(each) for each in np.column_stack(packets).tolist()]


def test_a_broadcast_leads_to_each_robot_that_decoded_it(flooded):
    log = flooded.log
    expected = [
        (t, *log.position_m[t, log.heard[t, slot, hearer]], *log.position_m[t, hearer])
        for t, slot, hearer in np.ndindex(len(log.window), 2, 12)
        if log.heard[t, slot, hearer] != hearer
    ]
    assert list(log.packets) == ["heard"]
    assert rows_of(log.packets["heard"]) == expected


def test_answers_heard_or_not_are_the_delivered_requests_turned_round(two_way):
    packets = two_way.log.packets
    assert list(packets) == ["overheard", "unanswered", "lost", "delivered", "answered"]
    answers = {
        (row, *end, *start)
        for fate in ("answered", "unanswered")
        for row, *start, x, y in rows_of(packets[fate])
        for end in [(x, y)]
    }
    assert answers == set(rows_of(packets["delivered"]))


def test_an_arc_starts_and_ends_at_its_ends_and_is_highest_in_the_middle():
    start, end = np.array([[0.0, 0.0], [10.0, 5.0]]), np.array([[100.0, 0.0], [10.0, -35.0]])
    packets = PacketPaths(np.array([0, 0]), start, end)
    points = arcs(packets, 2.0)
    assert points.shape == (2, SEGMENTS + 1, 3)
    np.testing.assert_allclose(points[:, 0], np.pad(start, ((0, 0), (0, 1)), constant_values=2.0))
    np.testing.assert_allclose(points[:, -1], np.pad(end, ((0, 0), (0, 1)), constant_values=2.0))
    np.testing.assert_allclose(points[:, SEGMENTS // 2, 2], 2.0 + RISE * np.array([100.0, 40.0]))
    np.testing.assert_allclose(points[0, :, 1], 0.0)
    np.testing.assert_allclose(arcs(packets, 2.0, 0.6)[:, -1, :2], 0.4 * start + 0.6 * end)


CITY = {"arena": "blocks", "shadowing_db": 6.0, "num_robots": 14, "high_power_fraction": 0.3}
WALL_DB = 3.0


def lone_links(swarm, index):
    """Who decodes whom if only one robot transmits: without fades, what mean powers grant."""
    num_robots = swarm.mission.num_robots
    position_m, robots = swarm.states.position_m[index : index + 1], np.arange(num_robots)
    channel = swarm.channel.at(np.zeros(1, dtype=int), np.array([index]))
    heard = [
        channel(position_m, np.where(robots == i, -1, robots)[None])[0] for i in range(num_robots)
    ]
    return np.array([heard[i] == i for i in range(num_robots)]) & ~np.eye(num_robots, dtype=bool)


def apart_m(swarm, index):
    where = swarm.states.position_m[index]
    return np.linalg.norm(where[:, None] - where, axis=2)


@pytest.mark.parametrize("index", [0, 1])
def test_surprises_are_where_lone_packets_and_the_range_disagree(index):
    swarm = Swarm(paper("random-walk", **CITY), [3, 4])
    seen = radio_snapshot(swarm, index)
    decodes, is_near = lone_links(swarm, index), apart_m(swarm, index) <= swarm.mission.range_m
    expected = {}
    for i in range(14):
        for j in range(14):
            if i != j and decodes[i, j] != is_near[i, j] and (j, i) not in expected:
                expected[i, j] = bool(is_near[i, j])
    found = {(i, j): weak for _, i, j, _, _, weak in seen.links.tolist()}
    assert found == expected
    assert set(expected.values()) == {True, False}
    assert np.all((seen.links["margin_db"] < 0) == seen.links["is_too_weak"])
    together = networkx.strongly_connected_components(networkx.DiGraph(decodes.astype(int)))
    assert {frozenset(np.flatnonzero(seen.group == g).tolist()) for g in set(seen.group)} == set(
        map(frozenset, together)
    )


def test_what_was_told_before_the_mission_does_not_surprise():
    told = {"arena": "blocks", "num_robots": 14, "high_power_fraction": 0.3, "path_loss": "two-ray"}
    for known, surprises in (("nothing", True), ("map", True), ("map,statistics", False)):
        seen = radio_snapshot(Swarm(paper("random-walk", **told, prior_knowledge=known), [3]))
        assert (len(seen.links) > 0) == surprises


def wall(spec, _mission):
    spec.worldbody.add_geom(
        type=mjtGeom.mjGEOM_BOX,
        pos=[0, 0, 5],
        size=[0.1, 2000, 5],
        group=OBSTACLE_GROUP,
        userdata=[WALL_DB],
    )


def test_losses_behind_a_wall_by_hand():
    """88.0 dB over 250 m in free space, where the margin is 0; a wall takes 3 dB more."""
    swarm = Swarm(paper("stationary", num_robots=20), [1], scene=wall)
    where, distance_m = swarm.states.position_m[0], apart_m(swarm, 0)
    expected = {}
    for i in range(20):
        for j in range(i + 1, 20):
            is_behind = where[i, 0] * where[j, 0] < 0.0
            margin_db = 20.0 * np.log10(250.0 / distance_m[i, j]) - WALL_DB * is_behind
            if distance_m[i, j] <= 250.0 and margin_db < 0.0:
                expected[i, j] = [round(88.013 - margin_db), int(np.floor(margin_db))]
    assert len(expected) > 0
    found = radio_snapshot(swarm).links.tolist()
    assert {(i, j): numbers for _, i, j, *numbers, _ in found} == expected


def test_a_strong_radio_surprises_in_its_own_direction_only():
    mission = paper("stationary", num_robots=12, high_power_fraction=0.5, high_power_db=3.0)
    found = radio_snapshot(Swarm(mission, [2])).links
    assert not np.any(found["is_too_weak"])
    assert np.all(found["sender"] < 6)
    is_one_way = found["receiver"] >= 6
    assert set(is_one_way.tolist()) == {True, False}
    assert np.all((found["sender"] < found["receiver"])[~is_one_way])


def test_free_space_and_a_channel_of_one_s_own_cannot_surprise():
    mission = paper("stationary", num_robots=6)
    assert radio_snapshot(Swarm(mission, [0])) is None
    assert radio_snapshot(Swarm(mission, [0], channel=lambda _, recipient: recipient)) is None
    faded = radio_snapshot(Swarm(replace(mission, fading="rayleigh", erasure=0.2), [0]))
    assert len(faded.links) == 0
    assert np.all(faded.group == 0)


def test_robots_that_are_off_have_no_links():
    swarm = Swarm(paper("stationary", **CITY), [3])
    swarm._physics.deactivate(np.arange(14)[None] != 5)
    seen = radio_snapshot(swarm)
    assert not np.any((seen.links["sender"] == 5) | (seen.links["receiver"] == 5))
    assert np.sum(seen.group == 5) == 1


def test_a_snapshot_changes_nothing():
    heard = []
    for is_looked_at in (False, True):
        swarm = Swarm(paper("random-walk", **CITY, fading="rayleigh"), [3, 4])
        rng = np.random.default_rng(0)
        for _ in range(6):
            swarm.step_with_recipients(rng.integers(0, 14, (2, 14)))
            heard.append([phase.heard.copy() for phase in swarm.phases])
            if is_looked_at:
                radio_snapshot(swarm)
                radio_snapshot(swarm, 1)
    np.testing.assert_array_equal(heard[:6], heard[6:])


def test_a_fast_team_is_looked_at_more_often():
    """5 windows of 0.1 s are 1.5 m at 3 m/s; half a per cent of a side of 1 km are 5 m."""
    slow, fast = (
        Swarm(paper("random-walk", num_robots=40, velocity_ratio=ratio), [0])
        for ratio in (0.15, 1.2)
    )
    assert (stride_of(slow), stride_of(slow, 9), stride_of(fast)) == (EVERY, 9, 2)


LINKS = np.array([(0, 0, 1, 90, -1, True), (2, 0, 2, 90, 5, False)], LINK)


def test_each_snapshot_stands_for_the_windows_until_the_next_one():
    seen = LinkMismatch(np.array([1, 6, 11]), LINKS)
    found = [len(seen.at(window)) for window in (1, 5, 6, 10, 11, 99)]
    assert found == [1, 1, 0, 0, 1, 1]
    assert {kind: its["receiver"].tolist() for kind, its in by_kind(LINKS).items()} == {
        "unbelieved": [2],
        "too_weak": [1],
    }


def test_dashes_lead_from_robot_to_robot_as_long_as_one_another():
    """Four dashes of 3 units with three gaps of 2 between them: a line of 18 units."""
    lines = divided(np.array([[[0.0, 0.0], [18.0, 0.0]]]), DASHES)
    expected = [[(0, 0), (3, 0)], [(5, 0), (8, 0)], [(10, 0), (13, 0)], [(15, 0), (18, 0)]]
    np.testing.assert_allclose(lines, expected, atol=1e-12)


def test_the_more_is_missing_the_darker():
    found = np.zeros(4, LINK)
    found["margin_db"] = (-1, -15, -30, -99)
    brightness = shades("too_weak", found).astype(int).sum(axis=1)
    assert np.all(np.diff(brightness[:3]) < 0)
    assert brightness[2] == brightness[3]


def test_losses_between_antennas_leave_out_their_gains(tmp_path):
    """88.0 dB over 250 m; margins have the gains and powers of both robots of a link."""
    robot = f"quadrotor:6,{write_rover(tmp_path)}:14"
    mission = paper("stationary", num_robots=20, robot=robot)
    swarm = Swarm(mission, [1], pilot="swarm_mj.physics.pilots:RoverPilot")
    where_m = swarm.states.position_m[0]
    loss_db, margin_db = {}, {}
    for pair, (budget_db, apart_m) in links_db(where_m, [False] * 6 + [True] * 14).items():
        loss_db[pair] = 88.013 + 20.0 * np.log10(apart_m / 250.0)
        margin_db[pair] = 88.013 + budget_db - loss_db[pair]
    found = radio_snapshot(swarm).links
    assert not np.any(found["is_too_weak"])  # gains only add links
    expected = {pair for pair, db in margin_db.items() if 0.0 <= db < 9.0}
    seen = set()
    for _, i, j, loss, margin, _ in found.tolist():
        assert loss == pytest.approx(loss_db[i, j], abs=0.51)
        assert margin == int(np.floor(margin_db[i, j]))
        seen |= {(i, j), (j, i)}
    far = {pair for pair in expected if apart_m_of(where_m, pair) > 250.0}
    assert far
    assert far <= seen


def apart_m_of(where_m, pair):
    first, second = pair
    return np.linalg.norm(where_m[first] - where_m[second])
