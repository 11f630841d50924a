"""Errors of robots' own positions: their law, over seeded draws, and what they leave as it is."""

import math

import numpy as np
import pytest

from swarm_mj.mission import paper
from swarm_mj.physics.state import RobotStates
from swarm_mj.policies.registry import make_policy
from swarm_mj.simulation.localisation import Localisation
from swarm_mj.simulation.swarm import Swarm

EVERYONE = np.arange(10)


def localised(num_missions=50, **fields):
    """The process alone, of 10 robots a mission."""
    mission = paper(num_robots=10, **fields)
    return Localisation(mission, [np.random.default_rng(seed) for seed in range(num_missions)])


def errors(localisation, velocity_mps, num_windows):
    """Of robots in the origin with this velocity, window by window [m]."""
    states = RobotStates(position_m=np.zeros_like(velocity_mps), velocity_mps=velocity_mps)
    return np.stack([localisation.advance(states).own_m for _ in range(num_windows)])


@pytest.mark.parametrize(("std_m", "time_s"), [(5.0, 0.5), (1.0, 0.2), (20.0, 0.0)])
def test_moving_robots_err_by_a_process_of_this_deviation_and_correlation_time(std_m, time_s):
    """A correlation of 1/e after the time, and none with another axis, robot or mission."""
    localisation = localised(position_noise_m=std_m, position_noise_s=time_s)
    error_m = errors(localisation, np.ones((50, 10, 2)), 400)
    assert np.std(error_m) == pytest.approx(std_m, rel=0.01)
    assert np.std(error_m[0]) == pytest.approx(std_m, rel=0.1)  # from the start on
    assert np.mean(error_m) == pytest.approx(0.0, abs=0.03 * std_m)
    for windows in (1, 2, 5):
        expected = math.exp(-0.1 * windows / time_s) if time_s > 0.0 else 0.0
        product = np.mean(error_m[windows:] * error_m[:-windows])
        assert product / std_m**2 == pytest.approx(expected, abs=0.02)
    for other in (error_m[..., ::-1], np.roll(error_m, 1, axis=2), np.roll(error_m, 1, axis=1)):
        assert np.mean(error_m * other) / std_m**2 == pytest.approx(0.0, abs=0.02)


def test_a_robot_that_stands_keeps_its_error_and_goes_on_when_it_moves():
    velocity_mps = np.zeros((50, 10, 2))
    velocity_mps[:, 3, 1] = 1e-12
    localisation = localised(position_noise_m=5.0)
    error_m = errors(localisation, velocity_mps, 30)
    stands = EVERYONE != 3
    np.testing.assert_array_equal(error_m[1:, :, stands], error_m[:1, :, stands].repeat(29, 0))
    assert np.all(error_m[1:, :, 3] != error_m[:-1, :, 3])
    moving_m = errors(localisation, np.ones((50, 10, 2)), 1)
    assert np.all(moving_m != error_m[-1])
    assert np.corrcoef(moving_m[0, :, 0, 0], error_m[-1, :, 0, 0])[0, 1] > 0.9


def flown(policy, seeds=(4,), num_windows=20, task="random-walk", **fields):
    """A mission's true positions, T, and own positions, after every window."""
    mission = paper(task, num_robots=10, **fields)
    swarm, seen = Swarm(mission, seeds), []
    swarm.start(make_policy(policy, mission))
    for _ in range(num_windows):
        swarm.step()
        own_m = swarm.buffers.position_m[:, EVERYONE, EVERYONE]
        seen.append((swarm.states.position_m, swarm.buffers.timestamp.copy(), own_m))
    return [np.stack(each) for each in zip(*seen, strict=True)]


@pytest.mark.parametrize("physics", ["exact", "contact"])
@pytest.mark.parametrize("task", ["random-walk", "flocking"])
def test_the_truth_and_the_radio_do_not_err(task, physics):
    """Round-robin asks for no positions, so every packet is decoded as without errors."""
    exact = flown("round-robin", task=task, physics=physics)
    noisy = flown("round-robin", task=task, physics=physics, position_noise_m=20.0)
    np.testing.assert_array_equal(exact[0], noisy[0])
    np.testing.assert_array_equal(exact[1], noisy[1])
    np.testing.assert_array_equal(exact[2], exact[0])
    assert np.all(noisy[2] != noisy[0])
    assert np.std(noisy[2] - noisy[0]) == pytest.approx(20.0, rel=0.5)


def test_a_controller_sees_where_its_robots_observe_themselves_to_be():
    """That is what a robot's own buffer says of itself."""
    seen_m = []

    def rest(buffers, states):
        own_m = buffers.position_m[:, EVERYONE, EVERYONE]
        np.testing.assert_allclose(states.own_m, own_m, atol=1e-9)
        seen_m.append(states.own_m - states.position_m)
        return np.zeros_like(states.position_m)

    mission = paper("random-walk", num_robots=10, position_noise_m=20.0)
    swarm = Swarm(mission, [1], controller=rest)
    swarm.start(make_policy("tdma", mission))
    for _ in range(5):
        swarm.step()
    assert np.std(seen_m[-1]) == pytest.approx(20.0, rel=0.5)


def test_without_noise_its_time_changes_nothing():
    for one, other in zip(flown("planner"), flown("planner", position_noise_s=3.0), strict=True):
        np.testing.assert_array_equal(one, other)


def test_errors_depend_on_the_seed_alone():
    together = flown("spatial-tdma", (4, 5, 6), position_noise_m=5.0)
    for one, alone in zip(together, flown("spatial-tdma", (5,), position_noise_m=5.0), strict=True):
        np.testing.assert_array_equal(one[:, 1:2], alone)


@pytest.mark.parametrize("prior_knowledge", ["nothing", "start"])
def test_teams_at_rest_agree_on_where_all_are(prior_knowledge):
    """Every estimate stays as it was, and so the planner makes one plan."""
    given = {"prior_knowledge": prior_knowledge, "position_noise_m": 5.0}
    mission = paper("stationary", num_robots=10, **given)
    swarm, policy = Swarm(mission, [1]), make_policy("planner", mission)
    start_m = swarm.buffers.position_m[:, EVERYONE, EVERYONE].copy()
    assert np.std(start_m - swarm.states.position_m) == pytest.approx(5.0, rel=0.5)
    swarm.start(policy)
    for _ in range(60):
        swarm.step()
    assert np.all(swarm.buffers.is_known)
    np.testing.assert_array_equal(swarm.buffers.position_m[0], start_m.repeat(10, 0))
    assert len(policy._teams[0]._flights) == 1
