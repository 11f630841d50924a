"""Keyed random numbers against the laws of what they stand for."""

import numba
import numpy as np
from scipy import stats

from swarm_mj.radio.counters import keyed_normals, keyed_uniform, link_key, mixed

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


def test_the_same_key_gives_the_same_number():
    np.testing.assert_array_equal(uniforms(3, 50), uniforms(3, 50))


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
