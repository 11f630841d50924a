"""Shadowing against its standard deviation, its correlation in space, and reciprocity."""

import numba
import numpy as np
import pytest

from swarm_mj.radio.free_space import DB_PER_NEPER
from swarm_mj.radio.shadowing import draw_waves, follow_robots, shadow


@numba.njit
def powers(first_m, other_m, waves, i):
    """Of robot i at the other one, in missions of two robots that send with a power of 1."""
    left, position_m = np.ones((len(first_m), 2)), np.empty((2, 2))
    for b in range(len(first_m)):
        position_m[0], position_m[1] = first_m[b], other_m[b]
        follow_robots(waves, b, position_m)
        shadow(waves, b, i, left[b])
    return left[:, 1 - i]


def loss_db(first_m, other_m, waves, i=0):
    """Between ends [b]."""
    return np.log(powers(first_m, other_m, waves, i)) * DB_PER_NEPER


@pytest.fixture(scope="module")
def drawn():
    """3000 missions, each with a link of 200 m somewhere."""
    rng = np.random.default_rng(0)
    waves = draw_waves(6.0, 20.0, 2, [np.random.default_rng(seed) for seed in range(3000)])
    waves = waves._replace(step_m=1e-3)  # which rounds nothing
    first_m = rng.uniform(-400.0, 400.0, (3000, 2))
    angle = rng.uniform(0.0, 2 * np.pi, 3000)
    other_m = first_m + 200.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return waves, first_m, other_m


def test_losses_have_the_standard_deviation_and_no_mean(drawn):
    waves, first_m, other_m = drawn
    loss = loss_db(first_m, other_m, waves)
    assert np.std(loss) == pytest.approx(6.0, rel=0.05)
    assert np.mean(loss) == pytest.approx(0.0, abs=4 * 6.0 / np.sqrt(3000))


@pytest.mark.parametrize("moved_m", [5.0, 20.0, 40.0])
def test_the_correlation_falls_exponentially_as_one_end_moves(drawn, moved_m):
    waves, first_m, other_m = drawn
    before = loss_db(first_m, other_m, waves)
    after = loss_db(first_m + np.array([moved_m, 0.0]), other_m, waves)
    expected = np.exp(-moved_m / 20.0)
    assert np.corrcoef(before, after)[0, 1] == pytest.approx(expected, abs=0.06)


def test_both_directions_lose_the_same(drawn):
    waves, first_m, other_m = drawn
    forth = loss_db(first_m, other_m, waves)
    back = loss_db(first_m, other_m, waves, 1)
    np.testing.assert_allclose(forth, back, atol=1e-4)
