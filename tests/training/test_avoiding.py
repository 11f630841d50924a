"""Errands: what barriers allow, by hand, and that fresh news prevents crashes that old does not."""

import numpy as np
import pytest
from examples.avoiding import KEPT_M, SOONEST_S, Delayed, Errands, four_seconds, fresh

import swarm_mj
from swarm_mj.mission import Mission, paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.protocol.buffers import empty_buffers

FAR_M = [400.0, 400.0, 5.0]  # from everything


def mission(**fields) -> Mission:
    """Three quadrotors in an area of 1 km²."""
    return paper("random-walk", robot="quadrotor", num_robots=3, density_per_km2=3.0, **fields)


def errands(made: Errands, place_m) -> Errands:
    """Start a controller, and send robot 0 to a place; the others stay where they are."""
    made.start(3, [np.random.default_rng(1)])
    made._place_m[0, 0] = place_m
    return made


def states(position_m, velocity_mps=None) -> RobotStates:
    """Where the robots are, and how fast."""
    position_m = np.array([position_m])
    if velocity_mps is None:
        return RobotStates(position_m=position_m, velocity_mps=np.zeros_like(position_m))
    return RobotStates(position_m=position_m, velocity_mps=np.array([velocity_mps]))


def heard(positions_m, velocity_mps=(0.0, 0.0, 0.0), age=0.0):
    """Buffers of robot 0, which has heard of robot 1 at a place, so many windows ago."""
    buffers = empty_buffers(1, 3, num_axes=3)
    buffers.timestamp[0, 0, 0] = 50.0
    buffers.timestamp[0, 0, 1] = 50.0 - age
    buffers.position_m[0, 0, 1] = positions_m
    buffers.velocity_mps[0, 0, 1] = velocity_mps
    return buffers


def velocity_mps(made: Errands, buffers, where: RobotStates):
    """The velocity that robot 0 steers to, at rest."""
    return made(buffers, where)[0, 0] / 2.0  # 2 per second


def test_a_robot_alone_flies_straight_to_its_place():
    made = errands(Errands(mission()), [30.0, 40.0])
    where = states([[0.0, 0.0, 5.0], FAR_M, FAR_M])
    np.testing.assert_allclose(
        velocity_mps(made, empty_buffers(1, 3, num_axes=3), where), [1.8, 2.4, 0.0]
    )


def test_it_comes_nearer_to_a_teammate_by_half_of_what_the_barrier_allows():
    made = errands(Errands(mission()), [100.0, 0.0])
    where = states([[0.0, 0.0, 5.0], [6.0, 0.0, 5.0], FAR_M])
    allowed_mps = (6.0 - KEPT_M) / (2.0 * SOONEST_S)
    found = velocity_mps(made, heard([6.0, 0.0, 5.0]), where)
    np.testing.assert_allclose(found, [allowed_mps, 0.0, 0.0], atol=1e-5)


def test_it_backs_off_from_one_that_is_too_near():
    made = errands(Errands(mission()), [100.0, 0.0])
    where = states([[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], FAR_M])
    found = velocity_mps(made, heard([1.0, 0.0, 5.0]), where)
    assert found[0] == pytest.approx(-(KEPT_M - 1.0) / (2.0 * SOONEST_S), abs=1e-5)


def test_it_knows_of_a_teammate_what_it_has_heard_alone():
    """A teammate in the way, unheard of, is none; one that was heard has flown on since."""
    made = errands(Errands(mission()), [100.0, 0.0])
    where = states([[0.0, 0.0, 5.0], [6.0, 0.0, 5.0], FAR_M])
    assert velocity_mps(made, empty_buffers(1, 3, num_axes=3), where)[0] == pytest.approx(3.0)
    # 20 windows ago it was at 11 m, and came nearer with 2.5 m/s: by now to 6 m.
    news = heard([11.0, 0.0, 5.0], velocity_mps=(-2.5, 0.0, 0.0), age=20.0)
    allowed_mps = (6.0 - KEPT_M) / (2.0 * SOONEST_S)
    assert velocity_mps(made, news, where)[0] == pytest.approx(allowed_mps, abs=1e-5)


def test_a_tree_is_passed_on_a_side():
    """The first tree of the forest stands at a known place, 6 m thick."""
    made = errands(Errands(mission(arena="forest")), [0.0, 0.0])
    x, y = made._tree_m[0]
    made._place_m[0, 0] = [x + 50.0, y + 1.0]
    where = states([[x - 10.0, y, 5.0], FAR_M, FAR_M])
    found = velocity_mps(made, empty_buffers(1, 3, num_axes=3), where)
    assert found[0] == pytest.approx((10.0 - 6.0 - KEPT_M) / SOONEST_S, abs=1e-5)
    assert found[1] == pytest.approx(3.0 * 1.0 / np.hypot(60.0, 1.0))


def test_delayed_news_is_the_truth_of_then_and_flown_on():
    made = Delayed(2, mission())
    made.start(3, [np.random.default_rng(1)])
    buffers = empty_buffers(1, 3, num_axes=3)
    for x in (0.0, 1.0, 3.0, 7.0):
        where = states([[x, 0.0, 5.0]] * 3, [[10.0, 0.0, 0.0]] * 3)
        is_known, team_m = made.news(buffers, where)
    assert np.all(is_known)
    np.testing.assert_allclose(team_m, np.broadcast_to([1.0 + 0.2 * 10.0, 0.0], (1, 3, 3, 2)))


def test_a_robot_that_arrived_gets_another_place():
    made = errands(Errands(mission()), [5.0, 0.0])
    where = states([[0.0, 0.0, 5.0], FAR_M, FAR_M])
    velocity_mps(made, empty_buffers(1, 3, num_axes=3), where)
    assert np.any(made._place_m[0, 0] != [5.0, 0.0])


def test_the_cost_is_the_speed_at_which_robots_do_not_come_nearer():
    made = errands(Errands(mission()), [100.0, 0.0])
    made._place_m[0] = [[100.0, 0.0]] * 3
    where = states([[0.0, 0.0, 5.0]] * 3, [[3.0, 0.0, 0.0], [0.0, 3.0, 0.0], [0.0, 0.0, 0.0]])
    assert made.cost(where) == pytest.approx([3.0 - 1.0])


def test_errands_are_refused_among_houses():
    with pytest.raises(ValueError, match="blocks has obstacles that are no cylinders"):
        Errands(mission(arena="blocks"))


def test_fresh_news_prevents_crashes_that_old_news_does_not():
    """A law of information: the same missions, with what robots know as the only difference."""
    dense = paper(
        "random-walk",
        robot="quadrotor",
        collide=True,
        arena="forest",
        height_m=5.0,
        density_per_km2=3000.0,
        num_windows=150,
    )
    crashed = {}
    for name, made in (("fresh", fresh), ("old", four_seconds)):
        run = swarm_mj.fly(dense, policy="tdma", controller=made(dense), seed=6400)
        crashed[name] = run.summary.crashed
    assert crashed["fresh"] == 0
    assert crashed["old"] > 0
