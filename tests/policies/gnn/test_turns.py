"""Turns of four robots, 100 m apart in a line, by hand."""

import numpy as np
import pytest

from swarm_mj.policies.gnn.turns import count_near, empty_beliefs, take_beliefs, write_turns

BELIEVED_M = np.array([[0.0, 0.0], [100.0, 0.0], [200.0, 0.0], [300.0, 0.0]])
EVERYONE = (True, True, True, True)


def beliefs(known=EVERYONE):
    room = empty_beliefs(4)
    take_beliefs(BELIEVED_M, np.array(known), room)
    return room


def turns(window, *, radius_m=150.0, known=EVERYONE):
    has_turn = np.full(4, 9.0, dtype=np.float32)  # what was there before counts for nothing
    write_turns(beliefs(known), window, radius_m, has_turn)
    return has_turn.tolist()


def test_the_leader_goes_first_and_others_join_if_they_are_far_enough():
    """Robot 0 leads; 2 joins, 200 m away; 3 is 100 m from 2, and 1 from both."""
    assert turns(0) == turns(4) == [1.0, 0.0, 1.0, 0.0]
    assert turns(1) == [0.0, 1.0, 0.0, 1.0]  # then 3, half a round away
    assert turns(0, radius_m=250.0) == [1.0, 0.0, 0.0, 1.0]
    assert turns(0, radius_m=50.0) == [1.0, 1.0, 1.0, 1.0]


def test_nobody_joins_after_a_robot_that_may_be_anywhere():
    assert turns(0, known=(True, True, False, True)) == [1.0, 0.0, 0.0, 0.0]
    assert turns(0, known=(True, False, True, True)) == [1.0, 0.0, 1.0, 0.0]
    assert turns(0, known=(False, True, True, True)) == [0.0, 0.0, 0.0, 0.0]


def near(radius_m, known=EVERYONE):
    room = beliefs(known)
    count_near(room, radius_m)
    return room.num_near.tolist()


def test_robots_within_a_radius_are_counted_and_oneself_too():
    assert near(99.0) == [1, 1, 1, 1]
    assert near(100.0) == [2, 3, 3, 2]
    assert near(200.0) == [3, 4, 4, 3]


def test_robots_of_unknown_place_are_near_nobody():
    assert near(100.0, known=(True, False, True, True)) == [1, 0, 2, 2]


def test_the_next_beliefs_take_the_place_of_the_last():
    room = beliefs((True, False, True, True))
    take_beliefs(BELIEVED_M, np.array(EVERYONE), room)
    count_near(room, 100.0)
    assert room.num_near.tolist() == [2, 3, 3, 2]


@pytest.mark.parametrize("axis", [0, 1])
def test_beliefs_are_new_unless_places_and_acquaintances_are_the_same(axis):
    believed_m = np.tile(BELIEVED_M, (5, 1, 1))
    is_known = np.ones((5, 4), dtype=np.bool_)
    believed_m[2:, 3, axis] += 1e-9
    is_known[4:, 1] = False
    room = empty_beliefs(4)
    take_beliefs(believed_m[0], is_known[0], room)
    is_new = [take_beliefs(believed_m[i], is_known[i], room) for i in range(1, 5)]
    assert is_new == [False, True, False, True]
