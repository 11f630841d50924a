"""Turns of four robots, 100 m apart in a line, by hand."""

import numpy as np

from swarm_mj.policies.gnn.turns import count_near, write_turns

X_M = np.array([0.0, 100.0, 200.0, 300.0])
Y_M = np.zeros(4)


def turns(window, *, radius_m=150.0, known=(True, True, True, True)):
    has_turn = np.full(4, 9.0, dtype=np.float32)  # what was there before counts for nothing
    write_turns(
        x_m=X_M,
        y_m=Y_M,
        is_known=np.array(known),
        window=window,
        radius_m=radius_m,
        has_turn=has_turn,
        is_close=np.full(4, 9.0),
    )
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


def test_places_within_a_radius_are_counted():
    assert [count_near(X_M, Y_M, 100.0, 0.0, radius_m) for radius_m in (99.0, 100.0, 200.0)] == [
        1,
        3,
        4,
    ]
