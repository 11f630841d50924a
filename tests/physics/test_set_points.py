"""Set points of robots with bodies, beside the same written out for one robot and axis."""

import numpy as np
import pytest

from swarm_mj.physics.set_points import hold_places, move_set_points

LIMIT_MPS = 3.0
WINDOW_S = 0.1


def moved(acceleration, *, position=(0.0, 0.0, 20.0), course=(0.0, 0.0, 0.0), height=20.0):
    """The set point of one robot a window later, and its height."""
    course_mps = np.array(course)[None, None]
    height_m = np.array([[height]])
    move_set_points(
        acceleration=np.array(acceleration)[None, None],
        position=np.array(position)[None, None],
        dt_s=WINDOW_S,
        limit_mps2=20.0,
        limit_mps=LIMIT_MPS,
        wall_m=500.0,
        course_mps=course_mps,
        height_m=height_m,
    )
    return course_mps[0, 0].tolist(), height_m[0, 0]


def test_acceleration_and_velocity_are_clipped_axis_by_axis():
    course_mps, height_m = moved((5.0, 500.0, -500.0), course=(1.0, 0.5, 0.0))
    assert course_mps == pytest.approx([1.5, 2.5, -2.0])
    assert height_m == pytest.approx(19.8)
    assert moved((20.0, 0.0, 0.0), course=(2.0, 0.0, 0.0))[0][0] == LIMIT_MPS


@pytest.mark.parametrize(("x_m", "later_mps"), [(501.0, -2.0), (499.0, 2.0), (-501.0, 2.0)])
def test_a_set_point_turns_round_beyond_the_edge_if_it_leads_outwards(x_m, later_mps):
    course_mps, _ = moved((0.0, 0.0, 0.0), position=(x_m, 0.0, 20.0), course=(2.0, 0.0, 0.0))
    assert course_mps == [later_mps, 0.0, 0.0]


def test_a_height_sinks_no_further_than_half_a_metre():
    course_mps, height_m = moved((0.0, 0.0, -20.0), height=0.6)
    assert height_m == 0.5
    assert course_mps[2] == 0.0


def held(course, position, place):
    """What a pilot is to fly, and the place that its robot is to hold."""
    place_m = np.array(place)[None, None]
    wanted_mps = np.zeros((1, 1, 3))
    hold_places(
        position=np.array(position)[None, None],
        course_mps=np.array(course)[None, None],
        dt_s=WINDOW_S,
        limit_mps=LIMIT_MPS,
        place_m=place_m,
        wanted_mps=wanted_mps,
    )
    return wanted_mps[0, 0].tolist(), place_m[0, 0].tolist()


def test_a_robot_that_moves_follows_its_set_point_and_notes_where_it_will_be():
    wanted_mps, place_m = held((1.0, 0.0, 0.5), (10.0, 4.0, 20.0), (0.0, 0.0))
    assert wanted_mps == [1.0, 0.0, 0.5]
    assert place_m == pytest.approx([10.1, 4.0])


def test_a_robot_at_rest_flies_back_to_its_place_no_faster_than_robots_may():
    wanted_mps, place_m = held((1e-9, 0.0, 0.0), (10.0, 0.0, 20.0), (8.0, 50.0))
    assert wanted_mps == pytest.approx([-1.2, LIMIT_MPS, 0.0])
    assert place_m == [8.0, 50.0]
