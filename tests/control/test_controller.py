"""The spring that leads to a target, against the motion of a damped oscillator."""

import numpy as np
import pytest

from swarm_mj.control.controller import Controller, Costed, steer
from swarm_mj.control.motion import controller_of
from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates


def states_of(position_m, velocity_mps):
    place, speed = (np.array(each, dtype=float) for each in (position_m, velocity_mps))
    return RobotStates(position_m=place[None], velocity_mps=speed[None])


def test_accelerations_by_hand():
    """A quarter of the way left, minus the velocity."""
    states = states_of([[10.0, 0.0], [0.0, -4.0]], [[1.0, -2.0], [0.0, 0.5]])
    target_m = np.array([[[14.0, 8.0], [0.0, -4.0]]])
    assert steer(target_m, states).tolist() == [[[0.0, 4.0], [0.0, -0.5]]]


def test_a_robot_at_rest_comes_to_its_target_and_never_past_it():
    """Critically damped from rest: (1 + t / 2) exp(-t / 2) of the way is left."""
    position_m, velocity_mps, step_s = np.array([[8.0, 0.0]]), np.zeros((1, 2)), 1e-3
    for n in range(1, 12_001):
        velocity_mps = velocity_mps + step_s * steer(
            np.zeros((1, 1, 2)), states_of(position_m, velocity_mps)
        ).reshape(1, 2)
        position_m = position_m + step_s * velocity_mps
        if n % 3000 == 0:
            t = n * step_s
            left_m = 8.0 * (1.0 + t / 2.0) * np.exp(-t / 2.0)
            assert position_m[0] == pytest.approx([left_m, 0.0], abs=0.01)


def test_who_has_a_cost_says_so():
    class Still:
        def __call__(self, _buffers, states):
            return np.zeros_like(states.velocity_mps)

    assert isinstance(Still(), Controller)
    assert not isinstance(Still(), Costed)
    assert isinstance(controller_of(paper("coverage")), Costed)
