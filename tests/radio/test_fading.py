"""Keyed numbers, fades, bursts and shadowing against the laws of what they stand for."""

import numba
import numpy as np
import pytest
from scipy import stats

from swarm_mj.radio.fading import (
    draw_waves,
    fade,
    follow_robots,
    is_in_burst,
    keyed_normals,
    keyed_uniform,
    link_key,
    mixed,
    shadow,
)
from swarm_mj.system.decibels import DB_PER_NEPER

NUM = 20_000


@numba.njit
def uniforms(key, num):
    return np.array([keyed_uniform(mixed(np.uint64(key), np.uint64(n))) for n in range(num)])


@numba.njit
def normals(key, num):
    drawn = np.empty((num, 2))
    for n in range(num):
        drawn[n] = keyed_normals(mixed(np.uint64(key), np.uint64(n)))
    return drawn


@numba.njit
def link_uniforms(key, num_robots):
    drawn = np.empty((num_robots, num_robots))
    for i in range(num_robots):
        for j in range(num_robots):
            drawn[i, j] = keyed_uniform(link_key(np.uint64(key), i, j))
    return drawn


def test_neighbouring_numbers_give_independent_uniform_ones():
    drawn = uniforms(7, NUM)
    assert stats.kstest(drawn, "uniform").pvalue > 0.001
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 4 / np.sqrt(NUM)
    assert np.all((drawn > 0.0) & (drawn < 1.0))


def test_neighbouring_keys_give_independent_streams():
    assert abs(np.corrcoef(uniforms(7, NUM), uniforms(8, NUM))[0, 1]) < 4 / np.sqrt(NUM)


def test_normal_pairs_are_standard_and_independent():
    drawn = normals(11, NUM)
    for column in drawn.T:
        assert stats.kstest(column, "norm").pvalue > 0.001
    assert abs(np.corrcoef(drawn.T)[0, 1]) < 4 / np.sqrt(NUM)


def test_links_are_the_same_in_both_directions_and_else_different():
    drawn = link_uniforms(5, 30)
    np.testing.assert_array_equal(drawn, drawn.T)
    above = drawn[np.triu_indices(30, 1)]
    assert len(np.unique(above)) == above.size


@numba.njit
def fades(key, rician_k, num):
    drawn = np.empty(num)
    for n in range(num):
        drawn[n] = fade(mixed(np.uint64(key), np.uint64(n)), rician_k)
    return drawn


@numba.njit
def burst_slots(key, begin, end, num):
    return np.array([is_in_burst(np.uint64(key), slot, begin, end) for slot in range(num)])


def test_rayleigh_outage_is_1_minus_exp():
    """P(SNR < x) = 1 - exp(-x / mean SNR)."""
    drawn = fades(1, 0.0, NUM)
    for x in (0.05, 0.3, 1.0, 2.5):
        expected = 1 - np.exp(-x)
        error = 4 * np.sqrt(expected * (1 - expected) / NUM)
        assert np.mean(drawn < x) == pytest.approx(expected, abs=error)


@pytest.mark.parametrize("rician_k", [0.5, 4.0, 20.0])
def test_rician_power_is_non_central_chi_squared(rician_k):
    """Twice (K + 1) times the power has 2 degrees of freedom and non-centrality 2 K."""
    drawn = fades(2, rician_k, NUM)
    law = stats.ncx2(2, 2 * rician_k, scale=1 / (2 * (rician_k + 1)))
    assert stats.kstest(drawn, law.cdf).pvalue > 0.001
    assert np.mean(drawn) == pytest.approx(1.0, abs=0.05)


def test_bursts_have_their_mean_loss_and_mean_length():
    state = burst_slots(3, 0.02, 0.1, 100_000).astype(int)
    num_ends = np.sum(np.diff(state) == -1)
    assert np.mean(state) == pytest.approx(0.02 / 0.12, rel=0.1)
    assert np.sum(state) / num_ends == pytest.approx(1 / 0.1, rel=0.1)


def test_bursts_begin_in_the_stationary_distribution():
    @numba.njit
    def first_slots(num):
        return np.array([is_in_burst(np.uint64(key), 0, 0.02, 0.05) for key in range(num)])

    assert np.mean(first_slots(NUM)) == pytest.approx(2 / 7, abs=4 * np.sqrt(0.2 / NUM))


def test_bursts_are_the_same_whatever_slot_is_asked_for_first():
    @numba.njit
    def backwards(num):
        slots = np.zeros(num, dtype=np.bool_)
        for slot in range(num - 1, -1, -1):
            slots[slot] = is_in_burst(np.uint64(9), slot, 0.1, 0.2)
        return slots

    np.testing.assert_array_equal(backwards(300), burst_slots(9, 0.1, 0.2, 300))


@numba.njit
def powers(first_m, other_m, waves):
    """Of robot 0 at robot 1, in missions of two robots that send with a power of 1."""
    left, position_m = np.ones((len(first_m), 2)), np.empty((2, 2))
    for b in range(len(first_m)):
        position_m[0], position_m[1] = first_m[b], other_m[b]
        follow_robots(waves, b, position_m)
        shadow(waves, b, 0, left[b])
    return left[:, 1]


def loss_db(first_m, other_m, waves):
    """Between ends [b]."""
    return np.log(powers(first_m, other_m, waves)) * DB_PER_NEPER


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
