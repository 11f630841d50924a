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
