"""The search against functions whose least is known."""

import numpy as np
import pytest

from swarm_mj.learning.evolution import ask, begin, tell


def searched(cost, num_numbers=20, generations=300, sigma=1.0, seed=0):
    rng = np.random.default_rng(seed)
    search = begin(num_numbers, sigma)
    for _ in range(generations):
        candidates = ask(search, 12, rng)
        tell(search, candidates, np.array([cost(each) for each in candidates]))
    return search


def test_it_finds_the_least_where_numbers_have_very_different_scales():
    """The steps of a number become as much smaller as its scale is larger."""
    scale, least = 10.0 ** np.linspace(0, 2, 20), np.linspace(-3, 3, 20)
    search = searched(lambda x: float(np.sum((scale * (x - least)) ** 2)))
    np.testing.assert_allclose(search.mean, least, atol=1e-3)
    steps = np.sqrt(search.variance)
    assert np.all(steps[:5] > 3.0 * steps[-5:])


def test_only_the_order_of_costs_counts():
    one = searched(lambda x: float(np.sum(x**2)), generations=30)
    other = searched(lambda x: float(np.exp(np.sum(x**2))), generations=30)
    assert one.mean.tolist() == other.mean.tolist()


def test_costs_that_say_nothing_neither_move_it_far_nor_let_steps_grow():
    """A random walk: after 100 generations steps are still of the size 1."""
    rng = np.random.default_rng(3)
    search = searched(lambda _: float(rng.random()), generations=100, seed=1)
    assert 0.3 < search.sigma < 3.0
    assert np.all((search.variance > 0.01) & (search.variance < 100.0))


def test_steps_grow_where_the_least_is_far_away():
    search = searched(lambda x: float(np.sum((x - 1000.0) ** 2)), num_numbers=5, generations=20)
    assert search.sigma > 3.0


def test_by_hand_the_mean_moves_to_the_weighted_mean_of_the_better_half():
    """Of four candidates the best two, by weights of log 2.5 and log 1.25."""
    search = begin(1, 2.0)
    candidates = np.array([[4.0], [-2.0], [1.0], [8.0]])
    tell(search, candidates, np.array([3.0, 1.0, 2.0, 4.0]))
    first, second = np.log(2.5), np.log(1.25)
    assert search.mean[0] == pytest.approx((-2.0 * first + 1.0 * second) / (first + second))
    assert search.generation == 1
