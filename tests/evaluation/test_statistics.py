"""Statistics against hand arithmetic, scipy, and a plain bootstrap."""

import math

import numpy as np
import pytest
import scipy.stats
from hypothesis import given
from hypothesis import strategies as st

from swarm_mj.evaluation.statistics import (
    bootstrap_interval,
    quantile_of_counts,
    spread,
    standard_error,
)

NO_INTERVAL = (None, None)


def test_spread_by_hand():
    """Squares of the distances to the mean of 3: 4, 1, 0, 1, 4 are 10; 10 / (5 - 1) = 2.5."""
    found = spread(np.array([5.0, 1.0, 3.0, 2.0, 4.0]))
    assert found["mean"] == 3.0
    assert found["std"] == pytest.approx(math.sqrt(2.5))
    assert found["sem"] == pytest.approx(math.sqrt(2.5 / 5.0))
    assert found["median"] == 3.0
    assert found["p95"] == pytest.approx(4.0 + 0.8)  # 95 % of the way over 4 gaps: 3.8 gaps
    assert found["worst"] == 5.0


def test_errors_as_scipys():
    samples = np.random.default_rng(0).gamma(2.0, size=30)
    assert standard_error(samples) == pytest.approx(scipy.stats.sem(samples))
    assert spread(samples)["std"] == pytest.approx(scipy.stats.tstd(samples))


def test_the_interval_is_near_a_plain_bootstraps_and_students():
    samples = np.random.default_rng(1).normal(50.0, 10.0, size=100)
    low, high = bootstrap_interval(samples)
    rng = np.random.default_rng(2)
    means = [rng.choice(samples, 100).mean() for _ in range(4000)]
    student = scipy.stats.t.interval(0.95, 99, samples.mean(), scipy.stats.sem(samples))
    for expected in (np.percentile(means, [2.5, 97.5]), student):
        np.testing.assert_allclose([low, high], expected, atol=0.15)


def test_the_interval_of_skewed_samples_leans_to_their_tail():
    """What "bias-corrected and accelerated" is for."""
    samples = np.random.default_rng(3).lognormal(sigma=1.5, size=40)
    low, high = bootstrap_interval(samples)
    assert high - samples.mean() > 1.3 * (samples.mean() - low)


def test_the_interval_is_the_same_each_time():
    samples = np.random.default_rng(4).normal(size=20)
    assert bootstrap_interval(samples) == bootstrap_interval(samples.copy())


@pytest.mark.parametrize(
    "samples", [[7.0], [0.0, 0.0], [3.0] * 50, [0.1 + 0.2, 0.3, 0.3], [-5.0, -5.0]]
)
def test_samples_that_do_not_vary_have_no_interval(samples):
    assert bootstrap_interval(np.array(samples)) == NO_INTERVAL
    found = spread(np.array(samples))
    assert (found["ci_low"], found["ci_high"]) == NO_INTERVAL


def test_one_sample_has_no_errors():
    found = spread(np.array([7.0]))
    assert (found["mean"], found["median"], found["p95"], found["worst"]) == (7.0, 7.0, 7.0, 7.0)
    assert found["std"] is None
    assert found["sem"] is None


@pytest.mark.parametrize("samples", [[1.0, 2.0], [0.0, 0.0, 0.0, 1.0], [1e-9, 2e-9, 1e9]])
def test_few_samples_still_have_an_interval_around_them(samples):
    low, high = bootstrap_interval(np.array(samples))
    assert min(samples) <= low <= high <= max(samples)


@pytest.mark.parametrize(
    ("counts", "share", "expected"),
    [
        ([95, 5], 0.95, 0),  # exactly 95 % lie in bin 0
        ([94, 6], 0.95, 1),
        ([0, 0, 1], 0.95, 2),
        ([0, 3, 1, 0], 1.0, 2),
        ([0, 3, 1, 0], 0.0, 0),
    ],
)
def test_quantile_of_counts_by_hand(counts, share, expected):
    assert quantile_of_counts(np.array(counts), share) == expected


@given(st.lists(st.integers(0, 9), min_size=1, max_size=300))
def test_quantile_of_counts_as_of_what_was_counted(values):
    """numpy's inverted distribution function, on the values themselves."""
    counts = np.bincount(values, minlength=10)
    for percent in (50, 100):
        expected = np.percentile(values, percent, method="inverted_cdf")
        assert quantile_of_counts(counts, percent / 100.0) == expected
