"""The tour of the README's film: its map, its leader, and a flight by name."""

import numpy as np
import pytest
from city_tour import ARRIVED_M, CLEARANCE_M, StreetMap, Tour

import swarm_mj
from swarm_mj.mission import paper
from swarm_mj.physics.obstacles import obstacles_of
from swarm_mj.physics.scene import compose

MISSION = paper("random-walk", arena="blocks", num_robots=30)


@pytest.fixture(scope="module")
def streets():
    return StreetMap(MISSION)


def is_clear(points_m):
    found = obstacles_of(compose(MISSION).compile())
    off_m = np.abs(points_m[:, None] - found.centre_m[:, :2]) - found.size_m[:, :2]
    return np.all(off_m.max(axis=2) > CLEARANCE_M, axis=1)


def test_the_square_of_any_place_is_clear_of_blocks(streets):
    half_m = MISSION.half_side_m
    anywhere_m = np.random.default_rng(1).uniform(-half_m, half_m, size=(300, 2))
    assert np.all(is_clear(streets.centre_m[streets.square(anywhere_m)]))


def test_the_way_leads_round_the_blocks_to_the_goal(streets):
    at_m = streets.centre_m[streets.square(np.array([-400.0, -400.0]))]
    goal_m = streets.centre_m[streets.square(np.array([400.0, 400.0]))]
    for _ in range(200):
        next_m = streets.towards(at_m, goal_m)
        assert is_clear(next_m[None])[0]
        if np.array_equal(next_m, goal_m):
            return
        assert np.linalg.norm(next_m - at_m) < 100.0
        at_m = next_m
    pytest.fail("it never arrives")


def test_the_leader_turns_where_it_has_arrived():
    tour = Tour(MISSION)
    tour.start(30, [np.random.default_rng(0)])
    first = tour._leaders_goal_m(np.array([[400.0, 400.0]]))
    near = first + 0.5 * ARRIVED_M / np.sqrt(2.0)
    assert not np.array_equal(tour._leaders_goal_m(near), first)


def test_robots_follow_their_leader_by_name():
    run = swarm_mj.fly(
        "random-walk",
        policy="tdma",
        controller="city_tour:Tour",
        arena="blocks",
        num_robots=8,
        velocity_ratio=0.8,
        num_windows=200,
    )
    assert run.task_cost == (Tour.cost_name, Tour.cost_unit)
    assert run.summary.task_cost_last < 0.7 * run.summary.task_cost_first
