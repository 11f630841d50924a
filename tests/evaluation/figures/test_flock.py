"""Fig. 2's mission is the one that a swarm flies, and its arrows are the robots' velocities."""

import numpy as np
import pytest
from matplotlib.quiver import Quiver

from swarm_mj.evaluation.figures import flock
from swarm_mj.evaluation.figures.flock import disagreement_mps, draw_flock, fly_flock
from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm

MISSION = paper("flocking", num_robots=6, num_windows=20, range_ratio=1.0)


def test_start_and_end_are_the_swarms():
    start, end = fly_flock(MISSION, "round-robin", 5)
    swarm = Swarm(MISSION, [5])
    np.testing.assert_array_equal(start.position_m, swarm.states.position_m)
    np.testing.assert_array_equal(start.velocity_mps, swarm.states.velocity_mps)
    for _ in rollout(swarm, make_policy("round-robin", MISSION)):
        pass
    np.testing.assert_array_equal(end.position_m, swarm.states.position_m)
    np.testing.assert_array_equal(end.velocity_mps, swarm.states.velocity_mps)
    (velocity_mps,) = start.velocity_mps
    apart = [np.hypot(*(each - sum(velocity_mps) / 6)) for each in velocity_mps]
    np.testing.assert_allclose(disagreement_mps(start), apart)


def test_arrows_stand_at_the_robots_and_point_where_they_go():
    drawing = draw_flock("paper", "round-robin", 3)
    swarm = Swarm(paper("flocking"), [3])
    arrows = [
        next(c for c in axes.collections if isinstance(c, Quiver)) for axes in drawing.axes[:2]
    ]
    np.testing.assert_allclose(arrows[0].get_offsets(), swarm.states.position_m[0] / 1000.0)
    velocity = swarm.states.velocity_mps[0]
    np.testing.assert_array_equal(np.stack([arrows[0].U, arrows[0].V], axis=1), velocity)
    assert np.ptp(arrows[1].U) < 0.1 * np.ptp(arrows[0].U)  # by then they agree


def test_both_panels_show_the_same_square_with_units_and_the_caption_says_what_was_flown():
    drawing = draw_flock("paper", "round-robin", 3)
    left, right, bar = drawing.axes
    assert left.get_xlim() == right.get_xlim()
    assert left.get_ylim() == right.get_ylim()
    shown = [axes.collections[0].get_offsets() for axes in (left, right)]
    side = np.max(np.ptp(np.concatenate(shown), axis=0)) + 2 * 0.15  # with room for arrows [km]
    assert np.ptp(left.get_xlim()) == pytest.approx(side)
    assert np.ptp(left.get_ylim()) == pytest.approx(side)
    assert (left.get_xlabel(), left.get_ylabel()) == ("x [km]", "y [km]")
    assert left.get_title("left").startswith("after 0 s\nvelocity variance ")
    assert right.get_title("left").startswith("after 50 s\nvelocity variance ")
    assert bar.get_ylabel().endswith("[m/s]")
    caption = drawing.texts[-1].get_text()
    assert "fig2, preset paper: 40 robots, policy round-robin, seed 3, 500 windows" in caption


def test_variances_have_two_digits_by_hand(monkeypatch):
    """Two robots, 3.5 m/s off their mean: 12.25 m²/s². Then 0.00035 m/s: 1.225e-7 m²/s²."""
    teams = [
        RobotStates(
            position_m=np.array([[[-100.0, 0.0], [100.0, 0.0]]]),
            velocity_mps=np.array([[[1.0 - apart_mps, 0.0], [1.0 + apart_mps, 0.0]]]),
        )
        for apart_mps in (3.5, 0.00035)
    ]
    monkeypatch.setattr(flock, "fly_flock", lambda *_: teams)
    left, right, _ = draw_flock("paper", "round-robin", 3).axes
    assert left.get_title("left").endswith("velocity variance 12 m²/s²")
    assert right.get_title("left").endswith(r"velocity variance 1.2$\times$10$^{-7}$ m²/s²")
