"""True states: of one shape, and of robots that are all on unless it is said who is."""

import mujoco
import numpy as np

from swarm_mj.physics import state
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import empty_buffers, observe_self

PLACES = np.arange(12.0).reshape(2, 3, 2)  # of 2 missions of 3 robots


def observed(**who):
    """What robots know about themselves at t = 4 and t = 7, from buffers that were empty."""
    buffers = empty_buffers(2, 3)
    states = RobotStates(position_m=PLACES, velocity_mps=PLACES, **who)
    observe_self(buffers, states, np.array([4.0, 7.0]))
    return np.diagonal(buffers.timestamp, axis1=1, axis2=2).tolist()


def test_everyone_is_active_unless_it_is_said_who_is():
    assert observed() == [[4.0, 4.0, 4.0], [7.0, 7.0, 7.0]]
    is_active = np.array([[True, False, True], [False, False, True]])
    assert observed(is_active=is_active) == [[4.0, 0.0, 4.0], [0.0, 0.0, 7.0]]


def test_kinds_of_obstacles_are_numbered_as_in_mujoco():
    for name in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX"):
        assert getattr(state, name) == getattr(mujoco.mjtGeom, f"mjGEOM_{name}").value


def test_crashes_and_energy_are_those_of_each_mission():
    """Of two missions of three robots; of points, nothing is known."""
    zeros = np.zeros((2, 3, 3))
    crashed = np.array([[True, False, True], [False, False, False]])
    energy_j = np.array([[1.0, 2.0, 6.0], [4.0, np.nan, 5.0]])
    states = RobotStates(
        position_m=zeros, velocity_mps=zeros, has_crashed=crashed, energy_j=energy_j
    )
    assert states.num_crashed.tolist() == [2.0, 0.0]
    np.testing.assert_array_equal(states.mean_energy_j, [3.0, np.nan])
    np.testing.assert_array_equal(states.most_energy_j, [6.0, np.nan])
    points = RobotStates(position_m=zeros, velocity_mps=zeros)
    for unknown in (points.num_crashed, points.mean_energy_j, points.most_energy_j):
        np.testing.assert_array_equal(unknown, [np.nan, np.nan])
