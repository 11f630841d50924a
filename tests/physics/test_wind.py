"""The wind around robots with bodies."""

import numpy as np
import pytest

from swarm_mj import paper
from swarm_mj.physics.wind import Wind


def blowing(num_missions, **fields):
    """A wind that has begun, and MuJoCo's numbers that it writes."""
    wind_mps = np.zeros((num_missions, 3))
    wind = Wind(paper("stationary", robot="rover", num_robots=2, **fields), wind_mps)
    wind.start([np.random.default_rng(seed) for seed in range(num_missions)])
    return wind, wind_mps


def test_gusts_have_the_deviation_and_the_time_that_were_asked_for():
    """Of 400 worlds after each of 30 windows, without a mean."""
    wind, wind_mps = blowing(400, gust_mps=2.0, gust_s=1.0)
    winds = []
    for _ in range(30):
        winds.append(wind.now_mps)
        wind.change()
    winds = np.array(winds)
    assert np.std(winds) == pytest.approx(2.0, rel=0.05)
    correlation = np.mean(winds[0] * winds[10]) / np.mean(winds[0] ** 2)
    assert correlation == pytest.approx(np.exp(-1.0), abs=0.15)
    assert np.all(wind_mps[:, 2] == 0.0)


def test_without_gusts_the_wind_blows_to_the_east_at_all_times():
    wind, wind_mps = blowing(2, wind_mps=4.0)
    first_mps = wind.now_mps
    wind.change()
    assert wind_mps.tolist() == [[4.0, 0.0, 0.0]] * 2
    assert first_mps.tolist() == [[4.0, 0.0]] * 2


def test_the_gusts_of_a_mission_are_its_own():
    alone, _ = blowing(1, gust_mps=2.0)
    among_others, _ = blowing(3, gust_mps=2.0)
    alone.change()
    among_others.change()
    np.testing.assert_array_equal(alone.now_mps[0], among_others.now_mps[0])
