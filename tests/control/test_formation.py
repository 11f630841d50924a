import numpy as np
import pytest
from channels import to_nobody
from truth import tell_everyone_the_truth

from swarm_mj.control.controller import DAMPING_PER_S, STIFFNESS_PER_S2
from swarm_mj.control.formation import Formation, block
from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.simulation.swarm import Swarm


def formation_error(position_m, place_m, is_active=None):
    """The task's cost, with these places."""
    task = Formation(paper("formation", num_robots=len(place_m)))
    task._place_m = place_m
    velocity_mps = np.zeros_like(position_m)
    return task.cost(
        RobotStates(position_m=position_m, velocity_mps=velocity_mps, is_active=is_active)
    )


def test_a_block_of_five_by_hand():
    """Three columns 30 m wide: rows of 3 and 2, 15 m apart; their mean is the origin."""
    place_m = block(5, 30.0)
    apart = place_m - place_m[0]
    np.testing.assert_allclose(apart, [[0, 0], [15, 0], [30, 0], [0, -15], [15, -15]])
    np.testing.assert_allclose(place_m.mean(axis=0), 0.0, atol=1e-12)


@pytest.mark.parametrize("num_robots", [2, 3, 4, 10, 40, 97, 1000])
def test_a_block_fits_the_area_whatever_the_team(num_robots):
    mission = paper("formation", num_robots=num_robots)
    place_m = block(num_robots, mission.side_m / 2)
    assert len(np.unique(place_m.round(6), axis=0)) == num_robots
    assert np.all(np.ptp(place_m, axis=0) <= mission.side_m / 2 + 1e-9)


def test_the_law_by_hand():
    """Robot 0 knows robot 2 alone, which was at (100, 0): its own place is d_0 - d_2 from there."""
    mission = paper("formation", num_robots=4)
    place_m = block(4, mission.side_m / 2)
    buffers = empty_buffers(1, 4)
    buffers.timestamp[0, 0, 2] = 1.0
    buffers.position_m[0, 0, 2] = [100.0, 0.0]
    velocity_mps = np.full((1, 4, 2), 3.0)
    states = RobotStates(position_m=np.full((1, 4, 2), 7.0), velocity_mps=velocity_mps)
    u = Formation(mission)(buffers, states)
    target_m = np.array([100.0, 0.0]) + place_m[0] - place_m[2]
    expected = STIFFNESS_PER_S2 * (target_m - 7.0) - DAMPING_PER_S * 3.0
    np.testing.assert_allclose(u[0, 0], expected)
    np.testing.assert_allclose(u[0, 1:], -3.0 * DAMPING_PER_S)  # they know nobody, and stop


def test_delays_cannot_make_it_swing():
    """c² >= 2k: |k - w² + c w i| > k for every frequency w, whatever the delay's phase."""
    assert DAMPING_PER_S**2 >= 2 * STIFFNESS_PER_S2


def test_the_error_of_a_formation_is_none_wherever_it_stands():
    place_m = block(7, 100.0)
    there = np.stack([place_m, place_m + np.array([30.0, -500.0])])
    np.testing.assert_allclose(formation_error(there, place_m), 0.0, atol=1e-9)


def test_the_error_of_one_robot_out_of_place_by_hand():
    """One of four is 8 m off: 2 m of it are everyone's, so 6 and three times 2 are left."""
    place_m = block(4, 100.0)
    position_m = place_m[None].copy()
    position_m[0, 3, 0] += 8.0
    expected = np.sqrt((6.0**2 + 3 * 2.0**2) / 4)
    assert formation_error(position_m, place_m)[0] == pytest.approx(expected)
    everyone_else = np.array([[True, True, True, False]])
    assert formation_error(position_m, place_m, everyone_else)[0] == pytest.approx(0.0, abs=1e-9)


def errors_along(tells_the_truth, shift_m=0.0, num_windows=600):
    mission = paper("formation", num_robots=9, velocity_ratio=1.0, boundary="none")
    swarm = Swarm(mission, [1, 2], channel=to_nobody)
    states = swarm.states
    swarm._physics.place(states.position_m + shift_m, states.velocity_mps)
    errors = []
    for _ in range(num_windows):
        if tells_the_truth:
            tell_everyone_the_truth(swarm)
        errors.append(swarm.step_with_recipients(swarm.views.silence.copy()).task_cost.value)
    return np.array(errors)


def test_fresh_news_lead_to_the_formation_and_none_do_not():
    told = errors_along(True)
    assert np.all(np.diff(told[:200:10], axis=0) < 0.0)
    assert np.all(told[-1] < 0.01)
    untold = errors_along(False, num_windows=50)
    np.testing.assert_allclose(untold, untold[:1].repeat(50, axis=0))  # nobody knows anybody


def test_a_team_elsewhere_does_the_same():
    here, there = errors_along(True, num_windows=60), errors_along(True, 1000.0, num_windows=60)
    np.testing.assert_allclose(here, there, rtol=1e-6)
