import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.round_robin import RoundRobin
from swarm_mj.protocol.buffers import empty_buffers
from swarm_mj.protocol.local_views import LocalViews
from swarm_mj.simulation.swarm import Swarm

# Four robots in the plane [m]; the third is nearest the centre.
SQUARE_M = np.array([[-90.0, 0.0], [0.0, 80.0], [10.0, -10.0], [70.0, 70.0]])


def decided(position_m, window):
    """Whom everyone addresses in this window of missions with these positions [b, i, axis]."""
    num_missions, num_robots = position_m.shape[:2]
    views = LocalViews(
        buffers=empty_buffers(num_missions, num_robots),
        now=np.full(num_missions, float(window)),
        phases=(),
    )
    states = RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
    return RoundRobin().recipients(views, states).tolist()


def test_iv_c_schedule_by_hand():
    """Robots 0, 1 and 3 take turns in addressing the base, robot 2; everyone else is silent."""
    schedule = [decided(SQUARE_M[None], window)[0] for window in range(5)]
    assert schedule == [[2, 1, 2, 3], [0, 2, 2, 3], [0, 1, 2, 2], [2, 1, 2, 3], [0, 2, 2, 3]]


@pytest.mark.parametrize(
    ("order", "first_three"),
    [
        ([2, 0, 1, 3], [[0, 0, 2, 3], [0, 1, 0, 3], [0, 1, 2, 0]]),  # the base is robot 0
        ([0, 1, 3, 2], [[3, 1, 2, 3], [0, 3, 2, 3], [0, 1, 3, 3]]),  # the base is robot 3
    ],
)
def test_iv_c_schedule_skips_the_base(order, first_three):
    assert [decided(SQUARE_M[None, order], window)[0] for window in range(3)] == first_three


def test_iv_c_base_is_nearest_to_the_centre_not_to_the_team():
    """The middle robot of a line beside the centre is no base: the one nearest the origin is."""
    line_m = np.array([[[300.0, 0.0], [200.0, 0.0], [100.0, 0.0]]])
    assert decided(line_m, 0) == [[2, 1, 2]]


def test_iv_c_base_is_chosen_anew_in_each_window():
    """When robot 3 moves to the centre it is the base of the next window."""
    moved_m = SQUARE_M.copy()
    moved_m[3] = [1.0, 1.0]
    assert decided(SQUARE_M[None], 2) == [[0, 1, 2, 2]]
    assert decided(moved_m[None], 2) == [[0, 1, 3, 3]]


def test_iv_c_nearest_means_the_straight_line():
    """(3, 3) is 4.2 m from the centre by a straight line, (5, 0) is 5 m; along axes 6 and 5."""
    mission = paper("stationary", num_robots=3)
    swarm = Swarm(mission, [0])
    states = RobotStates(
        position_m=np.array([[[5.0, 0.0], [3.0, 3.0], [9.0, 9.0]]]),
        velocity_mps=np.zeros((1, 3, 2)),
    )
    recipient = RoundRobin().recipients(swarm.views, states)
    np.testing.assert_array_equal(recipient, [[1, 1, 2]])
