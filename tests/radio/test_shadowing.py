"""Shadowing against its standard deviation, its correlation in space, and reciprocity."""

import numba
import numpy as np
import pytest

from swarm_mj.radio.shadowing import (
    DB_PER_NEPER,
    NUM_WAVES,
    Shadowing,
    draw_waves,
    set_ends,
    shadowing_neper,
)

FINE_M = 1e-3  # a step that rounds nothing


@numba.njit
def loss_db(first_m, other_m, first_end, other_end, phase, std_db):
    """Between ends [k], one mission each."""
    loss = np.empty(len(first_m))
    a, b = np.empty((4, NUM_WAVES), np.float32), np.empty((4, NUM_WAVES), np.float32)
    for k in range(len(first_m)):
        set_ends(first_m[k], FINE_M, first_end[k], other_end[k], phase[k], a)
        set_ends(other_m[k], FINE_M, first_end[k], other_end[k], phase[k], b)
        loss[k] = shadowing_neper(a, b, std_db) * DB_PER_NEPER
    return loss


@pytest.fixture(scope="module")
def drawn():
    """3000 missions, each with a link of 200 m somewhere."""
    rng = np.random.default_rng(0)
    shadowing = Shadowing(std_db=6.0, correlation_m=20.0)
    waves = draw_waves(shadowing, [np.random.default_rng(seed) for seed in range(3000)])
    first_m = rng.uniform(-400.0, 400.0, (3000, 2))
    angle = rng.uniform(0.0, 2 * np.pi, 3000)
    other_m = first_m + 200.0 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return waves, first_m, other_m


def test_losses_have_the_standard_deviation_and_no_mean(drawn):
    waves, first_m, other_m = drawn
    loss = loss_db(first_m, other_m, *waves, 6.0)
    assert np.std(loss) == pytest.approx(6.0, rel=0.05)
    assert np.mean(loss) == pytest.approx(0.0, abs=4 * 6.0 / np.sqrt(3000))


@pytest.mark.parametrize("moved_m", [5.0, 20.0, 40.0])
def test_the_correlation_falls_exponentially_as_one_end_moves(drawn, moved_m):
    waves, first_m, other_m = drawn
    before = loss_db(first_m, other_m, *waves, 6.0)
    after = loss_db(first_m + np.array([moved_m, 0.0]), other_m, *waves, 6.0)
    expected = np.exp(-moved_m / 20.0)
    assert np.corrcoef(before, after)[0, 1] == pytest.approx(expected, abs=0.06)


def test_both_directions_lose_the_same(drawn):
    waves, first_m, other_m = drawn
    forth = loss_db(first_m, other_m, *waves, 6.0)
    back = loss_db(other_m, first_m, *waves, 6.0)
    np.testing.assert_allclose(forth, back, atol=1e-4)
