"""Where robots may begin: beside walls and each other, by hand."""

from dataclasses import replace

import numpy as np
from walls import walls

from swarm_mj.mission import paper
from swarm_mj.physics.state import ROBOT_RADIUS_M
from swarm_mj.physics.worlds import PointWorlds
from swarm_mj.simulation.starts import Starts

MISSION = paper(num_robots=3)


def starts(mission=MISSION, obstacles=None):
    worlds = PointWorlds(mission, 1)
    worlds.obstacles = obstacles
    return Starts(mission=mission, worlds=worlds, channel=None)


def test_the_second_of_two_robots_that_would_collide_is_blocked():
    """Two that stand 1.9 radii apart overlap, 2.1 do not; without collisions nobody is in the way.

    The first one may stay.
    """
    collide = replace(MISSION, physics="contact", collide=True)
    near, far = 1.9 * ROBOT_RADIUS_M, 2.1 * ROBOT_RADIUS_M
    position_m = np.array([[0.0, 0.0], [near, 0.0], [0.0, far]])
    assert starts(mission=collide).is_blocked(position_m).tolist() == [False, True, False]
    assert not np.any(starts().is_blocked(position_m))


def test_a_team_begins_connected_within_its_area():
    """Three robots with a range of half their side: some pair of distances joins them all."""
    mission = replace(MISSION, range_ratio=0.5 * MISSION.side_m / 1000.0)
    for seed in range(20):
        position_m = starts(mission=mission).positions(0, np.random.default_rng(seed))
        assert np.all(np.abs(position_m) <= mission.half_side_m)
        apart_m = np.linalg.norm(position_m[:, None] - position_m, axis=-1)
        sides_m = sorted([apart_m[0, 1], apart_m[0, 2], apart_m[1, 2]])
        assert sides_m[1] <= mission.range_m


def test_obstacles_are_in_the_way():
    wall = walls(0.1, 0)
    assert starts(obstacles=wall).is_blocked(wall.centre_m[:1, :2]).tolist() == [True]
