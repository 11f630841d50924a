"""Draws from logits against their probabilities."""

import math

import numpy as np
import pytest

from swarm_mj.policies.learned import IMPOSSIBLE, sample


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_a_grid_of_numbers_draws_each_recipient_as_often_as_it_is_probable(kind):
    """Of 10 000 numbers on a grid, each recipient gets its share but for one at either end."""
    rng = np.random.default_rng(4)
    for scale in (0.1, 1.0, 5.0):
        row = (scale * rng.standard_normal(7)).astype(kind)
        grid = (np.arange(10_000) + 0.5) / 10_000
        drawn = np.bincount(sample(np.tile(row, (10_000, 1)), grid), minlength=7)
        weight = [math.exp(float(logit)) for logit in row]
        expected = [10_000 * w / sum(weight) for w in weight]
        assert np.all(np.abs(drawn - expected) <= 1.01)


def test_the_cumulated_probabilities_decide():
    """Of shares 1/2, 1/4, 0, 1/4, in this order; the largest number below 1 takes the last."""
    shares = np.log([[2.0, 1.0, 1.0, 1.0]])
    shares[0, 2] = IMPOSSIBLE
    uniform = np.array([0.0, 0.499, 0.501, 0.749, 0.751, np.nextafter(1.0, 0.0)])
    drawn = sample(np.tile(shares, (6, 1)), uniform)
    assert drawn.tolist() == [0, 0, 1, 1, 3, 3]
    of_four_alike = sample(np.zeros((4, 4)), np.array([0.0, 0.25, 0.5, 0.75]))
    assert of_four_alike.tolist() == [0, 1, 2, 3]


def test_masked_recipients_are_never_drawn():
    """However likely the others of a row of 9, and whatever the number, 0 included."""
    rng = np.random.default_rng(2)
    logits = 30.0 * rng.standard_normal((5000, 9)).astype(np.float32)
    is_masked = rng.random((5000, 9)) < 0.6
    is_masked[np.arange(5000), rng.integers(0, 9, 5000)] = False
    logits[is_masked] = IMPOSSIBLE
    for uniform in (rng.random(5000), np.zeros(5000), np.full(5000, np.nextafter(1.0, 0.0))):
        assert not np.any(is_masked[np.arange(5000), sample(logits, uniform)])


def test_only_differences_of_logits_count():
    """A thousand more or less overflows nothing."""
    rng = np.random.default_rng(3)
    logits, uniform = rng.standard_normal((100, 5)), rng.random(100)
    for shift in (-1000.0, 1000.0):
        np.testing.assert_array_equal(sample(logits + shift, uniform), sample(logits, uniform))
