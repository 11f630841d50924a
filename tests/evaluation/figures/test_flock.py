"""Fig. 2's mission is the one that a swarm flies, and its arrows are the robots' velocities."""

import numpy as np
import pytest
from matplotlib.quiver import Quiver

from swarm_mj.evaluation.figures.flock import draw_flock
from swarm_mj.mission import paper
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.rollout import rollout
from swarm_mj.simulation.swarm import Swarm


@pytest.fixture(scope="module")
def drawing():
    return draw_flock("paper", "round-robin", 3)


@pytest.fixture(scope="module")
def flown():
    """Where the team was at the start and at the end, and how fast."""
    mission = paper("flocking")
    swarm = Swarm(mission, [3])
    start = swarm.states
    for _ in rollout(swarm, make_policy("round-robin", mission)):
        pass
    return start, swarm.states


def arrows_of(axes):
    return next(each for each in axes.collections if isinstance(each, Quiver))


def test_arrows_stand_at_the_robots_and_point_where_they_go(drawing, flown):
    for axes, team in zip(drawing.axes[:2], flown, strict=True):
        arrows = arrows_of(axes)
        np.testing.assert_array_equal(arrows.get_offsets(), team.position_m[0])
        velocity_mps = np.stack([arrows.U, arrows.V], axis=1)
        np.testing.assert_array_equal(velocity_mps, team.velocity_mps[0])


def test_colours_are_the_distance_from_the_teams_mean_on_one_scale(drawing, flown):
    left, right, _ = drawing.axes
    for axes, team in zip((left, right), flown, strict=True):
        (velocity_mps,) = team.velocity_mps
        apart = [np.hypot(*(each - sum(velocity_mps) / 40)) for each in velocity_mps]
        np.testing.assert_allclose(np.array(arrows_of(axes).get_array()), apart, atol=1e-12)
    most = np.array(arrows_of(left).get_array()).max()
    assert arrows_of(left).get_clim() == arrows_of(right).get_clim() == (0.0, most)


def test_both_panels_show_the_same_part_with_units_and_the_caption_says_what_was_flown(
    drawing, flown
):
    left, right, bar = drawing.axes
    assert left.get_xlim() == right.get_xlim()
    assert left.get_ylim() == right.get_ylim()
    low, high = np.transpose([left.get_xlim(), left.get_ylim()])
    for team in flown:
        assert np.all((low < team.position_m - 100.0) & (team.position_m + 100.0 < high))
    assert (left.get_xlabel(), left.get_ylabel()) == ("x [m]", "y [m]")
    for axes, time_s, team in zip((left, right), (0, 50), flown, strict=True):
        (velocity_mps,) = team.velocity_mps
        variance = np.mean(np.sum((velocity_mps - velocity_mps.mean(axis=0)) ** 2, axis=1))
        title = f"after {time_s} s\nvelocity variance {variance:.2g} m²/s²"
        assert axes.get_title("left") == title
    assert bar.get_ylabel().endswith("[m/s]")
    caption = drawing.texts[-1].get_text()
    assert "fig2, preset paper: 40 robots, policy round-robin, seed 3, 500 windows" in caption
